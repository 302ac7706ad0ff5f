"""Collision-free motions from one configuration to another: the straight line, else RRT-Connect, and shortcuts.

RRT-Connect after Kuffner and LaValle, "RRT-Connect: An efficient approach to single-query path planning", ICRA 2000,
with both trees extended as far as possible. What must stay level is kept so by projecting each configuration, as in
Berenson et al., "Manipulation planning on constraint manifolds", ICRA 2009.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.geometry.surroundings import Surroundings
from gentamp_lp.geometry.transforms import Array, Bools, difference

METRES, RADIANS = 0.002, 0.008
"""Longest move (m, of the tool; rad or m, of a joint) between two configurations that are tested.

So corners passed between them are cut by less than the depth that the replay lets pass; with 5 mm they were not always.
"""

ROUNDS = 1000
"""Extensions of both trees before a motion is given up."""

SHORTCUTS = 40
"""Pairs of configurations between which the straight line is tried."""

_JUMP = 10 * RADIANS  # a larger change from one levelled configuration to the next is a jump between branches
_EXACT = 1e-4  # (rad, m) how far waypoints may leave out what is nearly straight


@dataclass(frozen=True)
class Motion:
    """Waypoints (n, dof), joined by straight lines, and whether the first line tried was free."""

    waypoints: Array
    straight: bool


class Space:
    """Configurations that are free among the surroundings, and level: the direction `up` (3,) of the tool frame keeps
    pointing upwards, unless it is None.
    """

    def __init__(self, around: Surroundings, up: Array | None = None) -> None:
        self.around, self.robot, self.up = around, around.robot, up

    def advance(self, first: Array, target: Array) -> tuple[Array, str | None]:
        """Return free configurations (n, dof) after `first` on the way to `target`, and what ends it before that."""
        rows, why = self._line(first, self.robot.alike(first, target)), None
        if self.up is not None:
            rows, why = self._level(first, rows)
        contact = self.around.first_contact(rows) if len(rows) else None
        if contact is not None:
            return rows[: contact[0]], contact[1]
        return rows, why

    def sample(self, first: Array, last: Array, rng: np.random.Generator) -> Array:
        """Return a random configuration, level if that is asked for and can be done."""
        found = self.robot.anywhere(first, last, rng)
        return found if self.up is None else self._levelled(found[None])[0][0]

    def _line(self, first: Array, target: Array) -> Array:
        tools = self.robot.tools(np.array([first, target]))
        count = max(difference(*tools)[0] / METRES, float(np.abs(target - first).max()) / RADIANS)
        return np.vstack([self.robot.between(first, target, max(0, math.ceil(count) - 1)), target])

    def _level(self, first: Array, rows: Array) -> tuple[Array, str | None]:
        levelled, solved = self._levelled(rows)
        steps = np.abs(np.diff(np.vstack([first, levelled]), axis=0)).max(axis=1)
        bad = np.flatnonzero(~solved | (steps > _JUMP))
        if len(bad):
            return levelled[: bad[0]], "what is held cannot be kept level"
        return levelled, None

    def _levelled(self, rows: Array) -> tuple[Array, Bools]:
        """Turn the tools about the horizontal axes between `up` and the vertical."""
        assert self.up is not None
        tools = self.robot.tools(rows)
        for tool in tools:
            tool[:3, :3] = _upright(tool[:3, :3] @ self.up) @ tool[:3, :3]
        return self.robot.near(rows, tools)


def _upright(direction: Array) -> Array:
    """Return the smallest turn (3×3) that makes a unit vector point upwards."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    return np.array(
        [[1 - x * x / (1 + z), -x * y / (1 + z), -x], [-x * y / (1 + z), 1 - y * y / (1 + z), -y], [x, y, z]]
    )


class _Tree:
    def __init__(self, root: Array) -> None:
        self.nodes = root[None]
        self._ways: list[tuple[int, Array]] = [(-1, root[None])]  # each node's parent and the way from there

    def grow(self, space: Space, target: Array) -> bool:
        """Add a node as near to a target as the line from the nearest node is free; tell whether it is the target."""
        nearest = int(np.argmin(((self.nodes - target) ** 2).sum(axis=1)))
        rows, why = space.advance(self.nodes[nearest], target)
        if len(rows):
            self._ways.append((nearest, rows))
            self.nodes = np.vstack([self.nodes, rows[-1]])
        return why is None and float(np.abs(space.robot.alike(target, rows[-1]) - target).max()) < _EXACT

    def way(self) -> Array:
        """The configurations from the root to the newest node."""
        node, pieces = len(self._ways) - 1, []
        while node >= 0:
            node, rows = self._ways[node]
            pieces.append(rows)
        return np.vstack(pieces[::-1])


def find_motion(space: Space, first: Array, last: Array, rng: np.random.Generator, deadline: float) -> Motion:
    """Return a free motion between two configurations (dof,).

    `deadline` is a time of `time.monotonic`. Raises NoAnswer when one of the two is itself not free, LimitReached when
    `ROUNDS` or the time are over; both say what is in the way.
    """
    for end, where in ((first, "where it begins"), (last, "where it ends")):
        contact = space.around.first_contact(end[None])
        if contact is not None:
            raise NoAnswer(f"{contact[1]} {where}")
    rows, why = space.advance(first, last)
    if why is None:
        ends = np.array([first, last])
        return Motion(ends if space.up is None else _waypoints(np.vstack([first, rows[:-1], last])), straight=True)
    trees = [_Tree(first), _Tree(last)]
    for turn in range(ROUNDS):
        if time.monotonic() > deadline:
            raise LimitReached(f"on the straight line, {why}; no way round was found in the time limit")
        growing, other = trees[turn % 2], trees[1 - turn % 2]
        growing.grow(space, space.sample(first, last, rng))
        if other.grow(space, growing.nodes[-1]):
            path = _shortened(space, np.vstack([trees[0].way(), trees[1].way()[-2::-1]]), rng)
            return Motion(_waypoints(np.vstack([path[:-1], last])), straight=False)
    raise LimitReached(f"on the straight line, {why}; no way round was found in {ROUNDS} tries")


def _shortened(space: Space, path: Array, rng: np.random.Generator) -> Array:
    """Replace pieces of a path (n, dof) by straight lines where these are free."""
    for _ in range(SHORTCUTS):
        i, j = sorted(rng.integers(len(path), size=2))
        rows, why = space.advance(path[i], path[j])
        if why is None and len(rows) < j - i:
            path = np.vstack([path[: i + 1], rows, path[j + 1 :]])
    return path


def _waypoints(path: Array) -> Array:
    """Leave out what is on straight lines between others (Ramer, Douglas and Peucker)."""
    whole = path[-1] - path[0]
    share = np.clip((path - path[0]) @ whole / max(float(whole @ whole), _EXACT**2), 0.0, 1.0)
    off = np.abs(path - path[0] - share[:, None] * whole).max(axis=1)
    if len(path) < 3 or off.max() < _EXACT:
        return path[[0, -1]]
    corner = int(np.argmax(off))
    return np.vstack([_waypoints(path[: corner + 1])[:-1], _waypoints(path[corner:])])
