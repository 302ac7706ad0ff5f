"""What a policy asks of formulas while a state changes: whether anything satisfies them, and which way counts move.

A changed fact can only matter to those tuples for which it stands beside the rest of the formula: an occurrence of the
fact's predicate is matched with it, what stands beside the occurrence and does not change (its guards) is joined, and
the formula is evaluated again for the tuples that remain. Under an even number of negations a new fact can only let
tuples in, under an odd number only put them out, so only those that are out, or in, are looked at.

Extensions of formulas without tests are kept up to date; new samples are changes like any other. Where tests are read,
only as many tuples are looked at as the answer needs: one that satisfies the formula, one that enters, one that leaves.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import NamedTuple

from gentamp_lp.streams.facts import Fact, sort_predicate
from gentamp_lp.streams.formula import TRUE, And, Atom, Exists, Formula, Not, Or, atoms, conjuncts, substitute
from gentamp_lp.streams.pddl import ActionSchema, Axiom, Effect
from gentamp_lp.streams.queries import Query, Situation, unfold
from gentamp_lp.streams.relations import Args, bind, match
from gentamp_lp.streams.semantics import reads

Toggles = dict[str, list[Args]]
"""For formulas without tests, the tuples that enter or leave the extension."""


@dataclass
class Prospect:
    """What a change of the state will do to the formulas without tests, and, as far as asked, whether anything will
    satisfy the others.
    """

    toggles: Toggles = field(default_factory=dict)
    some: dict[str, bool] = field(default_factory=dict)


class Change(NamedTuple):
    """What a change of the state does to a formula: whether anything satisfies it before, the sign of the change of
    their number, and a function that looks whether anything satisfies it after, to be asked before the change.
    """

    before: bool
    sign: int
    after: Callable[[], bool]


class _Occurrence(NamedTuple):
    """Where changing facts stand in a formula: whether a new one lets tuples in, what else has to hold for it to
    matter, and which tuples it concerns.
    """

    lets_in: bool
    atom: Atom
    guards: Formula
    concerned: Query


@dataclass
class _WatchedFormula:
    """One formula, the queries for its extension and for one tuple, and the occurrences of each changing predicate."""

    variables: Args
    everything: Query
    member: Query
    lazy: bool
    recursive: frozenset[str] = frozenset()  # basic predicates of recursive axioms: after a change all is asked again
    near: dict[str, list[_Occurrence]] = field(default_factory=dict)
    growing: set[str] = field(default_factory=set)  # predicates it reads to which streams may add
    members: dict[Args, None] = field(default_factory=dict)  # unless lazy
    seen: deque[Args] = field(default_factory=lambda: deque(maxlen=3))  # of a lazy one: tuples that satisfied it

    def concerned(self, added: Iterable[Fact], deleted: Iterable[Fact], entering: bool) -> Iterator[Args]:
        """Tuples that may enter (or else leave) by a change, with repetitions."""
        for new, facts in ((True, added), (False, deleted)):
            for fact in facts:
                for lets_in, atom, _, query in self.near.get(fact[0], ()):
                    if (lets_in == new) == entering:
                        binding = match(atom.args, fact[1:], {})
                        if binding is not None:
                            yield from query.solutions([v for k, v in binding.items() if k.startswith("?")])

    def found(self) -> bool:
        """Whether anything satisfies a lazy formula in the present state."""
        if any(self.member.holds(row) for row in self.seen):
            return True
        row = next(self.everything.solutions(), None)
        if row is not None:
            self.seen.appendleft(row)
        return row is not None


def _sign(number: int) -> int:
    return (number > 0) - (number < 0)


class Watches:
    """The extensions of axioms, by the name of the head, in a situation."""

    def __init__(self, situation: Situation, axioms: Iterable[Axiom]) -> None:
        self.situation = situation
        self._base = situation.base
        self._samplers: list[Query] = []
        found = {axiom.head.predicate: self._watch(axiom) for axiom in axioms}
        self._watches = dict(sorted(found.items(), key=lambda item: item[1].lazy))
        self._names = list(found)
        self._sizes = dict.fromkeys(sorted({name for watch in found.values() for name in watch.growing}), 0)
        self._some: dict[str, bool] = {}
        self._recall()

    def _watch(self, axiom: Axiom) -> _WatchedFormula:
        situation, program = self.situation, self.situation.program
        variables, body = axiom.head.args, unfold(axiom.body, program)
        recursive = {a for a in atoms(body) if a.predicate in program.recursive}
        lazy = not recursive and self._tests(body)
        watch = _WatchedFormula(variables, situation.query(body, (), variables), situation.query(body, variables), lazy)
        watch.recursive = frozenset().union(*(reads(a, program) for a in recursive))
        for atom, positive, beside, tested in self._occurrences(body, True, ()):
            names = tuple(dict.fromkeys(a for a in atom.args if a.startswith("?")))
            in_state = atom.predicate in program.domain.fluents
            if not in_state:
                watch.growing.add(atom.predicate)
            if in_state or not lazy:
                guards = tuple(part for part in beside if self._lasts(part, in_state))
                if lazy:  # one that is in has to satisfy the rest, too; what takes tests is left for later
                    rest = (part for part in conjuncts(body) if part not in guards and not self._tests(part))
                    guards = (*guards, *rest)
                query = situation.query(And(guards), names, variables)
                watch.near.setdefault(atom.predicate, []).append(_Occurrence(positive, atom, And(guards), query))
            if not tested and self._samples(atom, beside):
                always = (part for part in beside if self._lasts(part, True) and not self._tests(part))
                own = tuple(part for part in always if part.free <= set(names))
                self._samplers.append(situation.query(And((*own, atom)), (), names, lazy=True))
        return watch

    def sample(self) -> None:
        """Call the streams whose entities the formulas speak of, up to the situation's limits."""
        for query in self._samplers:
            for _ in query.solutions():
                pass
        self._recall()

    def counts(self) -> dict[str, int]:
        """How many tuples satisfy each formula at present."""
        self._sync()
        return {name: self._count(self._watches[name]) for name in self._names}

    def positive(self) -> dict[str, bool]:
        """Whether any tuple satisfies each formula at present."""
        self._sync()
        return {name: self._positive(name) for name in self._names}

    def any(self) -> bool:
        """Whether anything satisfies any of the formulas at present."""
        self._sync()
        return any(map(self._positive, self._watches))

    def peek(self, added: list[Fact], deleted: list[Fact], prospect: Prospect) -> Iterator[tuple[str, Change]]:
        """What a change of the state would do, formula by formula, those without tests first.

        `prospect` gets what `change` may be given if the change is made.
        """
        self._foresee(added, deleted, prospect)
        for name, watch in self._watches.items():
            if watch.lazy:
                before, sign = self._change_of(name, added, deleted, prospect)
            else:
                rows = prospect.toggles.get(name, ())
                before, sign = bool(watch.members), _sign(sum(-1 if row in watch.members else 1 for row in rows))
            yield name, Change(before, sign, partial(self._after, name, added, deleted, prospect))

    def any_after(self, added: list[Fact], deleted: list[Fact], prospect: Prospect) -> bool:
        """Whether anything would satisfy any of the formulas after a change of the state; `prospect` as in `peek`."""
        self._foresee(added, deleted, prospect)
        return any(self._after(name, added, deleted, prospect) for name in self._watches)

    def change(self, added: list[Fact], deleted: list[Fact], prospect: Prospect | None = None) -> None:
        """Follow the situation, which has just been changed; `prospect` is what was foretold of this change."""
        self._some = {} if prospect is None else dict(prospect.some)
        self._toggle(self._affected(added, deleted) if prospect is None else prospect.toggles)

    def moved_by(self, name: str, schema: ActionSchema, entering: bool) -> set[Args] | None:
        """Which tuples, in terms of an action's parameters, it can make enter (or leave) the extension of a formula.

        None where that is not decided by the parameters alone.
        """
        watch = self._watches[name]
        found: set[Args] = set()
        for effect, occurrence in self._moving(watch, schema, entering):
            at = dict(zip(occurrence.atom.args, effect.atom.args, strict=True))
            if effect.variables or not at.keys() >= set(watch.variables):
                return None
            found.add(tuple(at[variable] for variable in watch.variables))
        return None if watch.recursive else found

    def single(self) -> str | None:
        """The formula without tests that one tuple satisfies at present, if nothing else satisfies any of these."""
        self._sync()
        sizes = {name: len(watch.members) for name, watch in self._watches.items() if watch.members}
        return next(iter(sizes)) if sum(sizes.values()) == 1 else None

    def puts_out(self, name: str, schema: ActionSchema) -> Formula:
        """What has to hold of an action's parameters if it makes a tuple leave the extension of a formula."""
        watch = self._watches[name]
        if watch.recursive:
            return TRUE
        cases: list[Formula] = []
        for effect, occurrence in self._moving(watch, schema, False):
            pairs = tuple(zip(occurrence.atom.args, effect.atom.args, strict=True))
            at = {variable: arg for variable, arg in pairs if variable.startswith("?")}
            same = (Atom("=", pair) for pair in pairs)
            others = {variable: f"{variable}#" for variable in sorted(occurrence.guards.free - at.keys())}
            case = substitute(And((*same, occurrence.guards)), {**others, **at})
            cases.append(Exists((*others.values(), *effect.variables), case))
        return Or(tuple(cases))

    def _moving(
        self, watch: _WatchedFormula, schema: ActionSchema, entering: bool
    ) -> Iterator[tuple[Effect, _Occurrence]]:
        """An action's effects that can make tuples enter (or leave) the extension of a formula, and where."""
        for effect in schema.effects:
            for occurrence in watch.near.get(effect.atom.predicate, ()):
                if (occurrence.lets_in == effect.positive) == entering:
                    yield effect, occurrence

    def _count(self, watch: _WatchedFormula) -> int:
        return len(set(watch.everything.solutions())) if watch.lazy else len(watch.members)

    def _positive(self, name: str) -> bool:
        watch = self._watches[name]
        if not watch.lazy:
            return bool(watch.members)
        if name not in self._some:
            self._some[name] = watch.found()
        return self._some[name]

    def _foresee(self, added: list[Fact], deleted: list[Fact], prospect: Prospect) -> None:
        """Find out what a change will do to the formulas without tests."""
        self._sync()
        self.situation.change(added, deleted)
        prospect.toggles = self._affected(added, deleted)
        self.situation.change(deleted, added)

    def _after(self, name: str, added: list[Fact], deleted: list[Fact], prospect: Prospect) -> bool:
        """Whether anything would satisfy a formula after a change that is foreseen."""
        watch = self._watches[name]
        if not watch.lazy:
            moved = prospect.toggles.get(name, ())
            return len(watch.members) > len(moved) or any(row not in watch.members for row in moved)
        if name not in prospect.some:
            self.situation.change(added, deleted)
            prospect.some[name] = watch.found()
            self.situation.change(deleted, added)
        return prospect.some[name]

    def _change_of(self, name: str, added: list[Fact], deleted: list[Fact], prospect: Prospect) -> tuple[bool, int]:
        """Whether anything satisfies a lazy formula, and the sign of what a change would do to the number."""
        watch, before = self._watches[name], self._positive(name)
        losses = self._leaving(watch, added, deleted, False)
        loss = before and next(losses, None) is not None
        self.situation.change(added, deleted)
        gains = self._leaving(watch, deleted, added, not before)  # what enters leaves by the opposite change
        gain = next(gains, None) is not None
        if gain and loss:
            more = sum(1 for _ in gains)
            self.situation.change(deleted, added)
            prospect.some[name] = True
            return before, _sign(more - sum(1 for _ in losses))
        self.situation.change(deleted, added)
        if gain or not loss:
            prospect.some[name] = gain or before
        return before, gain - loss

    def _leaving(self, watch: _WatchedFormula, added: list[Fact], deleted: list[Fact], all_do: bool) -> Iterator[Args]:
        """Tuples that satisfy a lazy formula in the present state and not after a change (`all_do`: nothing does)."""
        known: set[Args] = set()
        for row in chain(tuple(watch.seen), watch.concerned(added, deleted, False)):
            if row not in known:
                known.add(row)
                if not watch.member.holds(row):
                    continue
                self.situation.change(added, deleted)
                stays = not all_do and watch.member.holds(row)
                self.situation.change(deleted, added)
                if not stays:
                    yield row

    def _recall(self) -> None:
        for watch in self._watches.values():
            if not watch.lazy:
                watch.members = dict.fromkeys(watch.everything.solutions())
        for name in self._sizes:
            self._sizes[name] = len(self._base.relation(name))
        self._known = self._stamp()
        self._some.clear()

    def _stamp(self) -> tuple[int, int]:
        """Different whenever there are more entities or facts (but for what tests decide)."""
        return len(self._base.values), self._base.revision

    def _sync(self) -> None:
        """Take in the facts that streams have certified since the last look."""
        before, self._known = self._known, self._stamp()
        if before == self._known:
            return
        new: list[Fact] = []
        for name, size in self._sizes.items():
            rows = self._base.relation(name).rows
            if len(rows) > size:
                new += [(name, *row) for row in list(rows)[size:]]
                self._sizes[name] = len(rows)
        grown = {fact[0] for fact in new}
        for name, watch in self._watches.items():
            if watch.lazy and (watch.everything.unguarded or not watch.growing.isdisjoint(grown)):
                self._some.pop(name, None)
        self._toggle(self._affected(new, (), more=True))

    def _toggle(self, toggles: Toggles) -> None:
        for name, rows in toggles.items():
            members = self._watches[name].members
            for row in rows:
                if row in members:
                    del members[row]
                else:
                    members[row] = None

    def _affected(self, added: Sequence[Fact], deleted: Sequence[Fact], more: bool = False) -> Toggles:
        """The tuples whose membership is no longer right, after a change of the facts; `more` entities are known."""
        toggles: Toggles = {}
        for name, watch in self._watches.items():
            if watch.lazy:
                continue
            members = watch.members
            rows = {row: None for row in watch.concerned(added, deleted, False) if row in members}
            rows |= {row: None for row in watch.concerned(added, deleted, True) if row not in members}
            if (more and watch.everything.unguarded) or any(f[0] in watch.recursive for f in (*added, *deleted)):
                rows = members | dict.fromkeys(watch.everything.solutions())
            moved = [row for row in rows if watch.member.holds(row) != (row in members)]
            if moved:
                toggles[name] = moved
        return toggles

    def _occurrences(
        self, formula: Formula, positive: bool, beside: tuple[Formula, ...], tested: bool = False
    ) -> Iterator[tuple[Atom, bool, tuple[Formula, ...], bool]]:
        """The places where facts stand that may change, each with whether it is under an even number of negations,
        the conditions under which it matters, and whether it matters as condition of a test only.
        """
        match formula:
            case Atom(predicate, args):
                if predicate in self.situation.program.domain.fluents or self._grows(predicate):
                    yield formula, positive, beside, tested
                elif predicate in self._base.tests:
                    stream = self._base.tests[predicate]
                    pattern = next(a.args for a in stream.certified if a.predicate == predicate)
                    names = dict(zip(pattern, args, strict=True))
                    for condition in stream.domain:
                        required = Atom(condition.predicate, bind(condition, names))
                        yield from self._occurrences(required, positive, beside, True)
            case Not(body):
                yield from self._occurrences(body, not positive, beside, tested)
            case Exists(_, body):
                yield from self._occurrences(body, positive, beside, tested)
            case Or(parts):
                for part in parts:
                    yield from self._occurrences(part, positive, beside, tested)
            case And():
                parts = conjuncts(formula)
                for part in parts:
                    others = tuple(other for other in parts if other is not part)
                    yield from self._occurrences(part, positive, beside + others, tested)

    def _samples(self, atom: Atom, beside: tuple[Formula, ...]) -> bool:
        """Whether an atom that matters where `beside` holds speaks of what streams may still give.

        What fluents say is said of known entities: an output of a stream that stands in one is none that is to come.
        """
        changing = self.situation.program.domain.fluents
        known = {v for part in beside if isinstance(part, Atom) and part.predicate in changing for v in part.args}
        return any(
            known.isdisjoint(arg for arg, name in zip(atom.args, made.args, strict=True) if name in stream.outputs)
            for stream in self._base.makers.get(atom.predicate, ())
            for made in stream.certified
            if made.predicate == atom.predicate
        )

    def _grows(self, predicate: str) -> bool:
        """Whether streams, new entities included, may add to a predicate."""
        return predicate in self._base.makers or predicate.startswith(sort_predicate(""))

    def _tests(self, formula: Formula) -> bool:
        return not self._base.tests.keys().isdisjoint(formula.predicates)

    def _lasts(self, formula: Formula, in_state: bool) -> bool:
        """Whether a formula, once true, stays true whatever streams find and, with `in_state`, whatever actions do."""
        program = self.situation.program
        match formula:
            case Atom(predicate):
                return predicate not in program.recursive and not (in_state and predicate in program.domain.fluents)
            case Not(Atom(predicate)):
                return self._lasts(formula.body, True) and not self._grows(predicate)
            case And(parts) | Or(parts):
                return all(self._lasts(part, in_state) for part in parts)
            case Exists(_, body):
                return self._lasts(body, in_state)
        return False
