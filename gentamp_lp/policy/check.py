"""What is wrong with a policy: `asp/certificate.lp` decides from the facts of its policy.lp, this module words it."""

from __future__ import annotations

from gentamp_lp.base.shipped import resource
from gentamp_lp.policy.bundle import named_states, policy_facts
from gentamp_lp.policy.model import PolicyGraph
from gentamp_lp.solvers.asp import Term, deduce

# A sentence for each wrong(Reason), most telling first; of its arguments, {s[0]} is a state and {t[0]} something else.
SENTENCES = {
    "no_level": "unknown level of fairness: {fairness}",
    "many_features": "{t[0]} features are too many to check",
    "no_feature": "no feature {t[0]}",
    "no_word": "{t[1]} cannot be said of {t[0]}",
    "no_value": "no value of {t[1]} in {s[0]}",
    "two_values": "two values of {t[1]} in {s[0]}",
    "no_action": "unknown action {t[1]} in {s[0]}",
    "outcome_without_rule": "outcomes without a rule: {s[0]}",
    "two_rules": "two rules for one abstract state: {s[0]}",
    "rule_in_goal": "rule in a goal state: {s[0]}",
    "precondition": "{t[1]} is chosen in {s[0]} against its precondition on {t[2]}",
    "no_precondition": "{t[0]} has no precondition on {t[1]}, which has one value wherever it is chosen",
    "effect": "{t[1]} cannot make {t[2]} {t[3]} in {s[0]}",
    "no_outcome": "no outcome of {t[1]} in {s[0]}",
    "outcome": "{t[1]} in {s[0]} cannot lead to {s[2]}",
    "not_closed": "not closed: {t[1]} in {s[0]} leads to {s[2]}, no rule there",
    "no_rule": "no rule for the initial state {s[0]}",
    "no_goal": "no goal can be reached from {s[0]}",
    "component": "certificate step {t[0]}: its states are not a whole component",
    "rises": "certificate step {t[0]}: {t[1]} rises in its component",
    "loop": "a loop is left at {s[0]}: the policy is not {fairness}",
}


def problems(policy: PolicyGraph) -> list[str]:
    """Check closedness, goal reachability and the certificate; SIEVE's own search is not trusted."""
    states = named_states(policy)
    position: dict[Term, int] = {name: i for i, (name, _, _) in enumerate(states)}
    shown: dict[Term, str] = {name: policy.show(valuation) for name, valuation, _ in states}
    kinds: list[Term] = list(SENTENCES)

    def sentence(kind: Term, *terms: Term) -> str:
        here = [shown.get(term, term) for term in terms]
        return SENTENCES[str(kind)].format(s=here, t=terms, fairness=policy.fairness)

    def rank(reason: tuple[Term, ...]) -> tuple[int, list[int]]:
        return kinds.index(reason[0]), [position.get(term, 0) for term in reason[1:]]

    wrong = deduce([resource("asp", "certificate.lp")], policy_facts(policy)).get("wrong", [])
    reasons = [reason if isinstance(reason, tuple) else (reason,) for (reason,) in wrong]
    return [sentence(*reason) for reason in sorted(reasons, key=rank)]
