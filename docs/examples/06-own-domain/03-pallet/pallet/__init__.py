"""Things on a pallet: shapes, a robot hand, collision tests in FCL, plans replayed in PyBullet, and pictures.

Lengths in metres; the robot stands at the origin, z = 0 is the floor.
"""

from .plans import check_plan, decode, encode, render_plan
from .world import Scene, World, make_world, stream_map

__all__ = ["Scene", "World", "check_plan", "decode", "encode", "make_world", "render_plan", "stream_map"]
