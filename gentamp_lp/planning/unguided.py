"""Planning an instance without a policy: by the embedded engine, or by the original PDDLStream where it is at hand."""

from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError, NoAnswer, SolverError
from gentamp_lp.streams.engine import Engine, Options
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Formula, Not, Or
from gentamp_lp.streams.incremental import quota_for, sample, solve_incremental
from gentamp_lp.streams.naming import Names
from gentamp_lp.streams.problem import PlanningProblem
from gentamp_lp.streams.semantics import Step, polarities, reads
from gentamp_lp.streams.stream_file import Stream
from gentamp_lp.tasks.task import Instance


def plan_unguided(
    instance: Instance, algorithm: str | None, engine: str, time_limit: float, progress: Callable[[str], None]
) -> list[Step]:
    """A plan for an instance, by an algorithm (see `choose`) of the `embedded` engine or of `pddlstream`.

    PDDLStream has to be there (`require_pddlstream`). Raises NoAnswer, LimitReached, SolverError.
    """
    if engine == "pddlstream":
        return _pddlstream(instance, algorithm or choose(instance), time_limit)
    problem = PlanningProblem(instance.task.program, instance.base, instance.state, instance.task.goal, Names())
    return search_unguided(problem, instance, algorithm, time_limit, progress)


def search_unguided(
    problem: PlanningProblem,
    instance: Instance,
    algorithm: str | None,
    time_limit: float,
    progress: Callable[[str], None],
) -> list[Step]:
    """A plan for an instance's problem, which may be stated otherwise, by the embedded engine."""
    if (algorithm or choose(instance)) == "incremental":
        return solve_incremental(
            problem.program, problem.base, problem.state, problem.goal,
            quota=instance.task.file.samples, time_limit=time_limit, progress=progress,
        )  # fmt: skip
    deadline = time.monotonic() + time_limit
    if speaks_of_samples(instance):  # as many have to be there as the validator will draw
        predicates = reads(problem.goal, problem.program)
        sample(problem.base, quota_for(problem.base, predicates, instance.task.file.samples), deadline)
    options = Options(time_limit=deadline - time.monotonic(), seed=instance.seed, progress=progress)
    return Engine(problem, options).solve().steps


def choose(instance: Instance) -> str:
    """`adaptive`, which asks less of the streams, unless the goal says something about all samples.

    Such a goal (nothing fits any more, say) means the more the more samples there are, so everything is sampled.
    """
    return "incremental" if speaks_of_samples(instance) else "adaptive"


def speaks_of_samples(instance: Instance) -> bool:
    """Whether the goal says something about all that streams give."""
    read = set(polarities(instance.task.program, instance.task.goal))
    return any((predicate, True) in read for predicate in instance.base.makers)


@dataclass(frozen=True)
class Entity:
    """What PDDLStream is given for a value: our name for it."""

    name: str


def require_pddlstream() -> None:
    """Raise InputError when the original cannot be imported (it looks for its compiled planner when it is)."""
    try:
        import pddlstream.algorithms.meta  # noqa: F401
    except (ImportError, RuntimeError) as error:
        hint = "put github.com/caelan/pddlstream on PYTHONPATH and compile its planner, or do without it"
        raise InputError(Diagnostic(f"PDDLStream cannot be imported: {error}", hint=hint)) from None


def _pddlstream(instance: Instance, algorithm: str, time_limit: float) -> list[Step]:
    """Run the same problem on the original; its streams draw from the instance, so that the plan can be validated."""
    from pddlstream.algorithms.meta import solve
    from pddlstream.language.constants import PDDLProblem
    from pddlstream.language.generator import from_gen_fn, from_test

    base, folder = instance.base, instance.task.folder
    streams = {s.name: from_test(_test(s, instance)) if s.is_test else from_gen_fn(_generator(s, instance))
               for s in base.streams}  # fmt: skip
    known = [(p, *row) for p in folder.domain.predicates for row in base.relation(p).rows]
    init = [(f[0], *map(Entity, f[1:])) for f in (*known, *sorted(instance.state))]
    constants = {name: Entity(name) for name in folder.domain.constants}
    text = (folder.path / "stream.pddl").read_text(encoding="utf-8")
    problem = PDDLProblem(folder.domain.text, constants, text, streams, init, _expression(instance.task.goal))
    temporary = tempfile.TemporaryDirectory(prefix="gentamp-pddlstream-")  # it writes into the current folder
    with temporary as here, contextlib.chdir(here), contextlib.redirect_stdout(sys.stderr):
        try:
            plan, _, _ = solve(problem, algorithm=algorithm, max_time=time_limit, verbose=False)
        except SystemExit as error:  # its way to report a mistake in PDDL
            raise SolverError(f"PDDLStream exited: {error}") from None
    if plan is None:
        raise NoAnswer("PDDLStream found no plan (it does not tell whether there is none or a limit was reached)")
    return [Step(action.name, tuple(entity.name for entity in action.args)) for action in plan]


def _names(inputs: tuple[Entity, ...]) -> tuple[str, ...]:
    return tuple(entity.name for entity in inputs)


def _test(stream: Stream, instance: Instance) -> Callable[..., bool]:
    atom = stream.certified[0]

    def test(*inputs: Entity) -> bool:
        binding = dict(zip(stream.inputs, _names(inputs), strict=True))
        return instance.base.truth(atom.predicate, tuple(binding.get(a, a) for a in atom.args))

    return test


def _generator(stream: Stream, instance: Instance) -> Callable[..., Iterator[tuple[Entity, ...] | None]]:
    def generate(*inputs: Entity) -> Iterator[tuple[Entity, ...] | None]:
        names = _names(inputs)
        while not instance.base.exhausted(stream, names):
            outputs = instance.base.draw(stream, names)
            yield None if outputs is None else tuple(map(Entity, outputs))

    return generate


def _expression(formula: Formula) -> tuple[Any, ...]:
    """A formula as PDDLStream writes it in Python."""
    match formula:
        case Atom(predicate, args):
            return (predicate, *(a if a.startswith("?") else Entity(a) for a in args))
        case Not(body):
            return ("not", _expression(body))
        case And(parts) | Or(parts):
            return ("and" if isinstance(formula, And) else "or", *map(_expression, parts))
        case Exists(variables, body) | Forall(variables, body):
            return ("exists" if isinstance(formula, Exists) else "forall", list(variables), _expression(body))
