"""Choosing features and moves that make a policy: the ASP program and its lazy conditions."""
