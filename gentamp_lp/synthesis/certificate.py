"""The certificate of a synthesised policy, and its check.

A certificate is one JSON document: the problem's text, the policy graph, and, for conditional fairness, the order
of SIEVE's deletions. The check reads the problem again and believes nothing else; it shares no code with the
program, with `solving.py`, or with `gentamp_lp/synthesis/sieve.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from gentamp_lp.base.documents import Document
from gentamp_lp.base.fairness import LEVELS, Fairness
from gentamp_lp.base.reading import read_json
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.synthesis.problem import Problem
from gentamp_lp.synthesis.reading import Source, parse_problem
from gentamp_lp.synthesis.solving import Synthesis

FORMAT = "gentamp-lp policy certificate"


class CertificateRule(Document):
    """What the policy does in a state, and what may come of it."""

    state: str
    action: str
    outcomes: list[str]
    con_A: list[str]
    """fairness constraints of which the action is a premise: counts that it lowers"""
    con_B: list[str]
    """fairness constraints that the action breaks: counts that it raises"""


class Deletion(Document):
    """A step of the proof that the policy ends: among these states the constraint removes its actions."""

    constraint: str
    states: list[str]


class SourceText(Document):
    """A file of the problem."""

    name: str
    text: str


class Certificate(Document):
    """A policy and why it is right, with the text of its problem."""

    format: Literal["gentamp-lp policy certificate"]
    version: Literal[1]
    fairness: Fairness
    initial: list[str]
    rules: list[CertificateRule]
    deletions: list[Deletion]
    """in this order"""
    sources: list[SourceText]


def certificate(found: Synthesis, sources: Sequence[Source]) -> dict[str, Any]:
    """Return the certificate of a policy that was found."""
    problem = found.problem
    name, constraint = problem.states, problem.constraints
    document = Certificate.model_validate(
        {
            "format": FORMAT,
            "version": 1,
            "fairness": found.fairness,
            "initial": [name[state] for state in problem.initial],
            "rules": [
                {
                    "state": name[state],
                    "action": choice.action,
                    "outcomes": [name[after] for after in choice.outcomes],
                    "con_A": [constraint[i] for i in sorted(choice.lowered)],
                    "con_B": [constraint[i] for i in sorted(choice.raised)],
                }
                for state, choice in found.policy.items()
            ],
            "deletions": [
                {"constraint": constraint[cut.variable], "states": [name[state] for state in cut.nodes]}
                for cut in found.cuts
            ],
            "sources": [{"name": source, "text": text} for source, text in sources],
        }
    )
    return document.dump()


def load_certificate(file: Path) -> dict[str, Any] | None:
    """Return the certificate in a file; None if the file is something else."""
    try:
        document = read_json(file)
    except InputError:
        return None
    return document if isinstance(document, dict) and document.get("format") == FORMAT else None


def check(document: dict[str, Any]) -> list[str]:
    """Return what is wrong with a certificate, one sentence for each thing; none if the policy is right."""
    try:
        sources = [(str(source["name"]), str(source["text"])) for source in document["sources"]]
        policy = _Policy(document)
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(Diagnostic(f"not a whole certificate: {error!r}")) from None
    found = policy.differs(parse_problem(sources)) or policy.open() or policy.hopeless()
    return found or (policy.endless() if policy.fairness != "strong-cyclic" else [])


class _Policy:
    """The policy graph of a certificate: everything is names."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.fairness = str(document["fairness"])
        if document.get("version") != 1 or self.fairness not in LEVELS:
            raise KeyError("version or fairness")
        self.initial = [str(state) for state in document["initial"]]
        self.rules = [(str(rule["state"]), str(rule["action"])) for rule in document["rules"]]
        keys = [state for state, _ in self.rules]
        self.outcomes = self._sets(keys, document, "outcomes")
        self.may = self._sets(keys, document, "con_A")
        self.unless = self._sets(keys, document, "con_B")
        self.deletions = [(str(row["constraint"]), set(map(str, row["states"]))) for row in document["deletions"]]
        self.goals: set[str] = set()

    @staticmethod
    def _sets(keys: Sequence[str], document: dict[str, Any], what: str) -> dict[str, set[str]]:
        return {key: set(map(str, rule[what])) for key, rule in zip(keys, document["rules"], strict=True)}

    def differs(self, problem: Problem) -> list[str]:
        """Compare the graph with the problem."""
        name, constraint = problem.states, problem.constraints
        self.goals = {name[state] for state in problem.goals}
        known = {(name[choice.state], choice.action): choice for choice in problem.choices}
        found = []
        if len(self.outcomes) < len(self.rules):
            found.append("two rules for one state")
        if set(self.initial) != {name[state] for state in problem.initial}:
            found.append("the initial states are not those of the problem")
        for state, action in self.rules:
            choice = known.get((state, action))
            if choice is None:
                found.append(f"{action} cannot be taken in {state}")
            elif self.outcomes[state] != {name[after] for after in choice.outcomes}:
                found.append(f"the outcomes of {action} in {state} are not those of the problem")
            elif (self.may[state], self.unless[state]) != (
                {constraint[i] for i in choice.lowered},
                {constraint[i] for i in choice.raised},
            ):
                found.append(f"the fairness of {action} in {state} is not that of the problem")
        return found

    def open(self) -> list[str]:
        """Find states without a rule."""
        answered = self.outcomes.keys() | self.goals
        found = [f"no rule for the initial state {state}" for state in self.initial if state not in answered]
        for state, action in self.rules:
            missing = sorted(self.outcomes[state] - answered)
            found += [f"not closed: {action} in {state} leads to {after}, no rule there" for after in missing]
        return found

    def hopeless(self) -> list[str]:
        """Find states from which no goal can be reached."""
        safe = self._leading_to(self.goals, self.outcomes)
        return [f"no goal can be reached from {state}" for state, _ in self.rules if state not in safe]

    def endless(self) -> list[str]:
        """Replay the deletions on the steps that may happen for ever; then no loop may be left."""
        steps = {state: after & self.outcomes.keys() for state, after in self.outcomes.items()}
        for number, (constraint, inside) in enumerate(self.deletions if self.fairness == "qnp" else (), 1):
            if not inside <= steps.keys():
                return [f"deletion {number}: it names a state without a rule"]
            left = {after for state in inside for after in steps[state]} - inside
            while more := {after for state in left for after in steps[state]} - left:
                left |= more
            if left & inside:
                return [f"deletion {number}: a loop leaves its states and comes back"]
            if any(constraint in self.unless[state] for state in inside):
                return [f"deletion {number}: an action of con_B({constraint}) is taken in its states"]
            for state in inside:
                if constraint in self.may[state] and self.outcomes[state] - inside:
                    steps[state] = set()
        while ends := {state for state, after in steps.items() if not after & steps.keys()}:
            for state in ends:
                del steps[state]
        return [f"a loop is left: the policy is not {self.fairness}"] if steps else []

    @staticmethod
    def _leading_to(targets: Iterable[str], steps: dict[str, set[str]]) -> set[str]:
        before: dict[str, list[str]] = {}
        for state, after in steps.items():
            for target in after:
                before.setdefault(target, []).append(state)
        safe, waiting = set(targets), list(targets)
        while waiting:
            new = [state for state in before.get(waiting.pop(), ()) if state not in safe]
            safe |= set(new)
            waiting += new
        return safe
