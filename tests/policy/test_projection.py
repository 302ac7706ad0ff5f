"""`asp/policy.lp` against the definitions, read off the training data in Python."""

import pytest
from helpers.worlds import LOAD_SIZES, UNSTACK_SIZES, Load, Unstack, gather

from gentamp_lp.abstraction.choose import synthesize_policy
from gentamp_lp.abstraction.observations import parse_observations
from gentamp_lp.policy.policy import Policy

WORDS = {"boolean": ("true", "false"), "numeric": ("increase", "decrease")}
NOW = {"increase": (True,), "true": (True,), "false": (False,), "decrease": (True, False)}


@pytest.mark.parametrize(
    "worlds",
    [
        [Unstack(*size) for size in UNSTACK_SIZES],
        [Unstack(2, 3), Unstack(1, 4)],
        [Load(*size) for size in LOAD_SIZES],
        [Load(3, 2), Load(2, 4), Load(5, 1)],
    ],
)
def test_the_program_says_what_the_definitions_say(worlds):
    data = gather(worlds)
    solution, observations = synthesize_policy(data.facts), parse_observations(data.facts)
    policy = Policy.from_solution(solution, data.facts, data.texts, data.texts)
    bits = {f"f{i}": observations.bit(feature) for i, feature in enumerate(solution.features, 1)}
    kinds = {feature.name: feature.kind for feature in policy.features}

    def look(state):
        return tuple(bool(observations.states[state] >> bit & 1) for bit in bits.values())

    def change(move):
        moved = {name: (move.inc >> bit & 1, move.dec >> bit & 1) for name, bit in bits.items()}
        return {name: WORDS[kinds[name]][down] for name, (up, down) in moved.items() if up or down}

    def can_follow(before, effects, after):
        pairs = zip(bits, before, after, strict=True)
        return all(now in NOW.get(effects.get(name, ""), (value,)) for name, value, now in pairs)

    chosen = [observations.transitions[number] for number in solution.chosen]
    seen = {look(state) for state in observations.states}
    assert {rule.valuation for rule in policy.rules} == {look(move.source) for move in chosen}
    assert set(policy.goals) == {look(state) for state in observations.goals}
    assert set(policy.initial) == {look(state) for state in observations.initial}
    for move in chosen:
        rule = policy.rule_for(look(move.source))
        effects = policy.action(rule.action).effects
        assert effects == change(move)
        assert observations.schemas[move.id] in policy.action(rule.action).schemas
        assert set(rule.outcomes) == {after for after in seen if can_follow(rule.valuation, effects, after)}
    for action in policy.actions:
        where = [rule.valuation for rule in policy.rules if rule.action == action.name]
        agreed = dict(zip(bits, zip(*where, strict=True), strict=True))
        assert action.preconditions == {name: v[0] for name, v in agreed.items() if len(set(v)) == 1}
