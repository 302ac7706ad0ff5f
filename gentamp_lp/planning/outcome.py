"""Where a step leads: whether it does what the policy's abstract action does to the features, and ends where the policy
goes on or at a goal.

The features, and what keeps the goal from holding, are watched in one state that is changed in place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from gentamp_lp.features.axioms import Features
from gentamp_lp.features.values import effect_of, valuation
from gentamp_lp.planning.feature_changes import Prospect, Watches
from gentamp_lp.policy.model import AbstractAction
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import Atom, Exists, Formula, Not, conjuncts, normalize
from gentamp_lp.streams.pddl import Axiom
from gentamp_lp.streams.queries import Situation
from gentamp_lp.streams.semantics import State


@dataclass
class Outlook:
    """What a step will do to the features and to what keeps the goal from holding, and the abstract state it leads to
    (empty for a goal).
    """

    values: Prospect = field(default_factory=Prospect)
    unmet: Prospect = field(default_factory=Prospect)
    abstract: tuple[bool, ...] = ()


@dataclass(frozen=True)
class Refused:
    """Why a step is none of the policy's: what it does to a `feature`, or (None) where it leads."""

    feature: str | None = None


class Outcomes:
    """The present situation as a policy sees it, and what a step would make of it."""

    def __init__(self, policy: Policy, features: Features, situation: Situation, goal: Formula) -> None:
        self.kinds = {f.name: f.kind for f in policy.features}
        self.values = Watches(situation, [a for a in features.axioms if a.head.predicate in self.kinds])
        self.unmet = Watches(situation, _unmet(goal))
        self._policy, self._situation = policy, situation
        self._strays: dict[State, dict[str, int]] = {}  # state -> values of a refused successor without a rule

    def change(self, added: list[Fact], deleted: list[Fact], outlook: Outlook | None = None) -> None:
        """Go to the state after a step (whose outlook may be known), or back to the one before it."""
        self._situation.change(added, deleted)
        values, unmet = (outlook.values, outlook.unmet) if outlook else (None, None)
        self.values.change(added, deleted, values)
        self.unmet.change(added, deleted, unmet)

    def of(self, state: State, added: list[Fact], deleted: list[Fact], action: AbstractAction) -> Outlook | Refused:
        """Where a step from the present `state` leads, if it has the abstract effect and ends at a goal or where the
        policy has a rule.
        """
        outlook = Outlook()
        looks: dict[str, Callable[[], bool]] = {}
        for name, change in self.values.peek(added, deleted, outlook.values):
            kind = self.kinds[name]
            after = kind == "boolean" and change.after()  # of the others, the sign is enough
            if action.effects.get(name) != effect_of(kind, change.before, after, change.sign):
                return Refused(name)
            looks[name] = change.after
        if not self.unmet.any_after(added, deleted, outlook.unmet):
            return outlook
        abstract = {name: look() for name, look in looks.items()}
        if self._policy.rule_for(abstract):
            outlook.abstract = tuple(abstract.values())
            return outlook
        if state not in self._strays:
            self.change(added, deleted)
            self._strays[state] = self.values.counts()
            self.change(deleted, added)
        return Refused()

    def reason(self, state: State) -> str:
        """Why the policy leads no further than the present `state`."""
        values = self.values.counts()
        rule = self._policy.rule_for(valuation(values))
        shown = ", ".join(f"{name}={value}" for name, value in values.items())
        if rule is None:
            return f"the policy has no rule for the abstract state {shown}"
        reason = f"no concrete step carries out abstract action {rule.action} in the abstract state {shown}"
        if state in self._strays:
            stray = ", ".join(f"{name}={value}" for name, value in self._strays[state].items())
            reason += f" and stays where the policy has a rule: there is none for {stray}"
        return reason


def _unmet(goal: Formula) -> list[Axiom]:
    """What keeps the goal from holding: for each conjunct, the entities that violate it, or that it does not hold."""
    axioms = []
    for number, part in enumerate(conjuncts(normalize(goal))):
        match part:
            case Not(Exists(variables, body)):
                axioms.append(Axiom(Atom(f"unmet-{number}", variables), body))
            case _:
                axioms.append(Axiom(Atom(f"unmet-{number}", ()), Not(part)))
    return axioms
