"""Generalized task and motion planning with logic programming."""

__version__ = "0.1.0"
