"""The embedded PDDLStream engine."""
