"""The policy as a constrained PDDLStream domain."""
