"""Worlds drawn from a scene: the robot where it works, supports, things of random shapes, and all their facts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from gentamp_lp.errors import Diagnostic, InputError, NoAnswer, SceneError
from gentamp_lp.geometry.make import make_robot, robot_names
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import Shape, box, cylinder
from gentamp_lp.tasks.domain_code import NO_ROBOT

from . import rooms, standing
from .arrange import Fixed, arrange
from .scene import COLOURS, Count, Scene, Span, Support, Things
from .world import Placement, World, spans

PALETTE = [(0.30, 0.47, 0.66, 1.0), (0.95, 0.56, 0.17, 1.0), (0.46, 0.70, 0.45, 1.0), (0.93, 0.79, 0.28, 1.0)]
_PLACES = 3  # where a robot that drives stands in turn, before an instance is called impossible


def make_world(scene: Scene, parameters: Mapping[str, int], robot: str, rng: np.random.Generator) -> World:
    """Draw a collision-free world in which the robot can reach every thing where it stands.

    Raises NoAnswer with the reason when none was found, SceneError for a shape that the robot cannot grasp and for an
    unknown size parameter, InputError without a robot.
    """
    if robot == NO_ROBOT:
        hint = f"add `robot: panda` to the task file, or another of {', '.join(robot_names())}"
        raise InputError(Diagnostic("the domain `tabletop` needs a robot", hint=hint))
    _check_counts(scene, parameters)
    made = _robot(robot)
    supports, stretch = scene.supports, dict.fromkeys(scene.supports, 1.0)
    if made.flies:
        total = sum(_count(group.count, parameters) for group in scene.things)
        stretch = {name: support.area.stretch(total) for name, support in supports.items()}
        supports = {n: s.model_copy(update={"area": s.area.enlarged(stretch[n])}) for n, s in supports.items()}
        made = _robot(robot, max(stretch.values()))
    if scene.from_one_place and not made.flies:
        supports, base = _all_in_reach(scene, made)
        bases = iter([base])
    else:
        bases = standing.starts(made, spans(supports))
    fixed, others = [], []
    for base in bases:
        try:
            return _draw_world(World(robot=made, supports=supports, base=base), scene, parameters, stretch, rng)
        except Fixed as error:
            fixed.append(error)
        except NoAnswer as error:
            others.append(error)
            if len(others) == _PLACES:
                break
    nowhere = NoAnswer(f"no free place for the robot in front of `{next(iter(supports))}`: move the tables apart")
    raise next(iter([*others, *fixed]), nowhere)


def _all_in_reach(scene: Scene, robot: Robot) -> tuple[Mapping[str, Support], rooms.Base]:
    """The supports, with their nearer areas where it must be, and a place from which the robot reaches them all."""
    nearer = {n: s.model_copy(update={"area": s.nearer or s.area}) for n, s in scene.supports.items()}
    for supports in (scene.supports, nearer):
        base = standing.stand(robot, spans(supports))
        if base is not None:
            return supports, base
    raise NoAnswer(
        f"`{robot.name}` does not reach {', '.join(f'`{name}`' for name in supports)} from one place: give them areas"
        " that are `nearer`"
    )


def _draw_world(
    world: World,
    scene: Scene,
    parameters: Mapping[str, int],
    stretch: Mapping[str, float],
    rng: np.random.Generator,
) -> World:
    """Put supports and things into a world, as `make_world` does, with the robot where it is."""
    supports = world.supports
    if world.robot.mobile:
        world.static.append(("beside", "at_base", next(iter(supports))))
    world.values["at_base"] = world.base
    world.static.append(("base", "at_base"))
    world.fluents.append(("atbase", "at_base"))
    for name, support in supports.items():
        world.values[name] = name
        world.values[f"at_{name}"] = Placement("world", np.eye(4))
        world.static += [(trait.lower(), name) for trait in ("Surface", *support.traits)]
        world.static += [("fixed", name, f"at_{name}"), ("stand", name, f"at_{name}")]
    members: dict[str, list[str]] = {}
    for number, group in enumerate(scene.things):
        count = _count(group.count, parameters)
        names = [group.name] if group.count == 1 else [f"{group.name}{i + 1}" for i in range(count)]
        members[group.name] = names
        for index, name in enumerate(names):
            world.values[name] = name
            option = int(rng.integers(len(group.shapes)))
            world.shapes[name] = _shape(group, option, index, name, world, parameters, rng)
            world.grasps[name] = list(world.robot.grasps(world.shapes[name], group.grasp))
            if not world.grasps[name]:
                raise _no_grasp(world, name, group, ("things", number, "shapes", option))
            world.static += [(trait.lower(), name) for trait in ("Movable", *group.traits)]
        arrange(world, group, names, stretch[group.start.choice.support], rng)
    for group in scene.things:
        targets = [t for goal in group.goes for t in members.get(goal, [goal])]
        world.static += [("stackable", o, s) for o in members[group.name] for s in targets if o != s]
    for group in scene.things:
        if any(option.tray is not None and option.tray.exact for option in group.shapes):
            riders = [o for other in scene.things if group.name in other.goes for o in members[other.name]]
            _check_capacity(world, members[group.name], riders)
    world.fluents.append(("handempty",))
    return world


def _check_capacity(world: World, trays: Sequence[str], riders: Sequence[str]) -> None:
    """Make sure that as many things fit on each tray as it has cells, and no more.

    Each thing holds an upright cylinder as wide as its shorter side; the tightest row of those in the tray is a zigzag.
    """
    widths = sorted(min(world.shapes[name].extent[:2]) for name in riders)
    if any(world.shapes[name].meshed for name in riders):
        raise NoAnswer("how many meshes a tray holds is not proved: leave out `exact`, or take boxes and cylinders")
    for name in trays:
        cells, side = world.cells[name]
        if any(max(world.shapes[rider].extent[:2]) > side for rider in riders):
            raise NoAnswer(f"a thing is wider than the cells of `{name}`: make the cells wider than {side} m")
        tight = widths[: cells + 1]
        if len(tight) > cells and _zigzag(tight, side) <= cells * side:
            raise NoAnswer(f"{cells + 1} things could be put on `{name}`, a tray for {cells}: make them wider")


def _zigzag(diameters: Sequence[float], width: float) -> float:
    """A lower bound (m) on the length of a strip that holds circles of these diameters: no two pass each other.

    Two neighbours are least far apart along the strip when they touch, each at one of its edges.
    """
    least = min(diameters)
    across = min(width - least, least)
    return least + (len(diameters) - 1) * math.sqrt(least**2 - across**2)


@lru_cache
def _robot(name: str, stretch: float = 1.0) -> Robot:
    """One robot of each kind a process: loading its meshes takes half a second."""
    return make_robot(name) if stretch == 1.0 else _robot(name).enlarged(stretch)


def _check_counts(scene: Scene, parameters: Mapping[str, int]) -> None:
    for number, group in enumerate(scene.things):
        trays = ((option.tray, index) for index, option in enumerate(group.shapes))
        cells = [(tray.cells, ("shapes", index, "tray", "cells")) for tray, index in trays if tray]
        for count, where in [(group.count, ("count",)), *cells]:
            if isinstance(count, str) and count not in parameters:
                hint = f"parameters: {', '.join(parameters)}"
                raise SceneError(f"`{count}` is no parameter of `size`", ("things", number, *where), hint=hint)


def _count(count: Count, parameters: Mapping[str, int]) -> int:
    return count if isinstance(count, int) else parameters[count]


def _number(value: float | Span, rng: np.random.Generator) -> float:
    return float(rng.uniform(*value)) if isinstance(value, tuple) else value


def _shape(
    group: Things,
    choice: int,
    index: int,
    name: str,
    world: World,
    parameters: Mapping[str, int],
    rng: np.random.Generator,
) -> Shape:
    option = group.shapes[choice]
    colour = next((COLOURS[t] for t in group.traits if t in COLOURS), PALETTE[index % len(PALETTE)])
    if option.box is not None:
        x, y, z = (_number(v, rng) for v in option.box)
        return box(x, y, z, colour)
    if option.cylinder is not None:
        radius, height = (_number(v, rng) for v in option.cylinder)
        return cylinder(radius, height, colour)
    if option.mesh is not None:
        return option.mesh.shape(_number(option.mesh.scale, rng), colour)
    assert option.tray is not None
    cells = _count(option.tray.cells, parameters)
    world.cells[name] = (cells, option.tray.cell)
    return option.tray.shape(cells)


def _no_grasp(world: World, name: str, group: Things, location: tuple[str | int, ...]) -> SceneError:
    """What to say of a thing that cannot be grasped."""
    size = " x ".join(f"{length:.3f}" for length in world.shapes[name].extent)
    way = "" if group.grasp == "any" else f" from the {group.grasp}"
    return SceneError(
        f"`{name}`, {size} m, cannot be grasped{way} by a gripper that opens to {world.robot.opening:.3f} m",
        location,
        hint="make it smaller (a mesh by its `scale`), or change `grasp` or the robot",
    )
