"""The bridge to clingo; no other module imports it.

A `GroundProgram` is a set of `.lp` files plus facts as text. A `LazyTheory` may refute total assignments with
clauses; it sees nothing of clingo, only the numbers for which its unary predicates hold.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import clingo

from gentamp_lp.errors import InputError, SolverError
from gentamp_lp.solvers.interrupts import Held

Atom = tuple[str, int]
Term = int | str | tuple["Term", ...]  # a number, the text of a string or name, or (name, *arguments)
Clause = Iterable[tuple[Atom, bool]]
_STEP = 0.2  # seconds between two looks at the clock


class LazyTheory(Protocol):
    """Conditions too many to ground: clauses are handed out when an assignment violates them."""

    predicates: tuple[str, ...]

    def refute(self, true: dict[str, list[int]]) -> Iterable[tuple[str, Clause]]:
        """Return (kind, clause) pairs that the assignment violates; none if it is right."""
        ...


@dataclass(frozen=True)
class Answer:
    """One answer set: its shown unary atoms and the value of each optimisation level."""

    atoms: dict[str, tuple[int, ...]]
    cost: tuple[int, ...]
    optimal: bool


@dataclass
class Outcome:
    """What a search found: `complete` if nothing is left to find, `bound` as far as optimality is proved."""

    answers: list[Answer] = field(default_factory=list)
    complete: bool = False
    interrupted: bool = False
    by_user: bool = False  # interrupted by Ctrl-C
    bound: tuple[int, ...] = ()
    core: tuple[Atom, ...] = ()


class GroundProgram:
    """A grounded program that can be solved more than once."""

    def __init__(
        self, files: Sequence[Path], facts: str, *, options: Sequence[str] = (), theory: LazyTheory | None = None
    ) -> None:
        self.messages: list[str] = []
        self._control = clingo.Control(["--warn=all", *options], logger=self._log, message_limit=50)
        self._lazy = None if theory is None else _Lazy(theory)
        for file in files:
            if not file.is_file():
                raise InputError(f"no such ASP file: {file}")
        _ground(self._control, files, facts, self.messages)
        if self._lazy is not None:
            self._control.register_propagator(self._lazy)

    def solve(
        self,
        *,
        limit: float | None = None,
        assume: Iterable[Atom] = (),
        optimize: bool | None = None,
        on_answer: Callable[[Answer], bool | None] | None = None,
        on_bound: Callable[[tuple[int, ...]], None] | None = None,
    ) -> Outcome:
        """Search until done, `on_answer` returns False, the limit (seconds) ends, or Ctrl-C; keep what was found.

        `optimize` says whether to obey `#minimize` in this search (None: as the options of the program say).
        """
        outcome = Outcome()
        if optimize is not None:
            solving: Any = self._control.configuration.solve
            solving.opt_mode = "opt" if optimize else "ignore"
        literals = {self._literal(atom): atom for atom in assume}
        errors: list[BaseException] = []

        def model(found: clingo.Model) -> bool | None:
            try:
                outcome.answers.append(_answer(found))
                return None if on_answer is None else on_answer(outcome.answers[-1])
            except BaseException as error:
                errors.append(error)
                return False

        def unsatisfiable(bound: Sequence[int]) -> None:
            outcome.bound = tuple(bound)
            try:
                if on_bound is not None:
                    on_bound(outcome.bound)
            except BaseException as error:
                errors.append(error)

        deadline = None if limit is None else time.monotonic() + limit
        try:
            with (
                Held() as ctrl_c,  # raised before there is a handle, it leaves a thread behind that ends the process
                self._control.solve(list(literals), on_model=model, on_unsat=unsatisfiable, async_=True) as handle,
            ):
                self._wait(handle, deadline, ctrl_c, outcome)
                result = handle.get()
                if result.unsatisfiable and literals:
                    outcome.core = tuple(literals[literal] for literal in handle.core() if literal in literals)
        except RuntimeError as error:
            raise SolverError("\n".join([str(error), *self.messages])) from error
        if self._lazy is not None and self._lazy.error is not None:
            errors.append(self._lazy.error)
        if errors:
            raise errors[0]
        outcome.complete = bool(result.exhausted or result.unsatisfiable)
        return outcome

    def statistics(self) -> dict[str, int]:
        """Return how often the last search chose and failed, and how many clauses of each kind were added."""
        counts = {} if self._lazy is None else {f"clauses_{k}": n for k, n in sorted(self._lazy.counts.items())}
        solvers = self._control.statistics["solving"]["solvers"]
        return {"choices": int(solvers["choices"]), "conflicts": int(solvers["conflicts"]), **counts}

    def _wait(self, handle: clingo.SolveHandle, deadline: float | None, ctrl_c: Held, outcome: Outcome) -> None:
        """Wait for the search to end; cancel it at the deadline, or at Ctrl-C, which keeps what was found."""
        while not handle.wait(_STEP if deadline is None else min(_STEP, max(deadline - time.monotonic(), 0))):
            outcome.by_user = ctrl_c.pending
            outcome.interrupted = outcome.by_user or (deadline is not None and time.monotonic() >= deadline)
            if outcome.interrupted:
                handle.cancel()
                break
        if outcome.by_user and outcome.answers:
            ctrl_c.pending = False

    def _literal(self, atom: Atom) -> int:
        name, number = atom
        found = self._control.symbolic_atoms[clingo.Function(name, [clingo.Number(number)])]
        if found is None:
            raise SolverError(f"no atom {name}({number}) to assume")
        return found.literal

    def _log(self, code: clingo.MessageCode, message: str) -> None:
        self.messages.append(message.strip())


def _answer(model: clingo.Model) -> Answer:
    atoms: dict[str, list[int]] = {}
    for symbol in model.symbols(shown=True):
        atoms.setdefault(symbol.name, []).append(symbol.arguments[0].number)
    return Answer(
        {name: tuple(sorted(numbers)) for name, numbers in atoms.items()},
        tuple(model.cost),
        model.optimality_proven,
    )


def consequences(files: Sequence[Path], facts: str, wanted: Mapping[str, int]) -> dict[str, list[tuple[int, ...]]]:
    """Return the atoms over numbers that follow from a program without choices, for predicates `wanted` by arity.

    Grounding alone computes them, so negation is allowed in stratified programs only.
    """
    control = _grounded(files, facts)
    return {
        name: sorted(
            tuple(argument.number for argument in atom.symbol.arguments)
            for atom in control.symbolic_atoms.by_signature(name, arity)
        )
        for name, arity in wanted.items()
    }


def deduce(files: Sequence[Path], facts: str) -> dict[str, list[tuple[Term, ...]]]:
    """Return what a program without choices shows: for each predicate the arguments of its atoms, in clingo's order."""
    shown: list[clingo.Symbol] = []
    control = _grounded(files, facts)
    with Held():
        control.solve(on_model=lambda model: shown.extend(model.symbols(shown=True)))
    found: dict[str, list[tuple[Term, ...]]] = {}
    for symbol in sorted(shown):
        found.setdefault(symbol.name, []).append(tuple(map(_term, symbol.arguments)))
    return found


def _term(symbol: clingo.Symbol) -> Term:
    if symbol.type == clingo.SymbolType.Number:
        return symbol.number
    if symbol.type == clingo.SymbolType.String:
        return symbol.string
    return (symbol.name, *map(_term, symbol.arguments)) if symbol.arguments else symbol.name


def _grounded(files: Sequence[Path], facts: str) -> clingo.Control:
    """Ground a program; whatever clingo has to say of it is an error."""
    messages: list[str] = []
    control = clingo.Control(["--warn=all"], logger=lambda code, message: messages.append(message.strip()))
    _ground(control, files, facts, messages)
    if messages:
        raise SolverError("\n".join(messages))
    return control


def _ground(control: clingo.Control, files: Iterable[Path], facts: str, messages: list[str]) -> None:
    """Load and ground a program; what clingo says of it is among the messages."""
    try:
        with Held():
            for file in files:
                control.load(str(file))
            control.add("base", [], facts)
            control.ground([("base", [])])
    except RuntimeError as error:
        raise SolverError("\n".join([str(error), *messages])) from error


class _Lazy(clingo.Propagator):
    """Ask the theory about each total assignment, and add its clauses one by one.

    clingo accepts no further clause after one that contradicts the assignment, so the rest waits for the next
    check; and it calls `check` with assignments that are not total, after clauses were added.
    """

    def __init__(self, theory: LazyTheory) -> None:
        self.theory = theory
        self.counts: dict[str, int] = {}
        self.error: BaseException | None = None
        self._literals: dict[Atom, int] = {}
        self._waiting: deque[list[int]] = deque()

    def init(self, init: clingo.PropagateInit) -> None:
        init.check_mode = clingo.PropagatorCheckMode.Total
        self._waiting.clear()
        for name in self.theory.predicates:
            for atom in init.symbolic_atoms.by_signature(name, 1):
                self._literals[name, atom.symbol.arguments[0].number] = init.solver_literal(atom.literal)

    def check(self, control: clingo.PropagateControl) -> None:
        """Never raise: clingo would end the process. Keep the error and leave the search with an empty clause."""
        try:
            if self.error is None:
                self._check(control)
        except BaseException as error:
            self.error = error
        if self.error is not None:
            control.add_clause([], lock=True)

    def _check(self, control: clingo.PropagateControl) -> None:
        if not self._add_waiting(control) or not control.assignment.is_total:
            return
        is_true = control.assignment.is_true
        true: dict[str, list[int]] = {name: [] for name in self.theory.predicates}
        for (name, number), literal in self._literals.items():
            if is_true(literal):
                true[name].append(number)
        for kind, clause in self.theory.refute(true):
            self.counts[kind] = self.counts.get(kind, 0) + 1
            literals = self._translate(clause)
            if any(is_true(literal) for literal in literals):
                raise AssertionError(f"{kind} clause that the assignment does not violate")
            self._waiting.append(literals)
        self._add_waiting(control)

    def _translate(self, clause: Clause) -> list[int]:
        """Return solver literals; an atom the program does not have is false."""
        return [
            self._literals[atom] if wanted else -self._literals[atom]
            for atom, wanted in clause
            if not wanted or atom in self._literals
        ]

    def _add_waiting(self, control: clingo.PropagateControl) -> bool:
        while self._waiting:
            if not control.add_clause(self._waiting.popleft(), lock=True) or not control.propagate():
                return False
        return True
