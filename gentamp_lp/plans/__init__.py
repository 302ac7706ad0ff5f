"""A plan file and its independent check."""
