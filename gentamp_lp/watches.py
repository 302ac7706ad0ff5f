"""The extensions of formulas, kept up to date while a state changes.

A changed fact can only matter to those tuples for which it stands beside the rest of the formula: an occurrence of the
fact's predicate is matched with it, what stands beside the occurrence and does not change (its guards) is joined, and
the formula is evaluated again for the tuples that remain. New samples are changes like any other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from gentamp_lp.streams.facts import Args, Fact, bind, match, sort_predicate
from gentamp_lp.streams.formula import And, Atom, Exists, Formula, Not, Or, atoms, conjuncts, free_variables
from gentamp_lp.streams.pddl import Axiom
from gentamp_lp.streams.queries import Query, Situation, unfold
from gentamp_lp.streams.semantics import reads

Toggles = dict[str, list[Args]]
"""For each formula, the tuples that enter or leave its extension."""


@dataclass
class _Watch:
    """One formula: queries for its extension and for one tuple, and the extension as it was last."""

    everything: Query
    member: Query
    members: dict[Args, None] = field(default_factory=dict)
    recursive: frozenset[str] = frozenset()  # basic predicates of recursive axioms: after a change all is asked anew


class Watches:
    """The extensions of axioms, by the name of the head, in a situation."""

    def __init__(self, situation: Situation, axioms: Iterable[Axiom]) -> None:
        self.situation = situation
        self._base, program = situation.base, situation.program
        self._watches: dict[str, _Watch] = {}
        self._near: dict[
            str, list[tuple[str, Atom, Query]]
        ] = {}  # predicate -> formula, where in it, what is concerned
        self._samplers: list[Query] = []
        for axiom in axioms:
            variables, body = axiom.head.args, unfold(axiom.body, program)
            watch = _Watch(situation.query(body, (), variables), situation.query(body, variables))
            recursive = {a for a in atoms(body) if a.predicate in program.recursive}
            watch.recursive = frozenset().union(*(reads(a, program) for a in recursive))
            for atom, beside, tested in self._occurrences(body, ()):
                names = tuple(dict.fromkeys(a for a in atom.args if a.startswith("?")))
                in_state = atom.predicate in program.domain.fluents
                guards = tuple(part for part in beside if self._lasts(part, in_state))
                query = situation.query(And(guards), names, variables)
                self._near.setdefault(atom.predicate, []).append((axiom.head.predicate, atom, query))
                if atom.predicate in self._base.makers and not tested:
                    always = (part for part in beside if self._lasts(part, True) and not self._tests(part))
                    own = tuple(part for part in always if free_variables(part) <= set(names))
                    self._samplers.append(situation.query(And((*own, atom)), (), names, lazy=True))
            self._watches[axiom.head.predicate] = watch
        self._entities = 0
        self._sizes = dict.fromkeys(sorted(self._near.keys() - program.domain.fluents), 0)
        self._recall()

    def sample(self) -> None:
        """Call the streams whose entities the formulas speak of, up to the situation's limits."""
        for query in self._samplers:
            for _ in query.solutions():
                pass
        self._recall()

    def counts(self) -> dict[str, int]:
        """How many tuples satisfy each formula at present."""
        self._sync()
        return {name: len(watch.members) for name, watch in self._watches.items()}

    def peek(self, added: list[Fact], deleted: list[Fact]) -> tuple[dict[str, int], Toggles]:
        """What `counts` would be after a change of the state, and the tuples that make the difference."""
        self._sync()
        self.situation.change(added, deleted)
        toggles = self._affected((*added, *deleted))
        self.situation.change(deleted, added)
        after = {}
        for name, watch in self._watches.items():
            changes = toggles.get(name, ())
            left = sum(row in watch.members for row in changes)
            after[name] = len(watch.members) + len(changes) - 2 * left
        return after, toggles

    def change(self, added: list[Fact], deleted: list[Fact], toggles: Toggles | None = None) -> None:
        """Follow the situation, which has just been changed; `toggles` are what `peek` said of this change."""
        self._toggle(self._affected((*added, *deleted)) if toggles is None else toggles)

    def _recall(self) -> None:
        for watch in self._watches.values():
            watch.members = dict.fromkeys(watch.everything.solutions())
        for name in self._sizes:
            self._sizes[name] = len(self._base.relation(name))
        self._entities = len(self._base.values)

    def _sync(self) -> None:
        """Take in the facts that streams have certified since the last look."""
        entities, self._entities = self._entities, len(self._base.values)
        if entities == self._entities:
            return
        new: list[Fact] = []
        for name, size in self._sizes.items():
            rows = self._base.relation(name).rows
            if len(rows) > size:
                new += [(name, *row) for row in list(rows)[size:]]
                self._sizes[name] = len(rows)
        self._toggle(self._affected(new, more=True))

    def _toggle(self, toggles: Toggles) -> None:
        for name, rows in toggles.items():
            members = self._watches[name].members
            for row in rows:
                if row in members:
                    del members[row]
                else:
                    members[row] = None

    def _affected(self, facts: Sequence[Fact], more: bool = False) -> Toggles:
        """The tuples whose membership is no longer right, after a change of these facts; `more` entities are known."""
        candidates: dict[str, dict[Args, None]] = {}
        for fact in facts:
            for name, atom, query in self._near.get(fact[0], ()):
                binding = match(atom.args, fact[1:], {})
                if binding is not None:
                    concerned = query.solutions([v for k, v in binding.items() if k.startswith("?")])
                    candidates.setdefault(name, {}).update(dict.fromkeys(concerned))
        for name, watch in self._watches.items():
            if (more and watch.everything.unguarded) or any(fact[0] in watch.recursive for fact in facts):
                candidates[name] = watch.members | dict.fromkeys(watch.everything.solutions())
        return {
            name: [row for row in rows if self._watches[name].member.holds(row) != (row in self._watches[name].members)]
            for name, rows in candidates.items()
        }

    def _occurrences(
        self, formula: Formula, beside: tuple[Formula, ...], tested: bool = False
    ) -> Iterator[tuple[Atom, tuple[Formula, ...], bool]]:
        """The places where facts stand that may change, each with the conditions under which it matters.

        The last value says whether the fact matters as condition of a test only.
        """
        match formula:
            case Atom(predicate, args):
                if predicate in self.situation.program.domain.fluents or self._grows(predicate):
                    yield formula, beside, tested
                elif predicate in self._base.tests:
                    stream = self._base.tests[predicate]
                    pattern = next(a.args for a in stream.certified if a.predicate == predicate)
                    names = dict(zip(pattern, args, strict=True))
                    for condition in stream.domain:
                        yield from self._occurrences(Atom(condition.predicate, bind(condition, names)), beside, True)
            case Not(body) | Exists(_, body):
                yield from self._occurrences(body, beside, tested)
            case Or(parts):
                for part in parts:
                    yield from self._occurrences(part, beside, tested)
            case And():
                parts = conjuncts(formula)
                for part in parts:
                    others = tuple(other for other in parts if other is not part)
                    yield from self._occurrences(part, beside + others, tested)

    def _grows(self, predicate: str) -> bool:
        """Whether streams, new entities included, may add to a predicate."""
        return predicate in self._base.makers or predicate.startswith(sort_predicate(""))

    def _tests(self, formula: Formula) -> bool:
        return any(atom.predicate in self._base.tests for atom in atoms(formula))

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
