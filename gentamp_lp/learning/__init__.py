"""From a task to a policy, stage by stage."""
