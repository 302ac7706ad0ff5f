"""A task file, the domain that it names, and what every reachable state of the domain obeys."""
