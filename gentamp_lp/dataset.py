"""What learning sees: states and transitions of the training problems, as values and as facts.

A dataset is plain data (names only, no geometry), so that it can be cached on disk and printed as facts that
Prolog and clingo both read.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from gentamp_lp.prolog import quote
from gentamp_lp.streams.facts import Fact

_PLAIN = re.compile(r"[a-z]\w*")


@dataclass
class Problem:
    """One training problem: its static and certified facts and its entities by sort."""

    size: str
    seed: int
    static: list[Fact]
    entities: dict[str, list[str]]


@dataclass
class SeenState:
    """A state: its problem, its fluent and derived facts, and its marks."""

    problem: int
    facts: list[Fact]
    goal: bool = False
    initial: bool = False


@dataclass
class Transition:
    """A step between two seen states; `demonstrated` ones are what the policy may choose."""

    source: int
    target: int
    action: str
    args: tuple[str, ...]
    demonstrated: bool


@dataclass
class Dataset:
    """Everything learned from. State and transition numbers are positions in their lists."""

    predicates: dict[str, list[str]]  # predicate -> sorts of its arguments
    display: dict[str, str]  # predicate -> spelling
    owners: list[tuple[str, str, int]]  # (predicate, sort, argument) that determines the tuple
    at_most_one: list[str]
    problems: list[Problem] = field(default_factory=list)
    states: list[SeenState] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)

    def pool_facts(self) -> str:
        """The facts from which Prolog builds the feature pool."""
        lines = [f"sort({sort})." for sort in sorted({s for sorts in self.predicates.values() for s in sorts})]
        for name, sorts in self.predicates.items():
            lines.append(f"predicate({_name(name)}, [{', '.join(sorts)}]).")
            lines.append(f'display({_name(name)}, "{self.display[name]}").')
        lines += [f"owner({_name(name)}, {sort}, {position})." for name, sort, position in self.owners]
        lines += [f"at_most_one({_name(name)})." for name in self.at_most_one]
        for number, problem in enumerate(self.problems):
            lines.append(f"problem({number}).")
            for sort, names in problem.entities.items():
                lines += [f"entity({number}, {sort}, {_name(name)})." for name in names]
            lines += [f"static({number}, {_term(fact)})." for fact in problem.static]
        for number, state in enumerate(self.states):
            lines.append(f"state({number}, {state.problem}).")
            lines += [f"fluent({number}, {_term(fact)})." for fact in state.facts]
        lines += [f"transition({n}, {t.source}, {t.target})." for n, t in enumerate(self.transitions)]
        return "\n".join(lines) + "\n"

    def policy_facts(self) -> str:
        """The facts about states and transitions for the ASP program."""
        lines = []
        for number, state in enumerate(self.states):
            lines.append(f"state({number},{state.problem}).")
            if state.goal:
                lines.append(f"goal({number}).")
            if state.initial:
                lines.append(f"initial({number}).")
        for number, t in enumerate(self.transitions):
            lines.append(f'transition({number},{t.source},{t.target}). action({number},"{t.action}").')
            if t.demonstrated:
                lines.append(f"candidate({number}).")
        return "\n".join(lines) + "\n"

    def describe(self, number: int, predicates: Collection[str]) -> str:
        """What `predicates` say of a state, for explanations."""
        return f"{self.name(number)}: {self._shown(self.states[number].facts, predicates)}"

    def told(self, numbers: Collection[int], predicates: Collection[str]) -> list[str]:
        """A sentence a state: where in which problem it is, what is done there, and what `predicates` say unlike in the
        first of the states that is in the same problem.
        """
        steps = {t.source: t for t in self.transitions if t.demonstrated}
        before = {t.target: t.source for t in steps.values()}
        first: dict[int, int] = {}
        return [self._told(n, steps, before, first.setdefault(self.states[n].problem, n), predicates) for n in numbers]

    def _told(
        self, number: int, steps: dict[int, Transition], before: dict[int, int], other: int, names: Collection[str]
    ) -> str:
        start, done = number, 0
        while start in before and not self.states[start].initial:
            start, done = before[start], done + 1
        text = f"{self.name(number)}"
        if self.states[start].initial:
            text += f" is after {done} step(s) of the demonstration" if done else " is the start"
        if number in steps:
            text += f"; {steps[number].action}({', '.join(steps[number].args)}) is done there"
        if other != number:
            only, missing = self._difference(number, other, names)
            text += f"; unlike in state {other}: {only or 'nothing more'}, not {missing or 'anything less'}"
        return text

    def name(self, number: int) -> str:
        """How explanations call a state."""
        state = self.states[number]
        problem = self.problems[state.problem]
        kind = "goal state" if state.goal else "state"
        return f"{kind} {number} (size {problem.size}, seed {problem.seed})"

    def contrast(self, first: int, second: int, predicates: Collection[str]) -> str:
        """What `predicates` say of one of two states only."""
        only, other = self._difference(first, second, predicates)
        return f"  in {self.name(first)}: {only or 'nothing more'}; in {self.name(second)}: {other or 'nothing more'}"

    def _difference(self, first: int, second: int, predicates: Collection[str]) -> tuple[str, str]:
        """What is said of the first of two states only, and of the second only."""
        one, two = self.states[first].facts, self.states[second].facts
        return (
            self._shown([f for f in one if f not in two], predicates),
            self._shown([f for f in two if f not in one], predicates),
        )

    def _shown(self, facts: Iterable[Fact], predicates: Collection[str]) -> str:
        return ", ".join(
            f"{self.display[name]}({', '.join(args)})" if args else self.display[name]
            for name, *args in facts
            if name in predicates
        )

    def to_json(self) -> str:
        """The dataset as JSON text."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Dataset:
        """Read what `to_json` wrote."""
        data: dict[str, Any] = json.loads(text)

        def facts(rows: Iterable[list[str]]) -> list[Fact]:
            return [tuple(row) for row in rows]

        data["owners"] = [tuple(row) for row in data["owners"]]
        data["problems"] = [Problem(**{**p, "static": facts(p["static"])}) for p in data["problems"]]
        data["states"] = [SeenState(**{**s, "facts": facts(s["facts"])}) for s in data["states"]]
        data["transitions"] = [Transition(**{**t, "args": tuple(t["args"])}) for t in data["transitions"]]
        return cls(**data)


def _term(fact: Fact) -> str:
    name, *args = map(_name, fact)
    return f"{name}({','.join(args)})" if args else name


def _name(name: str) -> str:
    """A name as a Prolog atom: PDDL allows hyphens and the like."""
    return name if _PLAIN.fullmatch(name) else quote(name)
