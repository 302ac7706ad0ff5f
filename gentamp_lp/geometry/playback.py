"""Where everything is along motions: forward kinematics of whole trajectories, to look at. Nothing is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gentamp_lp.geometry.robots import Grasp, Robot, Trajectory
from gentamp_lp.geometry.shapes import Shape
from gentamp_lp.geometry.transforms import Array, inverse


@dataclass(frozen=True, eq=False)
class State:
    """A moment: configuration (dof,), finger distance (m), poses of all objects and which one is held."""

    configuration: Array
    opening: float
    poses: dict[str, Array]
    held: str | None


class Playback:
    """A robot and objects that do what `Replay` found sound, under the same names and with what is claimed believed.

    `base` is where a mobile robot stands at first (x, y in m, yaw in rad).
    """

    def __init__(self, robot: Robot, base: Array | None = None) -> None:
        self.robot = robot
        self.violations: list[str] = []
        self.configuration = robot.standing(base)
        self.opening = robot.opening
        self._poses: dict[str, Array] = {}
        self._supports: dict[str, str | None] = {}
        self._attached: dict[str, Array] = {}  # poses of the held object (first) and its riders in the tool frame
        self._states: list[State] = []

    def pose(self, name: str) -> Array:
        """Return where an object is now (4×4). Raises KeyError for an unknown name."""
        return self._poses[name]

    def take(self) -> list[State]:
        """Return the states since the last call, or the present one if nothing has moved."""
        taken, self._states = self._states, []
        return taken or [self._state(self.configuration, {})]

    def add(self, name: str, shape: Shape, pose: Array, support: str) -> None:
        """Put an object on its support."""
        self._poses[name], self._supports[name] = pose, support

    def move(self, trajectory: Trajectory, *, reverse: bool = False, label: str = "", apart: bool = False) -> None:
        """Step through the configurations of a trajectory, backwards if asked, with what is held."""
        path = trajectory.configurations[::-1] if reverse else trajectory.configurations
        self.opening = trajectory.opening
        tools = self.robot.tools(path)
        carried = {name: tools @ attachment for name, attachment in self._attached.items()}
        self._states += [
            self._state(configuration, {name: poses[index] for name, poses in carried.items()})
            for index, configuration in enumerate(path)
        ]
        self.configuration, self._poses = path[-1], self._states[-1].poses

    def pick(self, name: str, trajectory: Trajectory, grasp: Grasp) -> None:
        """Approach, grasp and retreat the same way."""
        self.move(trajectory)
        back = inverse(self.robot.tool(self.configuration))
        self._attached = {n: back @ self._poses[n] for n in (name, *riders(name, self._supports))}
        del self._supports[name]
        self.move(trajectory, reverse=True)

    def place(self, name: str, trajectory: Trajectory, support: str, pose: Array) -> None:
        """Bring the held object, release it and retreat."""
        self.move(trajectory)
        self._attached, self._supports[name] = {}, support
        self.move(trajectory, reverse=True)

    def _state(self, configuration: Array, moved: dict[str, Array]) -> State:
        return State(configuration, self.opening, self._poses | moved, next(iter(self._attached), None))


def riders(name: str, supports: Mapping[str, str | None]) -> list[str]:
    """Return all objects that stand on an object, directly or not."""
    direct = [other for other, support in supports.items() if support == name]
    return direct + [rider for other in direct for rider in riders(other, supports)]
