"""The tabletop domain's Python side: scenes, samplers, the geometric check of plans, and pictures."""

from .samplers import stream_map
from .scene import Scene, World, make_world

__all__ = ["Scene", "World", "make_world", "stream_map"]
