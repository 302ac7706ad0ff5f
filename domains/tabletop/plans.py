"""Plans of the tabletop domain as JSON values, replayed in PyBullet, and as pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.render import STILL, film, save_movie, save_still, smooth
from gentamp_lp.geometry.replay import TABLE, Replay, State
from gentamp_lp.geometry.robots import Trajectory
from gentamp_lp.geometry.transforms import Array

from .samplers import Reach
from .scene import Placement, World

Step = tuple[str, Sequence[str]]


def encode(value: Any, names: Mapping[int, str]) -> dict[str, Any]:
    """A sampled value as JSON; `names` finds the name of a value by its `id`."""
    match value:
        case Placement():
            base = names[id(value.base)] if value.base is not None else None
            return {
                "sort": "placement",
                "frame": value.frame,
                "transform": value.transform.tolist(),
                "base": base,
            }
        case Grasp():
            return {"sort": "grasp", "tool": value.tool.tolist(), "opening": value.opening}
        case Reach():
            return {
                "sort": "reach",
                "object": value.name,
                "placement": names[id(value.placement)],
                "place": names[id(value.support_place)],
                "grasp": names[id(value.grasp)],
                "configurations": value.trajectory.configurations.tolist(),
                "opening": value.trajectory.opening,
            }
    raise TypeError(f"{type(value).__name__} is not a sampled value of this domain")


def decode(data: Mapping[str, Any], world: World, values: Mapping[str, Any]) -> Any:
    """The value that `encode` wrote; `values` holds the ones it refers to. Raises KeyError, ValueError."""
    match data["sort"]:
        case "placement":
            base = values[data["base"]] if data["base"] is not None else None
            return Placement(data["frame"], _matrix(data["transform"]), base)
        case "grasp":
            return Grasp(_matrix(data["tool"]), float(data["opening"]))
        case "reach":
            placement, place, grasp = (values[data[key]] for key in ("placement", "place", "grasp"))
            moving = placement.frame != "world"
            target = place.transform @ placement.transform if moving else placement.transform
            trajectory = Trajectory(np.array(data["configurations"], dtype=np.float64), float(data["opening"]))
            name = data["object"]
            return Reach(world.robot, name, world.shapes[name], placement, place, grasp, target, trajectory)
    raise ValueError(f"unknown sort `{data['sort']}`")


def _matrix(rows: Any) -> Array:
    matrix = np.array(rows, dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("a pose is a 4x4 matrix of finite numbers")
    return matrix


def _support(world: World, name: str) -> str:
    return TABLE if name in world.supports else name


def check_plan(world: World, steps: Sequence[Step], values: Mapping[str, Any]) -> list[str]:
    """Replay a plan in PyBullet; returns what is wrong with it, nothing when it is sound."""
    return _replay(world, steps, values, None)


def _replay(
    world: World, steps: Sequence[Step], values: Mapping[str, Any], watch: Callable[[State], object] | None
) -> list[str]:
    supports = {fact[1]: fact[3] for fact in world.static if fact[0] == "pose"}
    with Replay(world.robot, watch) as replay:
        for name, placement in world.start.items():
            replay.add(name, world.shapes[name], placement.transform, _support(world, supports[name]))
        if watch is not None:
            watch(replay.state())
        for action, (name, where, support, _, grasp, reach) in steps:
            path: Reach = values[reach]
            if action == "pick":
                replay.pick(name, path.trajectory, values[grasp])
                continue
            placement: Placement = values[where]
            target = placement.transform
            if placement.frame != "world":
                target = replay.pose(placement.frame) @ target
            replay.place(name, path.trajectory, _support(world, support), target)
        return list(replay.violations)


def render_plan(world: World, steps: Sequence[Step], values: Mapping[str, Any], path: Path) -> None:
    """Write a GIF of the plan, or for a `.png` its first state beside its last."""
    states: list[State] = []
    _replay(world, steps, values, states.append)
    if path.suffix == ".png":
        first, last = film(world.robot, world.shapes, [states[0], states[-1]], STILL)
        both = Image.new("RGB", (first.width + last.width, first.height))
        both.paste(first, (0, 0))
        both.paste(last, (first.width, 0))
        save_still(both, path)
    else:
        save_movie(film(world.robot, world.shapes, smooth(world.robot, states)), path, seconds=0.08)
