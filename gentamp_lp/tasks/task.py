"""Task files: what is asked for, in which scenes, and the problem instances drawn from them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from ruamel.yaml.scalarstring import LiteralScalarString

from gentamp_lp.base.reading import line_of, read_yaml, validated
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import Diagnostic, InputError, SceneError
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.pddl import parse_formula
from gentamp_lp.streams.semantics import Program, State
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.tasks.domain_code import NO_ROBOT, World, read_world
from gentamp_lp.tasks.domain_folder import DomainFolder, check_stream_map, check_world, load_domain, running
from gentamp_lp.tasks.grammars import find_grammar

Sizes = tuple[int | str, ...]
LARGEST = 1000  # value of a size parameter: what is larger is a typing mistake


class TaskFile(BaseModel):
    """The schema of a task file; `scene` is checked by the domain."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(pattern=r"^[a-z][a-z0-9_-]*$")
    description: str = ""
    domain: str
    robot: str = Field(NO_ROBOT, description="name or description file; left out in domains without robots")
    size: tuple[str, ...] = Field(min_length=1, description="parameters in the order `--size A-B` gives them")
    defaults: Mapping[str, tuple[int, int]] = Field(
        default_factory=dict, description="inclusive range of a parameter that `--size` leaves out"
    )
    scene: Any
    goal: str
    train: Sizes = Field(min_length=1)
    validation: Sizes | None = Field(
        None, description="sizes to check a policy on; one step above training if not given"
    )
    test: Sizes = ()
    samples: Mapping[str, int] = Field(default_factory=dict, description="draws per stream and inputs")
    max_complexity: int = Field(5, ge=1)
    grammar: tuple[str, ...] = ()


@dataclass(frozen=True)
class Task:
    """A loaded task: its file, its domain, its goal."""

    path: Path
    file: TaskFile
    folder: DomainFolder
    scene: Any
    goal: Formula
    program: Program

    @property
    def name(self) -> str:
        """The task's name."""
        return self.file.name

    @property
    def reference(self) -> str:
        """What finds this task again: the name of a shipped one, else the path of its file."""
        shipped = self.path == resource("tasks", f"{self.path.stem}.yaml")
        return self.path.stem if shipped else str(self.path)

    @classmethod
    def load(cls, name: str | Path, *, trust: bool = False) -> Task:
        """Load a task by path, or by the name of a shipped one. Raises InputError with file, line and remedy."""
        path = _find(name)
        data = read_yaml(path)
        if not isinstance(data, Mapping):
            raise InputError(Diagnostic("a task file is a mapping", path, 1, hint="see tasks/unstack.yaml"))
        file = validated(TaskFile, data, data, path)
        folder = load_domain(file.domain, path.parent, trust=trust)
        scene = validated(folder.code.Scene, data["scene"], data, path, ("scene",))
        literal = isinstance(data["goal"], LiteralScalarString)  # its text starts a line below
        offset = line_of(data, ("goal",)) - (not literal)
        goal = parse_formula(file.goal, folder.domain, path=path, line_offset=offset)
        unknown = sorted(set(file.samples) - {s.name for s in folder.streams})
        if unknown:
            raise InputError(
                Diagnostic(
                    f"`samples` names unknown stream `{unknown[0]}`",
                    path,
                    line_of(data, ("samples", unknown[0])),
                    hint=f"known: {', '.join(s.name for s in folder.streams)}",
                )
            )
        task = cls(path, file, folder, scene, goal, Program.of(folder.domain))
        for key in ("train", "validation", "test"):
            for index, size in enumerate(getattr(file, key) or ()):
                try:
                    task.parameters(size, np.random.default_rng(0))
                except InputError as error:
                    message = error.diagnostics[0].message
                    raise InputError(Diagnostic(message, path, line_of(data, (key, index)))) from None
        return task

    def grammars(self, more: Sequence[Path] = ()) -> list[Path]:
        """The task's grammar files and `more`; names of shipped ones become paths (see `find_grammar`)."""
        own = [find_grammar(name, self.path.parent) for name in self.file.grammar]
        return own + [find_grammar(path) for path in more]

    def parameters(self, size: int | str, rng: np.random.Generator) -> dict[str, int]:
        """Parameter values of a size such as 8 or "2-4"; parameters left out are drawn from their default range."""
        required = [p for p in self.file.size if p not in self.file.defaults]
        parts = str(size).split("-")
        names = list(self.file.size) if len(parts) == len(self.file.size) else required
        if len(parts) != len(names) or not all(p.isdecimal() and 0 < int(p) <= LARGEST for p in parts):
            forms = {"-".join(p.upper() for p in self.file.size), "-".join(p.upper() for p in required)}
            raise InputError(
                Diagnostic(
                    f"`{size}` is not a size of task `{self.name}`",
                    hint=f"write {' or '.join(sorted(forms))} in numbers from 1 to {LARGEST}",
                )
            )
        given = dict(zip(names, map(int, parts), strict=True))
        return {
            p: given[p] if p in given else int(rng.integers(self.file.defaults[p][0], self.file.defaults[p][1] + 1))
            for p in self.file.size
        }

    @property
    def validation_sizes(self) -> list[str]:
        """Sizes on which a policy is tried out before it is believed: by default, for each parameter, the largest
        values seen in training and one more of this one.
        """
        if self.file.validation is not None:
            return [str(size) for size in self.file.validation]
        rng = np.random.default_rng(0)
        train = [self.parameters(size, rng) for size in self.file.train]
        largest = {p: max(parameters[p] for parameters in train) for p in self.file.size}
        return ["-".join(str(n + (p == q)) for q, n in largest.items()) for p in largest]

    def instance(self, size: int | str, seed: int, *, robot: str | None = None) -> Instance:
        """Draw the instance of this size and seed.

        Raises NoAnswer when the scene cannot be built, InputError when the robot could not handle it anyway.
        """
        rng = np.random.default_rng([seed, 0])
        parameters = self.parameters(size, rng)
        folder, robot = self.folder, robot or self.file.robot
        try:
            with running(folder, "make_world", OverflowError):
                world = folder.code.make_world(self.scene, parameters, robot, rng)
        except SceneError as error:
            line = line_of(read_yaml(self.path), ("scene", *error.location))
            raise InputError(*(replace(d, path=self.path, line=line) for d in error.diagnostics)) from None
        except OverflowError as error:
            hint = "numbers in `scene` may be too large"
            raise InputError(Diagnostic(f"the scene cannot be built: {error!r}", self.path, hint=hint)) from error
        with running(folder, "make_world"):
            given = read_world(world, folder.domain.constants)
            check_world(folder, given)
        if given.robot.name == NO_ROBOT != robot:
            hint = "leave out `robot` in the task file, and --robot"
            raise InputError(Diagnostic(f"the domain has no robots, and no `{robot}`", self.path, hint=hint))
        base = self._facts(world, given, seed)
        return Instance(self, str(size), seed, parameters, world, given, base, frozenset(given.fluents))

    def _facts(self, world: Any, given: World, seed: int) -> FactBase:
        """What is known of a world before anything is sampled."""
        folder = self.folder
        with running(folder, "stream_map"):
            generators = folder.code.stream_map(world, seed)
        check_stream_map(folder, generators)
        sorts = infer_sorts(folder.domain, folder.streams, given.static)
        base = FactBase(folder.domain, folder.streams, generators, dict(given.values), sorts)
        for fact in given.static:
            base.add(fact)
        return base


@dataclass(frozen=True, eq=False)
class Instance:
    """One problem: a world of the domain's own class, what is known about it, and its initial state."""

    task: Task
    size: str
    seed: int
    parameters: Mapping[str, int]
    world: Any
    given: World
    base: FactBase
    state: State

    @property
    def robot(self) -> str:
        """The robot's name."""
        return str(self.given.robot.name)

    def renewed(self) -> Instance:
        """The same problem in the same world, with nothing sampled or tested yet."""
        return replace(self, base=self.task._facts(self.world, self.given, self.seed))


def shipped_tasks() -> list[str]:
    """Names of the tasks that come with gentamp-lp."""
    return sorted(path.stem for path in resource("tasks").glob("*.yaml"))


def _find(name: str | Path) -> Path:
    path = Path(name)
    if os.path.exists(path) and not os.path.isdir(path):  # unlike Path.exists, False for impossible names
        return path
    shipped = resource("tasks", f"{name}.yaml")
    if path.suffix == "" and len(path.parts) == 1 and os.path.isfile(shipped):
        return shipped
    hint = f"give the path of a task file or one of: {', '.join(shipped_tasks())}"
    raise InputError(Diagnostic("no such task" if path.suffix == "" else "no such file", str(name), hint=hint))
