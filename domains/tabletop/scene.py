"""Scenes: what a task file says about the things on the table, and one world drawn from it.

All lengths in metres; the world's origin is the robot's base, z = 0 the top of the table.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationInfo, field_validator, model_validator

from gentamp_lp.errors import NoAnswer, SceneError
from gentamp_lp.geometry import meshes
from gentamp_lp.geometry.assets import find_mesh
from gentamp_lp.geometry.collision import Swept, collide
from gentamp_lp.geometry.grasping import Approach, Grasp
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.shapes import BLUE, GAP, Part, Rgba, Shape, box, cylinder, tray
from gentamp_lp.geometry.transforms import Array, pose

from . import rooms, standing

Span = tuple[float, float]
Length = PositiveFloat | tuple[PositiveFloat, PositiveFloat]  # in metres, or a range of it
Count = int | str
Trait = Literal["Block", "Tray", "Mug", "Table", "Region", "Red", "Green", "Blue"]  # what `is` may say
COLOURS = {"Red": (0.80, 0.22, 0.20, 1.0), "Green": (0.30, 0.62, 0.30, 1.0), "Blue": (0.26, 0.45, 0.77, 1.0)}
PALETTE = [(0.30, 0.47, 0.66, 1.0), (0.95, 0.56, 0.17, 1.0), (0.46, 0.70, 0.45, 1.0), (0.93, 0.79, 0.28, 1.0)]
_TRIES = 400  # draws of a place before an instance is called impossible
_AGAIN = 5  # draws of the places of all things of a group before that, or before some are moved
_PLACES = 3  # where a robot that drives stands in turn, before that
_LAYOUTS = 2000  # draws of a whole layout with things in the way before that


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Area(_Section):
    """A rectangle on the table, roomy enough for so many `things`.

    Where a robot flies, more things get a table that is larger in proportion.
    """

    x: Span
    y: Span
    things: int | None = Field(None, ge=1)

    def stretch(self, things: int) -> float:
        """How many times as long the rectangle must be to give each of `things` the room that it is meant to give."""
        return math.sqrt(max(1.0, things / (self.things or things)))

    def enlarged(self, factor: float) -> Area:
        """The rectangle stretched away from the origin."""
        (x0, x1), (y0, y1) = self.x, self.y
        return Area(x=(x0 * factor, x1 * factor), y=(y0 * factor, y1 * factor), things=self.things)

    @property
    def spans(self) -> tuple[Span, Span]:
        """Its x and its y."""
        return self.x, self.y

    @model_validator(mode="after")
    def _ordered(self) -> Area:
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if low >= high:
                raise ValueError(f"{name}: the first bound must be below the second")
        return self


class Support(_Section):
    """A fixed support: the table, or a coloured region on it.

    `nearer` is its area instead where a robot does not reach all supports from one place, and there is no tray.
    """

    area: Area
    nearer: Area | None = None
    traits: tuple[Trait, ...] = Field(("Table",), alias="is")


class ShapeOption(_Section):
    """One kind of shape; a pair of numbers is a range to draw from."""

    box: tuple[Length, Length, Length] | None = None
    cylinder: tuple[Length, Length] | None = None
    tray: TrayShape | None = None
    mesh: MeshShape | None = None

    @model_validator(mode="after")
    def _one(self) -> ShapeOption:
        if sum(option is not None for option in (self.box, self.cylinder, self.tray, self.mesh)) != 1:
            raise ValueError("give exactly one of box, cylinder, tray, mesh")
        return self


class TrayShape(_Section):
    """A tray with a row of `cells` square cells of side `cell`.

    `exact`: no more than `cells` of the things that may go there fit on it, however they are put. `mesh`: what it looks
    like (see MeshShape), a flat plate if not given.
    """

    cells: Count
    cell: float = Field(gt=0)
    exact: bool = False
    mesh: Path | None = None

    @field_validator("mesh")
    @classmethod
    def _found(cls, file: Path, info: ValidationInfo) -> Path:
        path = find_mesh(str(file), (info.context or {}).get("folder", Path()))
        meshes.tray_mesh(path, 1.0, 1.0)
        return path

    def shape(self, cells: int) -> Shape:
        """A tray for so many things."""
        length, width = cells * self.cell, self.cell
        return tray(length, width) if self.mesh is None else meshes.tray_mesh(self.mesh, length, width)


class MeshShape(_Section):
    """A mesh: an .obj or .stl `file` beside the task file or in an installed package, times `scale` in metres.

    It stands with the direction `up` of its own frame upwards, and collides as its convex hull or, more exactly and
    more slowly, as convex pieces.
    """

    file: Path
    scale: Length = 1.0
    up: meshes.Vector = (0.0, 0.0, 1.0)
    collision: meshes.Collision = "hull"

    @field_validator("file")
    @classmethod
    def _found(cls, file: Path, info: ValidationInfo) -> Path:
        return find_mesh(str(file), (info.context or {}).get("folder", Path()))

    @model_validator(mode="after")
    def _stands(self) -> MeshShape:
        self.shape(min(self.scale) if isinstance(self.scale, tuple) else self.scale)
        return self

    def shape(self, scale: float, rgba: Rgba = BLUE) -> Shape:
        """The shape at a scale. Raises ValueError for an unusable file."""
        return meshes.mesh(self.file, scale, self.up, self.collision, rgba)


class Towers(_Section):
    """Put each thing on the table or on a clear top, all equally likely, as the paper's Unstack does."""

    support: str = Field(alias="on")
    max_height: int = Field(8, ge=1)
    gap: float = Field(0.03, ge=0)


class InTheWay(_Section):
    """Of N scattered things, exactly N // `one_in` (but no more than `at_most`: there is room for some only) touch the
    approach to a thing that stands there already.

    That thing can be grasped in `approaches` ways; the one that the fewest things touch counts.
    """

    target: str = Field(alias="of")
    one_in: int = Field(ge=1)
    at_most: int | None = Field(None, ge=1)
    approaches: int = Field(1, ge=1)


class Scatter(_Section):
    """Put each thing at a uniform place of an area, `gap` away from the others."""

    support: str = Field(alias="on")
    area: Area | None = None
    gap: float = Field(0.02, ge=0)
    in_the_way: InTheWay | None = None


class At(_Section):
    """Put the thing at a given place (metres, radians)."""

    support: str = Field(alias="on")
    x: float
    y: float
    yaw: float = 0.0


class Start(_Section):
    """Where things are in the initial state."""

    towers: Towers | None = None
    scatter: Scatter | None = None
    at: At | None = None

    @model_validator(mode="after")
    def _one(self) -> Start:
        if sum(option is not None for option in (self.towers, self.scatter, self.at)) != 1:
            raise ValueError("give exactly one of towers, scatter, at")
        return self

    @property
    def choice(self) -> Towers | Scatter | At:
        """The arrangement given."""
        chosen = self.towers or self.scatter or self.at
        assert chosen is not None
        return chosen


class Things(_Section):
    """A group of movable things.

    `is` lists their unary predicates, `grasp` says from where they are grasped, `goes` on which supports they may be
    put.
    """

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    count: Count = 1
    traits: tuple[Trait, ...] = Field((), alias="is")
    shapes: tuple[ShapeOption, ...] = Field(min_length=1)
    grasp: Approach = "top"
    start: Start
    goes: tuple[str, ...]


class Scene(_Section):
    """The `scene:` section of a tabletop task."""

    supports: Mapping[str, Support]
    things: tuple[Things, ...]

    @property
    def from_one_place(self) -> bool:
        """Whether a robot must reach all supports without driving: there are several, and no tray to drive with."""
        shapes = [option for group in self.things for option in group.shapes]
        return len(self.supports) > 1 and not any(option.tray for option in shapes)

    @property
    def files(self) -> list[Path]:
        """The files that the scene is made from."""
        options = [option for group in self.things for option in group.shapes]
        found = [option.mesh.file if option.mesh else option.tray and option.tray.mesh for option in options]
        return [file for file in found if file]

    @model_validator(mode="after")
    def _known(self) -> Scene:
        groups = {group.name for group in self.things}
        for name in self.supports:
            if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
                raise ValueError(f"support `{name}`: use lower-case letters, digits and _")
        if len(groups) < len(self.things) or groups & self.supports.keys():
            raise ValueError("two supports or things have the same name")
        single: set[str] = set()  # the things so far that are alone in their group
        for group in self.things:
            match group.start.choice:
                case Scatter(in_the_way=InTheWay(target=target)) if target not in single:
                    raise ValueError(f"`{group.name}` is in the way of `{target}`, which is no single thing above it")
            if group.count == 1:
                single.add(group.name)
            if group.start.choice.support not in self.supports:
                raise ValueError(f"`{group.name}` starts on `{group.start.choice.support}`, which is no support")
            for goal in group.goes:
                if goal not in self.supports and goal not in groups:
                    raise ValueError(f"`{group.name}` goes to `{goal}`, which is neither a support nor a thing")
        return self


@dataclass(frozen=True, eq=False)
class Placement:
    """A value of sort pose: `transform` (4x4) of the object in `frame` ("world" or the name of a tray).

    `base` is the placement of the movable support it rests on, None on fixed supports and on trays.
    """

    frame: str
    transform: Array
    base: Placement | None = None


@dataclass(eq=False)
class World:
    """One drawn world: shapes, the robot, and the facts of the initial state (predicates lower-case).

    `grasps` are those of each thing, in the order to try; `approaches` has the trajectories of those grasps that the
    layout was made for, `reached` those by which a place was found to be within reach. `base` is where the robot stands
    at first; `tables` are solid tables of finite size with their poses, for mobile robots (a fixed one has a table
    without end). `avoided` has digests of reaches that the streams do not give.
    """

    robot: Robot
    supports: Mapping[str, Support]
    shapes: dict[str, Shape] = field(default_factory=dict)
    grasps: dict[str, list[Grasp]] = field(default_factory=dict)
    approaches: dict[Grasp, Trajectory] = field(default_factory=dict)
    reached: dict[tuple[Placement, Grasp, rooms.Base], Trajectory] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    static: list[tuple[str, ...]] = field(default_factory=list)
    fluents: list[tuple[str, ...]] = field(default_factory=list)
    cells: dict[str, tuple[int, float]] = field(default_factory=dict)
    avoided: set[int] = field(default_factory=set)
    base: rooms.Base = field(default_factory=lambda: rooms.Base(np.zeros(3)))

    @property
    def tables(self) -> list[tuple[Shape, Array]]:
        """The tables of a room."""
        return [rooms.table(*spans) for spans in _spans(self.supports)] if self.robot.mobile else []

    def parkings(self, support: str, rng: np.random.Generator) -> Iterator[rooms.Base | None]:
        """Places for a mobile robot in front of a support, None for each one that is not free."""
        yield from standing.parkings(self.robot, self.supports[support].area.spans, _spans(self.supports), rng)

    @property
    def obstacles(self) -> list[tuple[Shape, Array]]:
        """What drives keep clear of: the tables, with space for what stands on them."""
        return standing.obstacles(_spans(self.supports))

    def fits(self, name: str, support: str, placement: Placement) -> bool:
        """Whether a thing stands wholly on a table of finite size."""
        if not self.robot.mobile:
            return True
        area = self.supports[support].area
        (x0, y0, _), (x1, y1, _) = self.shapes[name].bounds
        corners = placement.transform @ [[x0, x0, x1, x1], [y0, y1, y0, y1], [0.0] * 4, [1.0] * 4]
        return bool(
            all(
                low - rooms.EDGE <= value <= high + rooms.EDGE
                for (low, high), row in zip((area.x, area.y), corners[:2], strict=True)
                for value in row
            )
        )

    @property
    def start(self) -> dict[str, Placement]:
        """Initial placements."""
        return {fact[1]: self.values[fact[2]] for fact in self.fluents if fact[0] == "atpose"}


def make_world(scene: Scene, parameters: Mapping[str, int], robot: str, rng: np.random.Generator) -> World:
    """Draw a collision-free world in which the robot can reach every thing where it stands.

    Raises NoAnswer with the reason when none was found, SceneError for a shape that the robot cannot grasp and for an
    unknown size parameter.
    """
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
        bases = standing.starts(made, _spans(supports))
    fixed, others = [], []
    for base in bases:
        try:
            return _draw_world(World(made, supports, base=base), scene, parameters, stretch, rng)
        except _Fixed as error:
            fixed.append(error)
        except NoAnswer as error:
            others.append(error)
            if len(others) == _PLACES:
                break
    nowhere = NoAnswer(f"no free place for the robot in front of `{next(iter(supports))}`: move the tables apart")
    raise next(iter([*others, *fixed]), nowhere)


class _Fixed(NoAnswer):
    """A thing with a given place collides or is out of reach: that is soon found out."""


def _spans(supports: Mapping[str, Support]) -> tuple[tuple[Span, Span], ...]:
    return tuple(support.area.spans for support in supports.values())


def _all_in_reach(scene: Scene, robot: Robot) -> tuple[Mapping[str, Support], rooms.Base]:
    """The supports, with their nearer areas where it must be, and a place from which the robot reaches them all."""
    nearer = {n: s.model_copy(update={"area": s.nearer or s.area}) for n, s in scene.supports.items()}
    for supports in (scene.supports, nearer):
        base = standing.stand(robot, _spans(supports))
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
        _arrange(world, group, names, stretch[group.start.choice.support], rng)
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


def _arrange(world: World, group: Things, names: list[str], stretch: float, rng: np.random.Generator) -> None:
    """Put things where they start; where the support is stretched, so are the places on it."""
    match group.start.choice:
        case At() as at:
            x, y = at.x * stretch, at.y * stretch
            for name in names:
                placement = Placement("world", pose(x, y, GAP, at.yaw))
                if not (_free(world, world.start, name, placement, 0.0) and reachable(world, name, placement, rng)):
                    raise _Fixed(f"`{name}` collides or is out of reach at x={x:.3g}, y={y:.3g}")
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
    return NoAnswer(f"no free reachable place for `{name}` among {_TRIES} draws: ask for fewer or smaller things")


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


def uniform_placements(area: Area, rng: np.random.Generator, tries: int = _TRIES) -> Iterator[Placement]:
    """Placements with their centre uniform in an area and any yaw."""
    for _ in range(tries):
        x, y, yaw = rng.uniform(*area.x), rng.uniform(*area.y), rng.uniform(-np.pi / 4, np.pi / 4)
        yield Placement("world", pose(x, y, GAP, yaw))


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


def reachable(world: World, name: str, placement: Placement, rng: np.random.Generator) -> bool:
    """Whether some grasp of the thing can be reached where it stands (other things not considered).

    A robot that drives must find it twice: it comes back, and then chance must not decide.
    """
    return _reached(world, name, placement, world.base, rng, times=1 + world.robot.mobile)


def serves(world: World, name: str, support: str, placement: Placement, rng: np.random.Generator) -> bool:
    """Whether an arm that drives reaches what stands in each cell of a tray, from the first place at the support."""
    if name not in world.cells or not isinstance(world.robot, Mobile) or world.robot.arm.flies:
        return True
    base = next((base for base in islice(world.parkings(support, rng), _TRIES) if base), None)
    riders = [fact[1] for fact in world.static if fact[0] == "stackable" and fact[2] == name]
    cells = (Placement("world", placement.transform @ cell.transform) for cell in cell_placements(world, name))
    return base is not None and all(_reached(world, rider, cell, base, rng) for cell in cells for rider in riders[:1])


def cell_placements(world: World, support: str) -> Iterator[Placement]:
    """The cells of a tray, from the end away from its handle; each holds one thing."""
    cells, side = world.cells[support]
    interior = world.shapes[support].interior
    assert interior is not None
    for index in range(cells):
        yield Placement(support, pose((index - (cells - 1) / 2) * side, 0.0, interior[2] + GAP))


def _reached(
    world: World, name: str, placement: Placement, base: rooms.Base, rng: np.random.Generator, times: int = 1
) -> bool:
    """Whether inverse kinematics finds, so many times in a row, an approach for some grasp of a thing."""

    def reach(grasp: Grasp) -> bool:
        found = world.robot.reach_from(base.place, placement.transform @ grasp.tool, grasp.opening, rng)
        if found is not None:
            world.reached[placement, grasp, base] = found
        return found is not None

    return any(all(reach(grasp) for _ in range(times)) for grasp in world.grasps[name])


def _stand(world: World, name: str, placement: Placement, support: str) -> None:
    where = f"at_{name}"
    world.values[where] = placement
    world.static += [("pose", name, where, support), ("stand", name, where)]
    world.fluents.append(("atpose", name, where))
