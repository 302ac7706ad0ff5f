"""The feature pool, features as formulas and axioms, and their values."""
