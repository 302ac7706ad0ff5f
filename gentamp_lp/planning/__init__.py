"""Planning an instance: guided by a policy, along a skeleton, or unguided."""
