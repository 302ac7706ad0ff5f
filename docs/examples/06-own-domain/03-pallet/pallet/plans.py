"""Plans: their values in files, the replay, and pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.playback import Playback
from gentamp_lp.geometry.render import STILL, film, save_movie, save_still, smooth
from gentamp_lp.geometry.replay import TABLE, Replay
from gentamp_lp.geometry.robots import Trajectory
from gentamp_lp.geometry.shapes import GAP, box
from gentamp_lp.geometry.transforms import Array, pose
from gentamp_lp.tasks.domain_code import Step

from .world import Reach, World

WOOD = (0.55, 0.41, 0.27, 1.0)
MARGIN = 0.06  # the pallet is drawn so much longer and wider than the area for the middles of things


def encode(value: Array | Reach, names: Mapping[int, str]) -> dict[str, Any]:
    """A pose or a reach as JSON."""
    if not isinstance(value, Reach):
        return {"pose": value.tolist()}
    return {
        "thing": value.name,
        "target": value.target.tolist(),
        "tool": value.grasp.tool.tolist(),
        "opening": value.grasp.opening,
        "path": value.path.configurations.tolist(),
    }


def decode(data: Mapping[str, Any], world: World, values: Mapping[str, Any]) -> Array | Reach:
    """The value that `encode` wrote."""
    if "pose" in data:
        return np.array(data["pose"]).reshape(4, 4)
    target, tool = (np.array(data[key]).reshape(4, 4) for key in ("target", "tool"))
    grasp = Grasp(tool, float(data["opening"]))
    path = Trajectory(np.array(data["path"]).reshape(-1, len(world.robot.home)), grasp.opening)
    return Reach(world.robot, data["thing"], world.shapes[data["thing"]], target, grasp, path)


def check_plan(world: World, steps: Sequence[Step], values: Mapping[str, Any]) -> list[str]:
    """Replay a plan in PyBullet; returns what is wrong, and which things end up beside the pallet."""
    with Replay(world.robot) as replay:
        _play(world, steps, values, replay)
        ends = {name: replay.pose(name) for name in world.shapes}
    placed = [args[0] for action, args in steps if action == "place"]
    return replay.violations + [f"{name} is beside the pallet" for name in placed if not _inside(world, ends[name])]


def render_plan(world: World, steps: Sequence[Step], values: Mapping[str, Any], path: Path) -> None:
    """Write a GIF of the plan, or for a `.png` its end."""
    playback = Playback(world.robot)
    _play(world, steps, values, playback)
    (x0, x1), (y0, y1) = world.pallet
    shapes = world.shapes | {"pallet": box(x1 - x0 + MARGIN, y1 - y0 + MARGIN, GAP / 2, WOOD)}
    under = {"pallet": pose((x0 + x1) / 2, (y0 + y1) / 2, 0.0)}
    states = [replace(state, poses=state.poses | under) for state in playback.take()]
    seen = np.array([*(where[:3, 3] for where in world.start.values()), (x1, y0, 0.0), (x1, y1, 0.0)])
    view = STILL.framing(seen, np.full(len(seen), 0.2))
    if path.suffix == ".png":
        save_still(next(film(world.robot, shapes, states[-1:], view)), path)
    else:
        save_movie(film(world.robot, shapes, smooth(world.robot, states), view), path)


def _play(world: World, steps: Sequence[Step], values: Mapping[str, Any], replay: Replay | Playback) -> None:
    """Put up the things, then take one step after the other."""
    for name, shape in world.shapes.items():
        replay.add(name, shape, world.start[name], TABLE)
    for action, (name, where, approach) in steps:
        reach: Reach = values[approach]
        if action == "pick":
            replay.pick(name, reach.path, reach.grasp)
        else:
            replay.place(name, reach.path, TABLE, values[where])


def _inside(world: World, where: Array) -> bool:
    return all(low - 1e-6 <= v <= high + 1e-6 for v, (low, high) in zip(where[:2, 3], world.pallet, strict=True))
