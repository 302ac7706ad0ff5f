"""Training data from plans: the states along them, and what can be done there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gentamp_lp.demonstrations.dataset import Dataset, SeenState, TrainingProblem, Transition
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.semantics import State, Step, View, applicable, apply
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.streams.stream_file import Stream
from gentamp_lp.tasks.invariants import at_most_one
from gentamp_lp.tasks.task import Instance, Task


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
        sorts = infer_sorts(domain, streams, [fact for i in instances for fact in i.given.static])
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
        data.problems.append(TrainingProblem(instance.size, instance.seed, sorted(static), entities))
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
