"""Where things stand in the initial state: free places within the robot's reach, as the scene's `start` says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gentamp_lp.errors import NoAnswer
from gentamp_lp.geometry.collision import Swept, collide
from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.robots import Trajectory
from gentamp_lp.geometry.shapes import GAP, Part, Shape
from gentamp_lp.geometry.transforms import pose

from .scene import Area, At, InTheWay, Scatter, Things, Towers
from .world import TRIES, Placement, World, reachable, uniform_placements

_AGAIN = 5  # draws of the places of all things of a group before an instance is impossible, or some are moved
_LAYOUTS = 2000  # draws of a whole layout with things in the way before that


class Fixed(NoAnswer):
    """A thing with a given place collides or is out of reach: that is soon found out."""


def arrange(world: World, group: Things, names: list[str], stretch: float, rng: np.random.Generator) -> None:
    """Put things where they start; where the support is stretched, so are the places on it."""
    match group.start.choice:
        case At() as at:
            x, y = at.x * stretch, at.y * stretch
            for name in names:
                placement = Placement("world", pose(x, y, GAP, at.yaw))
                if not (_free(world, world.start, name, placement, 0.0) and reachable(world, name, placement, rng)):
                    raise Fixed(f"`{name}` collides or is out of reach at x={x:.3g}, y={y:.3g}")
                _stand(world, name, placement, at.support)
        case Scatter() as scatter:
            area = scatter.area.enlarged(stretch) if scatter.area else world.supports[scatter.support].area
            if scatter.in_the_way is None:
                layout = _scattered(world, names, scatter, area, rng)
            else:
                layout = _layout(world, names, scatter.in_the_way, area, scatter.gap, stretch > 1, rng)
            for name, placement in layout.items():
                _stand(world, name, placement, scatter.support)
        case Towers() as towers:
            _build_towers(world, towers, names, rng)


def _build_towers(world: World, towers: Towers, names: list[str], rng: np.random.Generator) -> None:
    area = world.supports[towers.support].area
    tops: list[tuple[str, int]] = []
    for name in names:
        choice = int(rng.integers(len(tops) + 1))
        if choice < len(tops):
            below, height = tops[choice]
            base = world.start[below]
            stacked = base.transform.copy()
            stacked[2, 3] += world.shapes[below].height + GAP
            placement = Placement("world", stacked, base)
            if height < towers.max_height and reachable(world, name, placement, rng):
                _stand(world, name, placement, below)
                tops[choice] = (name, height + 1)
                if not world.shapes[name].carries:
                    tops.pop(choice)
                continue
        found = _draw(world, name, towers.support, area, towers.gap, world.start, rng)
        if found is None:
            raise _nowhere(name)
        _stand(world, name, found, towers.support)
        if world.shapes[name].carries:
            tops.append((name, 1))


def _scattered(
    world: World, names: Sequence[str], scatter: Scatter, area: Area, rng: np.random.Generator
) -> dict[str, Placement]:
    """A free reachable place for each thing, one after the other; where one finds none, all are drawn again."""
    for _ in range(_AGAIN):
        layout: dict[str, Placement] = {}
        for name in names:
            there = world.start | layout
            placement = _draw(world, name, scatter.support, area, scatter.gap, there, rng)
            if placement is None:
                break
            layout[name] = placement
        else:
            return layout
    raise _nowhere(name)


def _nowhere(name: str) -> NoAnswer:
    return NoAnswer(f"no free reachable place for `{name}` among {TRIES} draws: ask for fewer or smaller things")


def _draw(
    world: World,
    name: str,
    support: str,
    area: Area,
    gap: float,
    there: Mapping[str, Placement],
    rng: np.random.Generator,
) -> Placement | None:
    for placement in uniform_placements(area, rng):
        whole = world.fits(name, support, placement)
        if whole and _free(world, there, name, placement, gap) and reachable(world, name, placement, rng):
            return placement
    return None


def _layout(
    world: World,
    names: Sequence[str],
    clutter: InTheWay,
    area: Area,
    gap: float,
    stretched: bool,
    rng: np.random.Generator,
) -> dict[str, Placement]:
    """Uniform layouts until one has the wanted number of things in the way.

    On a stretched table that hardly happens: there it is drawn first which things are in the way, and each is put at
    a uniform place where it is, or is not. Where something has been out of reach `_AGAIN` times, only that is moved.
    """
    ways = _approaches(world, clutter.target, clutter.approaches, rng)
    wanted = min(len(names) // clutter.one_in, clutter.at_most or len(names))
    missed = 0
    for _ in range(_LAYOUTS):
        chosen = {names[i] for i in rng.permutation(len(names))[:wanted]} if stretched else set()
        layout: dict[str, Placement] = {}
        for name in sorted(names, key=lambda n: n not in chosen) if stretched else names:
            there, shape = world.start | layout, world.shapes[name]
            free = (
                p
                for p in uniform_placements(area, rng)
                if not (stretched and ways[0].hits(shape, p.transform) != (name in chosen))
                and _free(world, there, name, p, gap)
            )
            layout |= zip([name], free, strict=False)
        if len(layout) < len(names):
            continue
        touched = (sum(way.hits(world.shapes[n], p.transform) for n, p in layout.items()) for way in ways)
        if min(touched) != wanted:
            continue
        if all(reachable(world, n, p, rng) for n, p in layout.items()):
            return {name: layout[name] for name in names}
        missed += 1
        if missed >= _AGAIN and _brought_near(world, layout, ways, area, gap, rng):
            return {name: layout[name] for name in names}
    raise NoAnswer(
        f"none of {_LAYOUTS} layouts has exactly {wanted} of {len(names)} things in the way of `{clutter.target}`"
    )


def _brought_near(
    world: World,
    layout: dict[str, Placement],
    ways: Sequence[Swept],
    area: Area,
    gap: float,
    rng: np.random.Generator,
) -> bool:
    """Put what is out of reach elsewhere, as much in the way; tell whether everything can then be reached."""
    for name, placement in layout.items():
        if not reachable(world, name, placement, rng):
            shape, there = world.shapes[name], world.start | {n: p for n, p in layout.items() if n != name}
            touching = [way.hits(shape, placement.transform) for way in ways]
            others = (
                p
                for p in uniform_placements(area, rng)
                if [way.hits(shape, p.transform) for way in ways] == touching
                and _free(world, there, name, p, gap)
                and reachable(world, name, p, rng)
            )
            found = next(others, None)
            if found is None:
                return False
            layout[name] = found
    return True


def _approaches(world: World, name: str, count: int, rng: np.random.Generator) -> list[Swept]:
    """What `count` approaches to a thing where it stands sweep; their grasps become its only ones."""
    placement = world.start[name]
    grasps = [world.grasps[name][i] for i in rng.permutation(len(world.grasps[name]))]
    reached: dict[Grasp, Trajectory] = {}
    for grasp in grasps:
        tool = placement.transform @ grasp.tool
        trajectory = world.robot.reach_from(world.base.place, tool, grasp.opening, rng)
        if trajectory is not None:
            reached[grasp] = trajectory
        if len(reached) == count:
            world.grasps[name] = list(reached)
            world.approaches |= reached
            return [world.robot.swept(t, world.shapes[name], g) for g, t in reached.items()]
    raise NoAnswer(f"`{name}` can be reached with {len(reached)} grasps, not {count}")


def _free(world: World, start: Mapping[str, Placement], name: str, placement: Placement, gap: float) -> bool:
    grown = _inflated(world.shapes[name], gap)
    return not any(
        collide(grown, placement.transform, world.shapes[other], there.transform) for other, there in start.items()
    )


def _inflated(shape: Shape, gap: float) -> Shape:
    """The bounding boxes of a shape's parts and envelope, wider by `gap` on each side."""
    parts = []
    for part in shape.volumes(envelope=True):
        (x0, y0, z0), (x1, y1, z1) = part.bounds
        size = (x1 - x0 + 2 * gap, y1 - y0 + 2 * gap, z1 - z0)
        parts.append(Part("box", size, ((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2)))
    return Shape(tuple(parts))


def _stand(world: World, name: str, placement: Placement, support: str) -> None:
    where = f"at_{name}"
    world.values[where] = placement
    world.static += [("pose", name, where, support), ("stand", name, where)]
    world.fluents.append(("atpose", name, where))
