"""The comparison of planning modes."""
