"""The policy, its guarantee, its bundle and its picture."""
