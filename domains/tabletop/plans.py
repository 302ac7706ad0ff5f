"""Plans of the tabletop domain as JSON values, replayed in PyBullet, and as pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from gentamp_lp.geometry.bullet import Camera
from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.playback import Playback, State
from gentamp_lp.geometry.render import MOVIE, STILL, film, save_movie, save_still, smooth
from gentamp_lp.geometry.replay import ANGLE, POSITION, STEP, TABLE, Replay
from gentamp_lp.geometry.robots import STANDOFF, Trajectory
from gentamp_lp.geometry.shapes import GAP, Shape, box
from gentamp_lp.geometry.transforms import Array, difference, pose
from gentamp_lp.tasks.domain_code import Step

from . import rooms
from .samplers import Reach
from .scene import COLOURS
from .world import Placement, World

if TYPE_CHECKING:
    from gentamp_lp.geometry.animation import Animation

_SMALL_TURN = 0.02  # in transits, the longest move (rad, m) of a joint from one replayed configuration to the next
_JOINED = 1e-6  # (rad, m) how far the ends of a transit may be from the motions it joins
_FINE, _TURN, _MOST = 0.01, 0.1, 300  # the replay stops every 1 cm and 0.1 rad, at most so often between two given ones
_LARGEST = 1000.0  # metres or radians in a plan; beyond, the collision checkers' arithmetic breaks down
_MARGIN = 0.03  # a region is drawn so much wider than the area for the centres of things


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
                "base": names[id(value.base)],
                "configurations": value.trajectory.configurations.tolist(),
                "opening": value.trajectory.opening,
            }
        case rooms.Base():
            return {"sort": "base", "place": value.place.tolist()}
        case rooms.Way():
            return {"sort": "way", "path": value.path.tolist(), "opening": value.opening}
    raise TypeError(f"{type(value).__name__} is not a sampled value of this domain")


def decode(data: Mapping[str, Any], world: World, values: Mapping[str, Any]) -> Any:
    """The value that `encode` wrote; `values` holds the ones it refers to. Raises KeyError, ValueError."""
    match data["sort"]:
        case "placement":
            base = values[data["base"]] if data["base"] is not None else None
            if data["frame"] != "world" and data["frame"] not in world.cells:
                raise ValueError(f"`{data['frame']}` is no tray to place things in")
            return Placement(data["frame"], _matrix(data["transform"]), base)
        case "grasp":
            return Grasp(_matrix(data["tool"]), _opening(data["opening"]))
        case "reach":
            placement, place, grasp, base = (values[data[key]] for key in ("placement", "place", "grasp", "base"))
            if not (isinstance(placement, Placement) and isinstance(place, Placement) and isinstance(grasp, Grasp)):
                raise ValueError("a reach refers to two placements and a grasp")
            if not isinstance(base, rooms.Base):
                raise ValueError("a reach refers to a base")
            moving = placement.frame != "world"
            target = place.transform @ placement.transform if moving else placement.transform
            trajectory = Trajectory(_path(data["configurations"], len(world.robot.home)), _opening(data["opening"]))
            name = data["object"]
            return Reach(world.robot, name, world.shapes[name], placement, place, grasp, base, target, trajectory)
        case "base":
            return rooms.Base(_path([data["place"]] * 2, 3)[0])
        case "way":
            return rooms.Way(_path(data["path"], 3), _opening(data["opening"]))
    raise ValueError(f"unknown sort `{data['sort']}`")


def _small(numbers: Array) -> bool:
    return bool((np.abs(numbers) < _LARGEST).all())


def _matrix(rows: Any) -> Array:
    matrix = np.array(rows, dtype=np.float64)
    if matrix.shape != (4, 4) or not _small(matrix):
        raise ValueError(f"a pose is a 4x4 matrix of numbers below {_LARGEST:.0f}")
    turn = matrix[:3, :3]
    rigid = np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0
    if not rigid or not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("a pose only turns and shifts")
    return matrix


def _path(rows: Any, columns: int) -> Array:
    path = np.array(rows, dtype=np.float64)
    if path.ndim != 2 or len(path) < 2 or path.shape[1:] != (columns,) or not _small(path):
        raise ValueError(f"a path is rows of {columns} numbers below {_LARGEST:.0f}, two or more")
    return path


def _opening(value: Any) -> float:
    if not 0.0 <= float(value) < _LARGEST:
        raise ValueError("an opening is a distance in metres")
    return float(value)


def _support(world: World, name: str) -> str:
    return TABLE if name in world.supports else name


def check_facts(world: World, facts: Sequence[Sequence[str]], values: Mapping[str, Any]) -> list[str]:
    """Compare what a plan claims about sampled values with the values; returns what is wrong."""
    problems = []
    for predicate, *args in facts:
        claim, given = f"{predicate}({', '.join(args)})", [values[name] for name in args]
        match predicate, given:
            case "pose", [_, Placement() as placement, support]:
                if placement.frame != (support if support in world.cells else "world") or placement.base is not None:
                    problems.append(f"{claim}: the placement is not relative to {support}")
                elif support in world.supports and not _inside(world, support, placement):
                    problems.append(f"{claim}: the placement is not on {support}")
            case ("stand", [_, Placement()]) | ("grasp", [_, Grasp()]) | ("traj", [Reach()]):
                pass
            case "base", [rooms.Base()]:
                pass
            case "beside", [rooms.Base() as base, support]:
                if not _beside(world, support, base):
                    problems.append(f"{claim}: the base is not in front of {support}")
            case ("drive", [first, last, rooms.Way() as way]) | ("carry", [_, _, first, last, rooms.Way() as way]):
                if not (_same_place(first.place, way.path[0]) and _same_place(last.place, way.path[-1])):
                    problems.append(f"{claim}: the drive does not lead from the one base to the other")
            case "reach", [name, placement, place, grasp, base, Reach() as reach]:
                stated = reach.placement, reach.support_place, reach.grasp, reach.base
                if reach.name != name or any(
                    a is not b for a, b in zip(stated, (placement, place, grasp, base), strict=True)
                ):
                    problems.append(f"{claim}: the reach is for another object, placement, grasp or base")
                elif world.robot.mobile and not (reach.trajectory.configurations[:, :3] == base.place).all():
                    problems.append(f"{claim}: the reach is not from its base")
                elif abs(reach.trajectory.opening - grasp.opening) > 1e-6:
                    problems.append(f"{claim}: the fingers are not as far apart as the grasp says")
                elif (jump := max(map(_distance, *_ends(world, reach.trajectory)))) > STEP:
                    problems.append(f"{claim}: the tool jumps by {jump:.3f} m")
                elif difference(*world.robot.tools(reach.trajectory.configurations[[0, -1]]))[0] < STANDOFF - POSITION:
                    problems.append(f"{claim}: the approach is shorter than {STANDOFF} m")
            case _:
                problems.append(f"{claim}: a value is not of the right sort")
    return problems


def _ends(world: World, trajectory: Trajectory) -> tuple[Array, Array]:
    """The tool poses before and after each piece of a trajectory."""
    tools = world.robot.tools(trajectory.configurations)
    return tools[:-1], tools[1:]


def _distance(first: Array, second: Array) -> float:
    return difference(first, second)[0]


def _same_place(first: Array, second: Array) -> bool:
    """Whether two base poses are the same but for full turns."""
    metres, radians = difference(*(pose(x, y, 0.0, yaw) for x, y, yaw in (first[:3], second[:3])))
    return metres <= POSITION and radians <= ANGLE


def _beside(world: World, support: str, base: rooms.Base) -> bool:
    area = world.supports[support].area
    stance = world.robot.stance if isinstance(world.robot, Mobile) else 0.0
    return stance - POSITION <= rooms.distance(base.place, area.x, area.y) <= stance + rooms.SLACK + POSITION


def _inside(world: World, support: str, placement: Placement) -> bool:
    (x0, x1), (y0, y1) = world.supports[support].area.x, world.supports[support].area.y
    x, y = placement.transform[:2, 3]
    return bool(x0 - POSITION <= x <= x1 + POSITION and y0 - POSITION <= y <= y1 + POSITION)


def check_plan(
    world: World, steps: Sequence[Step], values: Mapping[str, Any], transits: Sequence[Any] | None = None
) -> list[str]:
    """Replay a plan, with its transits if it has any, in PyBullet; returns what is wrong, nothing when it is sound."""
    if transits is not None and len(transits) != len(steps):
        return [f"the plan has {len(transits)} transits for {len(steps)} steps"]
    with Replay(world.robot, tables=world.tables, base=world.base.place) as replay:
        for _ in _replay(world, steps, values, transits, replay):
            pass
        return replay.violations


def _replay(
    world: World,
    steps: Sequence[Step],
    values: Mapping[str, Any],
    transits: Sequence[Any] | None,
    replay: Replay | Playback,
) -> Iterator[None]:
    """Put up the scene, then take one step after the other."""
    supports = {fact[1]: fact[3] for fact in world.static if fact[0] == "pose"}
    for name, placement in world.start.items():
        replay.add(name, world.shapes[name], placement.transform, _support(world, supports[name]))
    yield
    for number, (action, args) in enumerate(steps):
        if transits is not None:
            _transit(world, replay, f"transit to step {number + 1}", transits[number], motion(world, values[args[-1]]))
        if action in ("carry", "move"):
            replay.move(motion(world, values[args[-1]]), label=action)
        else:
            name, where, support, _, grasp, _, reach = args
            path = _filled(replay, world, values[reach].trajectory)
            if action == "pick":
                replay.pick(name, path, values[grasp])
            else:
                goal: Placement = values[where]
                target = goal.transform
                if goal.frame != "world":
                    target = replay.pose(goal.frame) @ target
                replay.place(name, path, _support(world, support), target)
        yield


def _moments(
    world: World, steps: Sequence[Step], values: Mapping[str, Any], transits: Sequence[Any] | None
) -> list[list[State]]:
    """The states before the first step of a sound plan, and those of each step."""
    playback = Playback(world.robot, world.base.place)
    return [playback.take() for _ in _replay(world, steps, values, transits, playback)]


def motion(world: World, value: Reach | rooms.Way) -> Trajectory:
    """The motion of a step, to or from its last configuration in the case of a reach."""
    return value.trajectory if isinstance(value, Reach) else value.trajectory(world.robot)


def _transit(world: World, replay: Replay | Playback, label: str, rows: Any, following: Trajectory) -> None:
    """Move the arm to where a motion begins; the base, wherever it is, stands still."""
    robot, goal = world.robot, following.configurations[0]
    try:
        path = _path(rows, len(robot.home))
    except (TypeError, ValueError) as error:
        replay.violations.append(f"{label}: {error}")
        return
    first, base = replay.configuration, 3 * robot.mobile
    joined = np.allclose(path[0, base:], first[base:], atol=_JOINED) and np.allclose(path[-1], goal, atol=_JOINED)
    if not joined or (base and not (_same_place(path[0], first) and (path[:, :3] == goal[:3]).all())):
        replay.violations.append(f"{label}: it does not lead from the end of the last motion to the next")
        return
    replay.move(_filled(replay, world, Trajectory(path, following.opening), _SMALL_TURN), label=label, apart=True)


def _filled(replay: Replay | Playback, world: World, trajectory: Trajectory, turn: float = _TURN) -> Trajectory:
    """The trajectory as it is to be shown, or checked."""
    return trajectory if isinstance(replay, Playback) else _dense(world, trajectory, turn)


def _dense(world: World, trajectory: Trajectory, turn: float = _TURN) -> Trajectory:
    """The trajectory with configurations in between, so that nothing is jumped over."""
    path = [trajectory.configurations[0]]
    for after in trajectory.configurations[1:]:
        tools = world.robot.tools(np.array([path[-1], after]))
        pieces = max(difference(*tools)[0] / _FINE, float(np.abs(after - path[-1]).max()) / turn)
        path += [*world.robot.between(path[-1], after, min(math.ceil(pieces) - 1, _MOST)), after]
    return Trajectory(np.array(path), trajectory.opening)


def render_plan(
    world: World,
    steps: Sequence[Step],
    values: Mapping[str, Any],
    path: Path,
    transits: Sequence[Any] | None = None,
) -> None:
    """Write a GIF of the plan, or for a `.png` its first state beside its last."""
    states = [state for moment in _moments(world, steps, values, transits) for state in moment]
    mats = _mats(world)
    shapes = world.shapes | {name: shape for name, (shape, _) in mats.items()}
    where = {name: place for name, (_, place) in mats.items()}
    states = [replace(state, poses=state.poses | where) for state in states]
    if path.suffix == ".png":
        ends = [states[0], states[-1]]
        first, last = film(world.robot, shapes, ends, _view(world, ends, STILL), world.tables)
        both = Image.new("RGB", (first.width + last.width, first.height))
        both.paste(first, (0, 0))
        both.paste(last, (first.width, 0))
        save_still(both, path)
    else:
        images = film(world.robot, shapes, smooth(world.robot, states), _view(world, states, MOVIE), world.tables)
        save_movie(images, path, seconds=0.08)


def animate_plan(
    world: World, steps: Sequence[Step], values: Mapping[str, Any], transits: Sequence[Any] | None = None
) -> Animation:
    """The plan for a viewer in three dimensions: the moments before the first step, and of each step."""
    from gentamp_lp.geometry.animation import animate

    moments = _moments(world, steps, values, transits)
    view = _view(world, [state for moment in moments for state in moment], STILL)
    return animate(world.robot, world.shapes, moments, view, world.tables, _mats(world).values())


def _view(world: World, states: Sequence[State], camera: Camera) -> Camera:
    """A camera that sees the robot and all things where they are in some states, and the tables of a room."""
    if world.tables:
        camera = replace(camera, eye=(1.5, -1.1, 1.3), target=(0.0, 0.0, 0.0))
    corners = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    spheres = [(centre, 0.0) for shape, where in world.tables for centre in corners * shape.extent + where[:3, 3]]
    for state in states:
        spheres += [(state.poses[name][:3, 3], shape.radius) for name, shape in world.shapes.items()]
        for body in world.robot.bodies(state.configuration, state.opening):
            spheres.append((body.pose[:3, :3] @ body.link.centre + body.pose[:3, 3], body.link.radius))
    centres, radii = zip(*spheres, strict=True)
    return camera.framing(np.array(centres), np.array(radii))


def _mats(world: World) -> dict[str, tuple[Shape, Array]]:
    """Flat boxes to draw for the coloured supports, with their poses; a margin holds what stands at the edge."""
    mats = {}
    for name, support in world.supports.items():
        colour = next((COLOURS[trait] for trait in support.traits if trait in COLOURS), None)
        if colour is not None:
            (x0, x1), (y0, y1) = support.area.x, support.area.y
            red, green, blue = ((1.0 + 2 * c) / 3 for c in colour[:3])
            shape = box(x1 - x0 + 2 * _MARGIN, y1 - y0 + 2 * _MARGIN, GAP / 2, (red, green, blue, 1.0))
            mats[name] = shape, pose((x0 + x1) / 2, (y0 + y1) / 2, 0.0)
    return mats
