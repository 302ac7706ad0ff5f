"""The tabletop domain's Python side: scenes, samplers, the geometric check of plans, and pictures."""

from .generator import make_world
from .plans import animate_plan, check_facts, check_plan, decode, encode, render_plan
from .samplers import stream_map
from .scene import Scene
from .transits import plan_transits
from .world import World

__all__ = [
    "Scene",
    "World",
    "animate_plan",
    "check_facts",
    "check_plan",
    "decode",
    "encode",
    "make_world",
    "plan_transits",
    "render_plan",
    "stream_map",
]
