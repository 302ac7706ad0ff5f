"""Generalized task and motion planning with logic programming."""
