"""Scenes: what a task file says about the things on the table.

All lengths in metres; the world's origin is the robot's base, z = 0 the top of the table.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationInfo, field_validator, model_validator

from gentamp_lp.geometry import meshes
from gentamp_lp.geometry.assets import find_mesh
from gentamp_lp.geometry.grasping import Approach
from gentamp_lp.geometry.shapes import BLUE, Rgba, Shape, tray
from gentamp_lp.tasks import domain_code

Span = tuple[float, float]
Length = PositiveFloat | tuple[PositiveFloat, PositiveFloat]  # in metres, or a range of it
Count = int | str
Trait = Literal["Block", "Tray", "Mug", "Table", "Region", "Red", "Green", "Blue"]  # what `is` may say
COLOURS = {"Red": (0.80, 0.22, 0.20, 1.0), "Green": (0.30, 0.62, 0.30, 1.0), "Blue": (0.26, 0.45, 0.77, 1.0)}


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


class Scene(domain_code.Scene):
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
