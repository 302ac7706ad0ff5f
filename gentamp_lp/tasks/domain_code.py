"""What the Python package of a domain defines, and what is done where it leaves something out.

Compulsory are `Scene`, `make_world` and `stream_map`. All else has a default: the methods of `DomainCode` and the
attributes of `World` below.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.language import Generator
from gentamp_lp.tasks.json_values import from_json, to_json

if TYPE_CHECKING:
    from gentamp_lp.geometry.animation import Animation
    from gentamp_lp.geometry.motion import Motion

NO_ROBOT = "none"
"""What task and plan files have for a robot's name in domains without robots."""

COMPULSORY = ("Scene", "make_world", "stream_map")
_CHECKED = ("encode", "decode", "check_plan", "render_plan")  # hooks whose names are looked for misspelt

Step = tuple[str, Sequence[str]]
"""An action's name and the names of its arguments."""

PlanTransits = Callable[[Any, Sequence[Step], Mapping[str, Any], int, float], Iterator["Motion"]]


class Scene(BaseModel):
    """A `scene:` section without keys, from which domains derive theirs (any pydantic model will do)."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @property
    def files(self) -> Sequence[Path]:
        """Files that the scene is made from; demonstrations are planned again when these change."""
        return ()


def files_of(scene: BaseModel) -> Sequence[Path]:
    """The files of a scene, also of one that does not derive from `Scene`."""
    return scene.files if isinstance(scene, Scene) else getattr(scene, "files", ())


class Named(Protocol):
    """What is read of a robot."""

    @property
    def name(self) -> str:
        """The name that finds it again."""
        ...


@dataclass(frozen=True)
class Nobody:
    """The robot of a world without one."""

    name: str = NO_ROBOT


@dataclass(kw_only=True, eq=False)
class World:
    """What planning reads of a world; a domain's own class derives from it or just has these attributes.

    `static` and `fluents` are the facts of the initial state, tuples of lower-case names: those that no action changes,
    and the others. `values` is what samplers get for each name; without any, each name stands for itself. `avoided`
    holds what the streams are to give no more, see `plan_transits`.
    """

    static: Sequence[Fact] = ()
    fluents: Sequence[Fact] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    robot: Named = field(default_factory=Nobody)
    avoided: set[Any] = field(default_factory=set)


def read_world(world: Any, constants: Sequence[str] = ()) -> World:
    """What planning reads of a domain's world, with defaults for what it lacks: its facts, values, robot."""
    read = World(**{part.name: getattr(world, part.name) for part in fields(World) if hasattr(world, part.name)})
    if not read.values:
        facts = [fact for fact in (*read.static, *read.fluents) if isinstance(fact, tuple)]
        named = (*(name for fact in facts for name in fact[1:]), *constants)
        read.values = {name: name for name in named if isinstance(name, str)}
    return read


class DomainCode:
    """The functions of a domain's package, typed, with defaults for those it leaves out.

    `steps` are those of a plan, `values` maps names (objects and sampled entities) to values. `transits`, waypoints
    (k, n) for each step, are given only for plans of `solve --motion`.
    """

    Scene: type[BaseModel]
    """The schema of the `scene:` section."""
    make_world: Callable[[Any, Mapping[str, int], str, np.random.Generator], Any]
    """`make_world(scene, parameters, robot, rng)`: a world, see `World`; `robot` is a name, `NO_ROBOT` if none is asked
    for. Raises NoAnswer, SceneError, InputError."""
    stream_map: Callable[[Any, int], Mapping[str, Generator]]
    """`stream_map(world, seed)`: the generator of each stream of `stream.pddl`."""
    plan_transits: PlanTransits | None = None
    """`plan_transits(world, steps, values, seed, deadline)`: for `solve --motion`, what leads to the beginning of each
    step. Before it raises NoAnswer or LimitReached it may add to `world.avoided`."""
    animate_plan: Callable[..., Animation] | None = None
    """`animate_plan(world, steps, values, [transits])`: for `gentamp-lp report`."""

    def __init__(self, module: ModuleType, path: Path) -> None:
        """Read a package that was imported from `path`. Raises InputError for what it lacks or misspells."""
        self.module = module
        missing = [hook for hook in COMPULSORY if not hasattr(module, hook)]
        if missing:
            message = f"the domain's Python code lacks {', '.join(missing)}"
            raise InputError(Diagnostic(message, path, hint="see docs/domains.md"))
        for hook in _CHECKED:
            others = [name for name in vars(module) if name not in vars(DomainCode)]
            if not hasattr(module, hook) and (alike := get_close_matches(hook, others, 1, 0.85)):
                hint = "rename it: a domain's function of another name is never called"
                raise InputError(Diagnostic(f"`{alike[0]}` is not `{hook}`", path, hint=hint))
        for hook in (*COMPULSORY, *(name for name in vars(DomainCode) if not name.startswith("_"))):
            if hasattr(module, hook):
                setattr(self, hook, getattr(module, hook))

    @property
    def draws(self) -> bool:
        """Whether the domain draws its plans."""
        return "render_plan" in vars(self)

    def encode(self, value: Any, names: Mapping[int, str]) -> Any:
        """A sampled value as JSON; `names` finds the name of a value by its `id`.

        Here: numbers, strings, lists, tuples and arrays. Raises InputError for other values.
        """
        try:
            return {"value": to_json(value)}
        except (TypeError, ValueError) as error:
            hint = "let the domain define `encode` and `decode`, see docs/domains.md"
            message = f"entity `{names[id(value)]}` cannot be written to a plan: it is or holds {error}"
            raise InputError(Diagnostic(message, self.module.__file__, hint=hint)) from None

    def decode(self, data: Any, world: Any, values: Mapping[str, Any]) -> Any:
        """The value that `encode` wrote; `values` holds the ones before it. Raises KeyError, TypeError, ValueError."""
        return from_json(data["value"])

    def check_facts(self, world: Any, facts: Sequence[Fact], values: Mapping[str, Any]) -> list[str]:
        """What is wrong with a plan file's claims about sampled values that no check of the plan would show."""
        return []

    def check_plan(
        self, world: Any, steps: Sequence[Step], values: Mapping[str, Any], transits: Sequence[Any] | None = None
    ) -> list[str]:
        """What is physically wrong with a plan; here nothing, beyond what its streams' tests say."""
        return []

    def render_plan(
        self,
        world: Any,
        steps: Sequence[Step],
        values: Mapping[str, Any],
        path: Path,
        transits: Sequence[Any] | None = None,
    ) -> None:
        """Write a picture (`.png`, `.gif`) of a plan. Raises InputError: here there is nothing to draw."""
        raise InputError(Diagnostic("the domain draws nothing", self.module.__file__, hint="leave out --render"))
