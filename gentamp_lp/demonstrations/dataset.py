"""What learning sees: states and transitions of the training problems, as values and as facts.

A dataset is plain data (names only, no geometry), so that it can be cached on disk and printed as facts that
Prolog and clingo both read.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

import networkx as nx

from gentamp_lp.base.terms import quote_atom, quote_string
from gentamp_lp.streams.facts import Fact

_PLAIN = re.compile(r"[a-z]\w*")


@dataclass
class TrainingProblem:
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

    def __str__(self) -> str:
        """The step, as explanations write it."""
        return f"{self.action}({', '.join(self.args)})"


@dataclass
class Dataset:
    """Everything learned from. State and transition numbers are positions in their lists."""

    predicates: dict[str, list[str]]  # predicate -> sorts of its arguments
    display: dict[str, str]  # predicate -> spelling
    owners: list[tuple[str, str, int]]  # (predicate, sort, argument) that determines the tuple
    at_most_one: list[str]
    problems: list[TrainingProblem] = field(default_factory=list)
    states: list[SeenState] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)

    @property
    def sorts(self) -> dict[str, tuple[str, ...]]:
        """The sorts of each predicate's arguments."""
        return {name: tuple(row) for name, row in self.predicates.items()}

    def pool_facts(self) -> str:
        """The facts from which Prolog builds the feature pool."""
        lines = [f"sort({sort})." for sort in sorted({s for sorts in self.predicates.values() for s in sorts})]
        for name, sorts in self.predicates.items():
            lines.append(f"predicate({_name(name)}, [{', '.join(sorts)}]).")
            lines.append(f"display({_name(name)}, {quote_string(self.display[name])}).")
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
            lines.append(f"transition({number},{t.source},{t.target}). action({number},{quote_string(t.action)}).")
            if t.demonstrated:
                lines.append(f"candidate({number}).")
        return "\n".join(lines) + "\n"

    def describe(self, number: int, predicates: Collection[str]) -> str:
        """What `predicates` say of a state, for explanations."""
        return f"{self.name(number)}: {self._shown(f for f in self.states[number].facts if f[0] in predicates)}"

    def where(self, number: int) -> str:
        """How many steps from the start of its problem a state is, and whether the demonstration passes there."""
        problem = self.states[number].problem
        starts = [n for n, s in enumerate(self.states) if s.initial and s.problem == problem]
        for steps, road in (
            ([t for t in self.transitions if t.demonstrated], "of the demonstration"),
            (self.transitions, "from the start, off the demonstration"),
        ):
            graph = nx.DiGraph([(t.source, t.target) for t in steps])
            graph.add_nodes_from([*starts, number])
            away = [nx.shortest_path_length(graph, s, number) for s in starts if nx.has_path(graph, s, number)]
            if away:
                return f"after {min(away)} step{'s' * (min(away) > 1)} {road}" if min(away) else "the start"
        return "not reached from the start"

    def name(self, number: int) -> str:
        """How explanations call a state."""
        state = self.states[number]
        problem = self.problems[state.problem]
        kind = "goal state" if state.goal else "state"
        return f"{kind} {number} (size {problem.size}, seed {problem.seed})"

    def contrast(self, first: int, second: int, predicates: Collection[str]) -> tuple[str, set[str]]:
        """What `predicates` say of one of two states only, and which of them differ.

        In two problems the same name means different things: there only the numbers of facts are compared.
        """
        one, two = ([f for f in self.states[n].facts if f[0] in predicates] for n in (first, second))
        if self.states[first].problem == self.states[second].problem:
            only, other = [f for f in one if f not in two], [f for f in two if f not in one]
            said = [
                f"only in state {n}: {self._shown(facts)}" for n, facts in ((first, only), (second, other)) if facts
            ]
            return "; ".join(said), {self.display[name] for name, *_ in only + other}
        counts = [Counter(self.display[name] for name, *_ in facts) for facts in (one, two)]
        differ = sorted(name for name in counts[0] | counts[1] if counts[0][name] != counts[1][name])
        said = [f"{counts[0][name]} facts {name} in state {first}, {counts[1][name]} in {second}" for name in differ]
        return "; ".join(said), set(differ)

    def _shown(self, facts: Iterable[Fact]) -> str:
        return ", ".join(
            f"{self.display[name]}({', '.join(args)})" if args else self.display[name] for name, *args in facts
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
        data["problems"] = [TrainingProblem(**{**p, "static": facts(p["static"])}) for p in data["problems"]]
        data["states"] = [SeenState(**{**s, "facts": facts(s["facts"])}) for s in data["states"]]
        data["transitions"] = [Transition(**{**t, "args": tuple(t["args"])}) for t in data["transitions"]]
        return cls(**data)


def _term(fact: Fact) -> str:
    name, *args = map(_name, fact)
    return f"{name}({','.join(args)})" if args else name


def _name(name: str) -> str:
    """A name as a Prolog atom: PDDL allows hyphens and the like."""
    return name if _PLAIN.fullmatch(name) else quote_atom(name)
