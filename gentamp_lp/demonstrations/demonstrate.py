"""Demonstrations: plans of the unguided planner on the training problems, and the states around them.

A demonstration should look like a policy at work: short, and choosing alike among equally good steps. Plans are
therefore stripped of steps they can do without and put into one canonical order: at each point the first action of
the domain file that can go next without spoiling the rest goes next. The rule is one for the whole domain.
"""

from __future__ import annotations

import gzip
import hashlib
import time
import zlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import platformdirs

from gentamp_lp.base.shipped import PACKAGE
from gentamp_lp.base.version import __version__
from gentamp_lp.base.writing import replacing
from gentamp_lp.demonstrations.dataset import Dataset, Problem, SeenState, Transition
from gentamp_lp.errors import InputError, LimitReached
from gentamp_lp.streams.downward import SEARCHES, search
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.incremental import simulate, solve_incremental
from gentamp_lp.streams.semantics import (
    Program,
    State,
    Step,
    View,
    applicable,
    apply,
    precondition_holds,
)
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.streams.stream_file import Stream
from gentamp_lp.tasks.invariants import at_most_one
from gentamp_lp.tasks.task import Instance, Task

Progress = Callable[[str], None]
_SHORT, _HALF = 0.1, 0.3  # shares of the time for a short plan with all samples, and with half of them


def short_plan(task: Task, base: FactBase, state: State, *, time_limit: float, seed: int) -> list[Step]:
    """Plan a problem as it should be shown: in few steps, in canonical order.

    Only the first of the planner's searches looks for few steps. Where all samples are too many for it, it is tried on
    half of them; any plan counts only when that fails too. The `seed` hides which of several like things comes first,
    as that must not be learned from. Raises NoAnswer or LimitReached (`time_limit` in seconds).
    """
    program, goal, quota = task.program, task.goal, task.file.samples
    deadline = time.monotonic() + time_limit
    plan: list[Step] | None = None
    with suppress(LimitReached):
        plan = solve_incremental(
            program, base, state, goal, quota=quota, time_limit=_SHORT * time_limit, searches=SEARCHES[:1], seed=seed
        )
    if plan is None:
        half = base.trimmed({name: -(-n // 2) for name, n in quota.items()}, {name for f in state for name in f[1:]})
        with suppress(LimitReached):
            left = _HALF * (deadline - time.monotonic())
            plan = search(program, half, state, goal, time_limit=left, searches=SEARCHES[:1], seed=seed)
    if plan is None:
        left = deadline - time.monotonic()
        plan = solve_incremental(program, base, state, goal, quota=quota, time_limit=left, seed=seed)
    return canonical(program, base, state, goal, plan)


def canonical(program: Program, base: FactBase, state: State, goal: Formula, plan: Sequence[Step]) -> list[Step]:
    """The plan without dispensable steps, in canonical order (see the module's text)."""
    steps = _without_detours(program, base, state, goal, list(plan))
    while True:
        ordered = _in_order(program, base, state, goal, steps)
        steps = _without_detours(program, base, state, goal, ordered)  # a new order may make steps dispensable
        if len(steps) == len(ordered):
            return ordered


def _in_order(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> list[Step]:
    rank = {schema.name: index for index, schema in enumerate(program.domain.actions)}
    ordered: list[Step] = []
    while steps:
        for index in sorted(range(len(steps)), key=lambda i: (rank[steps[i].schema], i)):
            moved = [steps[index], *steps[:index], *steps[index + 1 :]]
            if index == 0 or _reaches(program, base, state, goal, moved):
                break
        else:
            raise AssertionError("a valid plan can always keep its order")
        state = apply(View(program, base, state), moved[0])
        ordered.append(moved[0])
        steps = moved[1:]
    return ordered


def _without_detours(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> list[Step]:
    """Action elimination: drop a step with all later steps that need it, if the goal is still reached."""
    index = 0
    while index < len(steps):
        kept, current = steps[:index], state
        for step in kept:
            current = apply(View(program, base, current), step)
        for step in steps[index + 1 :]:
            view = View(program, base, current)
            if precondition_holds(view, step):
                kept.append(step)
                current = apply(view, step)
        if View(program, base, current).holds(goal):
            steps = kept
        else:
            index += 1
    return steps


def _reaches(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> bool:
    states = simulate(program, base, state, steps)
    return states is not None and View(program, base, states[-1]).holds(goal)


def owners(streams: Iterable[Stream], sorts: dict[str, tuple[str, ...]]) -> list[tuple[str, str, int]]:
    """Argument positions filled by a stream's only output: the entity there determines the whole tuple."""
    found = []
    for stream in streams:
        if len(stream.outputs) != 1:
            continue
        for atom in stream.certified:
            if stream.outputs[0] in atom.args and len(atom.args) > 1:
                position = atom.args.index(stream.outputs[0])
                found.append((atom.predicate, sorts[atom.predicate][position], position + 1))
    return sorted(set(found))


class Recorder:
    """Adds the states and transitions of problems to a dataset."""

    def __init__(self, task: Task, data: Dataset, *, around: bool = True) -> None:
        self.task = task
        self.data = data
        self.around = around
        self._numbers: dict[tuple[int, State], int] = {}
        self._known: dict[tuple[int, int, str], Transition] = {}

    @classmethod
    def start(cls, task: Task, instances: Sequence[Instance], *, around: bool = True) -> Recorder:
        """Begin an empty dataset for these instances."""
        domain, streams = task.folder.domain, task.folder.streams
        sorts = infer_sorts(domain, streams, [fact for i in instances for fact in i.world.static])
        data = Dataset(
            {name: list(row) for name, row in sorts.items()},
            {name: predicate.spelling for name, predicate in domain.predicates.items()},
            owners(streams, sorts),
            at_most_one(domain, [instance.state for instance in instances]),
        )
        return cls(task, data, around=around)

    def record(self, instance: Instance, plan: Sequence[Step], start: State | None = None) -> None:
        """Add a problem, the states of its plan, and (around) all their successors.

        `start` is where the plan begins when it is not the instance's initial state.
        """
        problem = len(self.data.problems)
        base, program, data = instance.base, self.task.program, self.data
        static = [(p, *row) for p, rows in base.static.items() if p in data.predicates for row in rows.rows]
        sorts = sorted({sort for row in data.predicates.values() for sort in row})
        entities = {sort: base.entities(sort) for sort in sorts}
        data.problems.append(Problem(instance.size, instance.seed, sorted(static), entities))
        state = instance.state if start is None else start
        data.states[self._number(problem, state, base)].initial = True
        for step in plan:
            view = View(program, base, state)
            if self.around:
                for other in applicable(view):
                    self._transition(problem, view, other, base, demonstrated=False)
            self._transition(problem, view, step, base, demonstrated=True)
            state = apply(view, step)

    def _transition(self, problem: int, view: View, step: Step, base: FactBase, *, demonstrated: bool) -> None:
        source = self._number(problem, view.state, base)
        target = self._number(problem, apply(view, step), base)
        key = (source, target, step.schema)
        if key not in self._known:
            self._known[key] = Transition(source, target, step.schema, step.args, demonstrated)
            self.data.transitions.append(self._known[key])
        elif demonstrated:
            self._known[key].demonstrated, self._known[key].args = True, step.args

    def _number(self, problem: int, state: State, base: FactBase) -> int:
        key = (problem, state)
        if key not in self._numbers:
            self._numbers[key] = len(self.data.states)
            view = View(self.task.program, base, state)
            derived = [(name, *row) for name in self.task.program.axioms for row in view.extension(name)]
            facts = sorted(state) + sorted(derived)
            self.data.states.append(SeenState(problem, facts, goal=view.holds(self.task.goal)))
        return self._numbers[key]


def demonstrate(
    task: Task,
    *,
    sizes: Sequence[int | str] = (),
    seed: int = 0,
    robot: str | None = None,
    around: bool = True,
    time_limit: float = 600.0,
    cache: bool = True,
    progress: Progress = lambda _: None,
) -> Dataset:
    """Plan the training problems (or problems of other `sizes`) unguided and record what happens, or fetch the record
    from the cache.

    All entities sampled while planning stay in the data, not only those the plan uses: samples in a plan's preimage
    are biased (paper, appendix). Raises NoAnswer or LimitReached from the planner, naming the problem.
    """
    sizes = sizes or task.file.train
    file = cache_path(task, seed, robot, around, sizes)
    known = _cached(file, progress) if cache and file.is_file() else None
    if known is not None:
        return known
    deadline = time.monotonic() + time_limit
    instances, plans = [], []
    for index, size in enumerate(sizes):
        instance = task.instance(size, seed * 1000 + index, robot=robot)
        left = deadline - time.monotonic()
        plan = short_plan(task, instance.base, instance.state, time_limit=left, seed=instance.seed)
        progress(f"demonstration {task.name}-{size}: {len(plan)} steps")
        instances.append(instance)
        plans.append(plan)
    recorder = Recorder.start(task, instances, around=around)
    for instance, plan in zip(instances, plans, strict=True):
        recorder.record(instance, plan)
    if cache:
        with suppress(InputError), replacing(file) as beside:  # the cache saves time, nothing depends on it
            beside.write_bytes(gzip.compress(recorder.data.to_json().encode(), 6, mtime=0))
    return recorder.data


def _cached(file: Path, progress: Progress) -> Dataset | None:
    """The record in the cache; None when it is damaged (gzip has a checksum)."""
    try:
        data = Dataset.from_json(gzip.decompress(file.read_bytes()).decode())
    except (OSError, EOFError, ValueError, zlib.error) as error:
        progress(f"damaged demonstrations in the cache ({file}: {error}) are planned again")
        return None
    progress(f"demonstrations from the cache ({file.name})")
    return data


def cache_path(task: Task, seed: int, robot: str | None, around: bool, sizes: Sequence[int | str]) -> Path:
    """Where these demonstrations are cached: the name is a digest of all that determines them."""
    digest = hashlib.sha256(repr((__version__, seed, robot, around, [str(s) for s in sizes])).encode())
    sources = [p for kind in ("py", "yaml") for p in PACKAGE.rglob(f"*.{kind}")]
    given = getattr(task.scene, "files", [])
    for path in [task.path, *given, *sorted(task.folder.path.glob("*.p*")), *sorted(sources)]:
        digest.update(path.read_bytes())
    return Path(
        platformdirs.user_cache_dir("gentamp-lp"),
        "demonstrations",
        f"{task.name}-{digest.hexdigest()[:16]}.json.gz",
    )
