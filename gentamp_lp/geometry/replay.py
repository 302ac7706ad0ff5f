"""An independent check of motions: everything is replayed in PyBullet, while planning used FCL.

Nothing is raised for a bad plan: each fault is a sentence in `Replay.violations`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gentamp_lp.geometry.bullet import Bullet, Closing
from gentamp_lp.geometry.models import load_model
from gentamp_lp.geometry.playback import riders
from gentamp_lp.geometry.robots import Grasp, Robot, Trajectory
from gentamp_lp.geometry.shapes import Shape, box
from gentamp_lp.geometry.transforms import Array, difference, inverse, pose

PENETRATION = 0.001
"""Depth (m) up to which two bodies may overlap."""

POSITION, ANGLE = 0.001, math.radians(1.0)
"""How far (m, rad) the tool may be from where it is claimed to be."""

PAD = 0.004
"""Largest distance (m) of a finger from the object it holds."""

RESTING = 0.003
"""Largest distance (m) of an object from what it stands on."""

STEP = 0.05
"""Longest move (m) of the tool from one configuration of a trajectory to the next."""

BASE_STEP, BASE_TURN = 0.051, 0.101
"""Longest move (m, rad) of a mobile base from one configuration to the next."""

TABLE = "table"

SLAB = (box(4.0, 4.0, 0.10), pose(0.0, 0.0, -0.10))
"""The table of a robot that does not drive, with its pose: as good as without end."""


@dataclass
class _Object:
    shape: Shape
    body: int
    pose: Array
    support: str | None = None


class Replay(Closing):
    """Tables with their tops at z = 0, a robot and objects; moves the robot and notes what cannot be.

    `tables` are their shapes and poses, by default one without end; `base` is where a mobile robot stands at first.
    Use the replay as a context manager or call `close`.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        tables: Sequence[tuple[Shape, Array]] = (),
        base: Array | None = None,
    ) -> None:
        self.robot = robot
        self.violations: list[str] = []
        self.configuration = robot.standing(base)
        self.opening = robot.opening
        self._world = Bullet()
        self._model = load_model(self._world, robot)
        self._model.set(self.configuration, self.opening)
        self._tables = list(tables) or [SLAB]
        self._slabs = [self._world.add(*table) for table in self._tables]
        self._objects: dict[str, _Object] = {}
        self._held: str | None = None
        self._attached: dict[str, Array] = {}  # poses of the held object and its riders in the tool frame
        self._step = ""

    def close(self) -> None:
        """Free the PyBullet world."""
        self._world.close()

    # the world

    @property
    def held(self) -> str | None:
        """Name of the held object."""
        return self._held

    def pose(self, name: str) -> Array:
        """Return where an object is now (4×4). Raises KeyError for an unknown name."""
        return self._objects[name].pose.copy()

    def support(self, name: str) -> str | None:
        """Return what an object stands on (`TABLE` or a name), None while it is held or when it floats."""
        return self._objects[name].support

    def add(self, name: str, shape: Shape, pose: Array, support: str | None = None) -> list[str]:
        """Put an object into the world and check that it rests and overlaps nothing.

        `support` is the claimed support; without it any will do. Returns the new violations. Raises
        ValueError for a name that is taken.
        """
        if name in self._objects or name == TABLE:
            raise ValueError(f"there is already an object {name}")
        first = self._begin(f"put {name}")
        body = self._world.add(shape, pose)
        self._objects[name] = _Object(shape, body, np.array(pose, dtype=np.float64))
        self._rest(name, support)
        self._check_objects([name])
        return self.violations[first:]

    # actions

    def move(
        self, trajectory: Trajectory, *, reverse: bool = False, label: str = "move", apart: bool = False
    ) -> list[str]:
        """Step through the configurations of a trajectory, backwards if asked, and return the new violations.

        A held object and all that stands on it move along; `apart`: they must not touch the arm that holds them. The
        way from the previous configuration to the first of the trajectory is not checked: a plan that leaves out
        transit motions leaves them out here.
        """
        first = self._begin(label)
        path = trajectory.configurations[::-1] if reverse else trajectory.configurations
        if len(path) == 0:
            self._note("the trajectory is empty")
        before: Array | None = None
        for index, configuration in enumerate(path):
            self._step = f"{label}, step {index}"
            if self.robot.mobile:
                self._drive(np.asarray(configuration))
            self.configuration, self.opening = np.array(configuration), trajectory.opening
            if not 0.0 <= self.opening <= self.robot.opening + 1e-9:
                self._note(f"the gripper cannot open to {self.opening:.4f} m")
            for joint in self._model.beyond_limits(self.configuration):
                self._note(f"{joint} is beyond its limits")
            self._model.set(self.configuration, self.opening)
            tool = self._model.tool()
            if before is not None and difference(before, tool)[0] > STEP:
                self._note(f"the tool jumps by {difference(before, tool)[0]:.3f} m")
            before = tool
            carried = self._carry(tool)
            self._check_objects(carried)
            self._check_robot(carried)
            if apart:
                self._check_arm(carried)
        return self.violations[first:]

    def grasp(self, name: str, grasp: Grasp | None = None, *, label: str = "") -> list[str]:
        """Take an object at the present configuration and return the new violations.

        The fingers must be on both sides of it; with `grasp`, the tool must be where that says.
        """
        first = self._begin(label or f"grasp {name}")
        if self._held is not None:
            self._note(f"the gripper already holds {self._held}")
            return self.violations[first:]
        if name not in self._objects:
            self._note(f"there is no object {name}")
            return self.violations[first:]
        item = self._objects[name]
        above = riders(name, {other: thing.support for other, thing in self._objects.items()})
        if above and item.shape.interior is None:
            self._note(f"{name} has {', '.join(above)} on it")
        tool = self._model.tool()
        if grasp is not None:
            self._compare("the tool", tool, item.pose @ grasp.tool)
            if abs(grasp.opening - self.opening) > PAD:
                self._note(f"the fingers are {self.opening:.4f} m apart, the grasp says {grasp.opening:.4f} m")
        self._straddle(name, tool)
        self._held, item.support = name, None
        self._attached = {n: inverse(tool) @ self._objects[n].pose for n in (name, *above)}
        return self.violations[first:]

    def release(
        self, name: str, support: str | None = None, pose: Array | None = None, *, label: str = ""
    ) -> list[str]:
        """Let go of the held object and return the new violations.

        It must rest on the claimed support (any, when None), and be at the claimed pose if one is given.
        """
        first = self._begin(label or f"release {name}")
        if self._held != name:
            self._note(f"the gripper holds {self._held or 'nothing'}, not {name}")
            return self.violations[first:]
        self._held, self._attached = None, {}
        if pose is not None:
            self._compare(name, self._objects[name].pose, pose)
        self._rest(name, support)
        return self.violations[first:]

    def pick(self, name: str, trajectory: Trajectory, grasp: Grasp | None = None) -> list[str]:
        """Approach, grasp and retreat the same way; return the new violations."""
        return [
            *self.move(trajectory, label=f"approach {name}"),
            *self.grasp(name, grasp),
            *self.move(trajectory, reverse=True, label=f"lift {name}"),
        ]

    def place(
        self, name: str, trajectory: Trajectory, support: str | None = None, pose: Array | None = None
    ) -> list[str]:
        """Bring the held object, release it and retreat; return the new violations."""
        return [
            *self.move(trajectory, label=f"lower {name}"),
            *self.release(name, support, pose),
            *self.move(trajectory, reverse=True, label=f"leave {name}"),
        ]

    # checks

    def _drive(self, configuration: Array) -> None:
        """Note when the base of a mobile robot is not near where it was."""
        (x, y, yaw), (x0, y0, yaw0) = configuration[:3], self.configuration[:3]
        metres, radians = difference(pose(x, y, 0.0, yaw), pose(x0, y0, 0.0, yaw0))
        if metres > BASE_STEP or radians > BASE_TURN:
            self._note(f"the base jumps by {metres:.3f} m and {math.degrees(radians):.0f} degrees")

    def _begin(self, label: str) -> int:
        """Set what violations are said of; return how many there are."""
        self._step = label
        return len(self.violations)

    def _note(self, fault: str) -> None:
        self.violations.append(f"{self._step}: {fault}")

    def _compare(self, what: str, found: Array, claimed: Array) -> None:
        """Note when a pose is not the claimed one."""
        metres, radians = difference(found, claimed)
        if metres > POSITION or radians > ANGLE:
            self._note(f"{what} is {1000 * metres:.1f} mm and {math.degrees(radians):.1f} degrees off")

    def _carry(self, tool: Array) -> list[str]:
        """Move the held object and its riders with the tool; return their names."""
        for name, attachment in self._attached.items():
            moved = self._objects[name]
            moved.pose = tool @ attachment
            self._world.move(moved.body, moved.pose)
            if name != self._held and moved.pose[2, 2] < math.cos(ANGLE):
                self._note(f"{name} tips")
        return list(self._attached)

    def _deepest(self, first: int, second: int, *, mounted: bool = True) -> tuple[int, float] | None:
        """Return the link of the first body that is deepest inside the second, and how deep, or None."""
        found = [
            (-distance, link)
            for link, distance, _ in self._world.closest(first, second, 0.0)
            if distance < -PENETRATION and (mounted or (first, link) not in self._model.mounted)
        ]
        return (max(found)[1], max(found)[0]) if found else None

    def _check_objects(self, moved: list[str]) -> None:
        """Note overlaps of the moved objects with the table and with all others."""
        bodies = {self._objects[name].body: name for name in moved}
        obstacles = self._with_tables({other: i.body for other, i in self._objects.items() if other not in moved})
        for body, obstacle in self._world.near(list(bodies), list(obstacles)):
            found = self._deepest(body, obstacle)
            if found:
                self._note(f"{bodies[body]} is {1000 * found[1]:.1f} mm inside {obstacles[obstacle]}")

    def _check_robot(self, carried: list[str]) -> None:
        """Note overlaps of the robot with the table and with all objects that it does not carry."""
        obstacles = self._with_tables({n: item.body for n, item in self._objects.items() if n not in carried[:1]})
        for piece, obstacle in self._world.near(self._model.pieces, list(obstacles)):
            found = self._deepest(piece, obstacle, mounted=obstacles[obstacle] != TABLE)
            if found:
                link = self._model.names[piece, found[0]]
                self._note(f"the robot's {link} is {1000 * found[1]:.1f} mm inside {obstacles[obstacle]}")

    def _check_arm(self, carried: list[str]) -> None:
        """Note overlaps of what is carried with links of the robot other than the hand."""
        hand = {self.robot.links[index].name for index in self.robot.hand}
        bodies = {self._objects[name].body: name for name in carried}
        for piece, body in self._world.near(self._model.pieces, list(bodies)):
            for link, distance, _ in self._world.closest(piece, body, 0.0):
                if distance < -PENETRATION and self._model.names[piece, link] not in hand:
                    where = self._model.names[piece, link]
                    self._note(f"{bodies[body]} is {-1000 * distance:.1f} mm inside the {where}")

    def _with_tables(self, obstacles: dict[str, int]) -> dict[int, str]:
        """The names of bodies."""
        return dict.fromkeys(self._slabs, TABLE) | {body: name for name, body in obstacles.items()}

    def _straddle(self, name: str, tool: Array) -> None:
        """Note when a finger is not near the object, or both are on the same side of it."""
        sides = []
        for body, link in self._model.fingers:
            near = self._world.closest(body, self._objects[name].body, PAD, link if link >= 0 else None)
            if not near:
                self._note(f"the {self._model.names[body, link]} is not within {1000 * PAD:.0f} mm of {name}")
                continue
            _, _, point = min(near, key=lambda entry: entry[1])
            sides.append(float((point - tool[:3, 3]) @ tool[:3, 1]))
        if len(sides) == 2 and sides[0] * sides[1] > 0:
            self._note(f"both fingers are on the same side of {name}")

    def _rest(self, name: str, claimed: str | None) -> None:
        """Find what an object stands on and remember it; note when it is nothing or not what was claimed."""
        item = self._objects[name]
        if item.pose[2, 2] < math.cos(ANGLE):
            self._note(f"{name} is not upright")
        if claimed not in (None, TABLE) and claimed not in self._objects:
            self._note(f"there is no object {claimed} to support {name}")
            return
        names = [TABLE, *self._objects] if claimed is None else [claimed]
        supports = [other for other in names if other != name and self._supports(other, item)]
        if supports:
            item.support = supports[0]
        else:
            item.support = None
            self._note(f"{name} does not rest on {claimed or 'anything'}")

    def _supports(self, name: str, item: _Object) -> bool:
        """Tell whether an object's bottom is at a support's top and its centre over it."""
        if name == TABLE:
            x, y, z = item.pose[:3, 3]
            within = (np.abs(where[:2, 3] - [x, y]) <= np.array(shape.extent[:2]) / 2 for shape, where in self._tables)
            return abs(float(z)) <= RESTING and any(bool(inside.all()) for inside in within)
        below = self._objects[name]
        x, y, z = (float(v) for v in (inverse(below.pose) @ item.pose)[:3, 3])
        if below.shape.interior is not None:
            length, width, top = below.shape.interior
            return abs(z - top) <= RESTING and abs(x) <= length / 2 and abs(y) <= width / 2
        for part in below.shape.parts:
            px, py, pz = (float(v) for v in (inverse(part.pose) @ [x, y, z, 1.0])[:3])
            if abs(pz - part.height / 2) <= RESTING and part.carries(px, py):
                return True
        return False
