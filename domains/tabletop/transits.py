"""What the arm does between the motions of a plan: from home or the end of one to the beginning of the next."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.motion import Motion, Space, find_motion
from gentamp_lp.geometry.replay import SLAB
from gentamp_lp.geometry.shapes import Shape
from gentamp_lp.geometry.surroundings import Surroundings
from gentamp_lp.geometry.transforms import Array, inverse
from gentamp_lp.tasks.domain_code import Step

from .plans import motion
from .samplers import Reach
from .world import Placement, World


def plan_transits(
    world: World, steps: Sequence[Step], values: Mapping[str, Any], seed: int, deadline: float
) -> Iterator[Motion]:
    """Yield for each step the motion of the arm that leads to its beginning: first from home, then from the end of the
    step before.

    The fingers are as far apart as in the step that follows. `deadline` is a time of `time.monotonic`. Raises NoAnswer
    when a motion begins or ends in a collision, LimitReached when none was found. What the arm does at the step that it
    cannot get to, or cannot leave, is then one of the things that the world's streams avoid in the future.
    """
    state = _State(world, dict(world.start))
    configuration, before, value = world.robot.home.copy(), "home", None
    for number, (action, args) in enumerate(steps, 1):
        last_value, value = value, values[args[-1]]
        following = motion(world, value)
        first, last = configuration, following.configurations[0]
        if world.robot.mobile:
            first = np.concatenate([last[:3], first[3:]])
        rng = np.random.default_rng([seed, zlib.crc32(b"transit"), number])
        space = Space(state.surroundings(following.opening), state.up)
        step = f"{action}({', '.join(args)})"
        try:
            yield find_motion(space, first, last, rng, deadline)
        except (NoAnswer, LimitReached) as error:
            leaving = not isinstance(value, Reach) or space.around.first_contact(first[None]) is not None
            culprit = last_value if leaving else value
            if isinstance(culprit, Reach):
                world.avoided.add(culprit.digest)
            raise type(error)(f"the arm cannot go from {before} to step {number}, {step}: {error}") from None
        configuration, before = following.configurations[-1 if action in ("carry", "move") else 0], f"the end of {step}"
        state.follow(action, args, values)


@dataclass
class _State:
    """Where things are, and which is held how."""

    world: World
    there: dict[str, Placement]
    held: tuple[str, Grasp] | None = None

    def follow(self, action: str, args: Sequence[str], values: Mapping[str, Any]) -> None:
        """Change with a step."""
        if action == "pick":
            del self.there[args[0]]
            self.held = args[0], values[args[4]]
        elif action == "place":
            self.there[args[0]] = values[args[1]]
            self.held = None

    def surroundings(self, opening: float) -> Surroundings:
        """What the arm moves among, and what it carries."""
        shapes, tables = self.world.shapes, self.world.tables or [SLAB]
        standing: dict[str, tuple[Shape, Array]] = {}
        load: dict[str, tuple[Shape, Array]] = {}
        if self.held:
            name, grasp = self.held
            load[name] = shapes[name], inverse(grasp.tool)
        for name, place in self.there.items():
            if place.frame in load:
                load[name] = shapes[name], load[place.frame][1] @ place.transform
            else:
                base = self.there[place.frame].transform if place.frame != "world" else np.eye(4)
                standing[name] = shapes[name], base @ place.transform
        return Surroundings(self.world.robot, opening, tables, standing, load)

    @property
    def up(self) -> Array | None:
        """The direction in the tool frame that must stay upright, where a tray with things on it is held."""
        if self.held is None or all(place.frame != self.held[0] for place in self.there.values()):
            return None
        return inverse(self.held[1].tool)[:3, 2]
