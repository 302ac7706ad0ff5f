"""Arms with a parallel gripper, from a URDF and a description of it."""

from __future__ import annotations

import math
import tempfile
from itertools import product
from pathlib import Path

import fcl
import numpy as np

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.chain import Chain, read_chain
from gentamp_lp.geometry.collision import at
from gentamp_lp.geometry.description import Bodies, Description
from gentamp_lp.geometry.gripper import approach_poses
from gentamp_lp.geometry.robots import STEPS, Robot, Trajectory
from gentamp_lp.geometry.transforms import Array, Bools, inverse

SEEDS = 6
"""Random restarts of inverse kinematics that are polished together."""

ROUNDS = 4
"""Batches of restarts before a target is given up."""

SEED_ITERATIONS = 40
POLISH_ITERATIONS = 12
TOLERANCE = 1e-6
"""Largest residual (m and rad together) of a solution."""

MAX_STEP = 0.2
"""Largest change (rad, m) of a joint in one step of an approach; more is a jump between branches."""


class Arm(Robot):
    """An arm as a `Description` says; a configuration holds the values of its joints (rad, m), root to tip.

    PyBullet's inverse kinematics gives the seeds, from random restarts (unless the description says that plain restarts
    are better for this arm); damped least squares polishes them;
    soft limits, the straight approach, the table and the robot itself are then checked without PyBullet.
    """

    description: Description

    def __init__(self, name: str, description: Description) -> None:
        self.name = name
        self.description = description
        self.opening = description.opening
        self.fingers = description.pads
        self.home = np.array(list(description.home.values()))
        self.chain: Chain = read_chain(
            description.urdf_path,
            description.tip,
            start=description.mount.matrix,
            tool=description.tool.matrix,
            held=description.posture,
        )
        if self.chain.joints != tuple(description.home):
            expected = ", ".join(self.chain.joints)
            raise InputError(
                Diagnostic("`home` does not list the joints that move the tip", description.path,
                           hint=f"from root to tip they are {expected}; give others a place in `posture`")
            )  # fmt: skip
        self._bodies = Bodies(description, self.chain.links)
        self.links = tuple(self._bodies.links)
        self._behind = np.array(self._bodies.behind)
        names = [link.name for link in self.links]
        self.mounted = frozenset(
            i for i, name in enumerate(names) if self._behind[i] == 0 or name in description.mounted
        )
        pairs = [
            (i, j)
            for some, others in description.self_collisions
            for i, j in product(range(len(names)), repeat=2)
            if names[i] in some and names[j] in others
        ]
        self._pairs = pairs
        self._first, self._second = np.array(pairs, dtype=int).reshape(-1, 2).T
        self._centres = np.array([link.centre for link in self.links])
        radii = np.array([link.radius for link in self.links])
        self._contact = (radii[self._first] + radii[self._second]) ** 2
        self._offsets: dict[float, Array] = {}
        lower, upper = self.chain.lower, self.chain.upper
        self._from = np.where(np.isfinite(lower), lower, -math.pi)
        self._to = np.where(np.isfinite(upper), upper, math.pi)
        self._bullet = Bullet()
        self._body = load_urdf(self._bullet, description)
        self._tip = self._bullet.links(self._body)[description.tip]
        self._joints = [self._bullet.joints(self._body)[joint] for joint in self.chain.joints]
        self._root, self._grip = inverse(description.mount.matrix), inverse(description.tool.matrix)

    def close(self) -> None:
        """Free the PyBullet world."""
        self._bullet.close()

    @property
    def hand(self) -> list[int]:
        """Positions of the links behind the last joint."""
        return np.flatnonzero(self._behind == self.chain.dof).tolist()

    def tools(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) of configurations (n, dof)."""
        return self.chain.tool(configurations)

    def frames(self, configurations: Array, opening: float) -> Array:
        """Return the poses (n, links, 4, 4) of all links."""
        if opening not in self._offsets:
            mount = self.description.mount.matrix
            offsets = [self._bodies.offset(i, opening) for i in range(len(self.links))]
            self._offsets[opening] = np.array(
                [o if behind else mount @ o for o, behind in zip(offsets, self._behind, strict=True)]
            )
        moved = np.empty((len(configurations), self.chain.dof + 1, 4, 4))
        moved[:, 0] = np.eye(4)
        moved[:, 1:] = self.chain.frames(configurations)
        return np.asarray(moved[:, self._behind] @ self._offsets[opening])

    def reach(self, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return a straight approach in joint space that ends at a tool pose, None when none was found."""
        poses = approach_poses(tool_pose)
        if (space := self.description.workspace) is not None:
            last_joint = (poses[[0, -1]] @ inverse(self.chain.tip))[:, :3, 3]
            if not space.holds(last_joint):
                return None
        for _ in range(ROUNDS):
            for candidate in self._solutions(tool_pose, rng):
                configurations = self._approach(poses, candidate)
                if configurations is not None and self._clear(configurations, opening):
                    return Trajectory(configurations, opening)
        return None

    def near(self, configurations: Array, tools: Array) -> tuple[Array, Bools]:
        """Polish configurations by damped least squares."""
        return self.chain.solve(tools, configurations, iterations=POLISH_ITERATIONS, tolerance=TOLERANCE)

    def anywhere(self, first: Array, last: Array, rng: np.random.Generator) -> Array:
        """Return joints uniform within their limits (a full turn where there are none)."""
        return rng.uniform(self._from, self._to)

    def fault(self, configurations: Array, opening: float) -> tuple[int, str] | None:
        """Return the first configuration beyond the limits, in the table or in the robot itself, and why."""
        frames = self.frames(configurations, opening)
        beyond = ~self.chain.within(configurations)
        low = self.heights(frames) <= 0
        found = [(int(np.argmax(mask)), why) for mask, why in (
            (beyond, "a joint is beyond its limits"), (low, "the robot touches the table")) if mask.any()]  # fmt: skip
        until = min((step for step, _ in found), default=len(frames))
        own = self._self_collision(frames[:until])
        if own is not None:
            return own[0], f"the robot's {self.links[own[1]].name} touches its {self.links[own[2]].name}"
        return min(found, default=None)

    def _solutions(self, tool_pose: Array, rng: np.random.Generator) -> Array:
        """Return distinct configurations (n, dof) within the limits whose tool is at a pose; n may be 0."""
        restarts, iterations = self.description.restarts, SEED_ITERATIONS
        seeds = rng.uniform(self._from, self._to, (restarts or SEEDS, self.chain.dof))
        if restarts is None:
            target, iterations = self._root @ tool_pose @ self._grip, POLISH_ITERATIONS
            seeds = np.array([
                self._bullet.inverse_kinematics(self._body, self._tip, target, self._joints, seed, SEED_ITERATIONS)
                for seed in seeds
            ])  # fmt: skip
        targets = np.broadcast_to(tool_pose, (len(seeds), 4, 4))
        values, solved = self.chain.solve(targets, seeds, iterations=iterations, tolerance=TOLERANCE)
        middle = (self._from + self._to) / 2
        values = middle + np.remainder(values - middle + math.pi, 2 * math.pi) - math.pi
        return np.asarray(values[solved & self.chain.within(values)])

    def _approach(self, poses: Array, end: Array) -> Array | None:
        """Return configurations along the tool poses (n, 4, 4) that end at `end`, None where that fails."""
        starts = np.repeat(end[None], STEPS, axis=0)
        before, solved = self.chain.solve(poses[:-1], starts, iterations=POLISH_ITERATIONS, tolerance=TOLERANCE)
        path = np.concatenate([before, end[None]])
        smooth = solved.all() and np.abs(np.diff(path, axis=0)).max() <= MAX_STEP
        return path if smooth and bool(self.chain.within(path).all()) else None

    def _clear(self, configurations: Array, opening: float) -> bool:
        """Tell whether the robot touches neither the table nor itself in any configuration (n, dof)."""
        frames = self.frames(configurations, opening)
        return self.above_table(frames) and self._self_collision(frames) is None

    def _self_collision(self, frames: Array) -> tuple[int, int, int] | None:
        """Return the first of the poses (n, links, 4, 4) in which two links collide, and the two, or None."""
        centres = np.einsum("nlij,lj->nli", frames[:, :, :3, :3], self._centres) + frames[:, :, :3, 3]
        apart = centres[:, self._first] - centres[:, self._second]
        near = (apart * apart).sum(axis=2) < self._contact
        for step, pair in zip(*np.nonzero(near), strict=True):
            first, second = (self._placed(int(i), frames[step, i]) for i in self._pairs[pair])
            if fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()):
                return int(step), *self._pairs[pair]
        return None

    def _placed(self, index: int, frame: Array) -> fcl.CollisionObject:
        """Return a link at a pose as an FCL object."""
        return at(self.links[index].geometry, frame)


def load_urdf(world: Bullet, description: Description) -> int:
    """Load a described robot into a PyBullet world, `package://` resolved; return the body."""
    urdf = description.urdf_path
    if description.packages is None:
        return world.load(urdf)
    text = urdf.read_text(encoding="utf-8").replace("package://", f"{description.packages_path.resolve()}/")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, urdf.name)
        copy.write_text(text, encoding="utf-8")
        return world.load(copy)
