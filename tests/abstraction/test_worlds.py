"""Load and Unstack from canonical demonstrations, with the features of the paper among distractors."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.worlds import LOAD_SIZES, UNSTACK_SIZES, Load, Unstack, gather

from gentamp_lp.abstraction.choose import synthesize_policy
from gentamp_lp.policy.policy import Policy

SEEDS = (0, 1, 2, 7)
LOAD = [Load(*size) for size in LOAD_SIZES]
UNSTACK = [Unstack(*size) for size in UNSTACK_SIZES]


def learn(worlds, **options):
    data = gather(worlds)
    solution = synthesize_policy(data.facts, **options)
    formulas = {f: f"holds(v0,{f})" for f in data.texts}
    return solution, Policy.from_solution(solution, data.facts, formulas, data.texts, task="test")


@pytest.mark.parametrize(
    "worlds, texts",
    [
        (LOAD, ["holding an object", "holding the tray", "objects on the table", "free tray places"]),
        (UNSTACK, ["holding", "blocks on blocks"]),
    ],
)
def test_the_policy_of_the_paper_whatever_the_seed(worlds, texts):
    answers = [learn(worlds, seed=seed) for seed in SEEDS]
    assert len({solution for solution, _ in answers}) == 1
    solution, policy = answers[0]
    assert [feature.text for feature in policy.features] == texts
    assert solution.optimal and solution.bound == solution.cost
    assert policy.check() == []
    assert policy.fairness == "qnp"


def test_unstack_reads_as_in_the_appendix():
    _, policy = learn(UNSTACK)
    pick, put = policy.actions
    assert (pick.preconditions, pick.effects) == ({"f1": False, "f2": True}, {"f1": "true", "f2": "decrease"})
    assert (put.preconditions, put.effects) == ({"f1": True}, {"f1": "false"})
    assert (pick.schemas, put.schemas) == (("pick",), ("put",))


@pytest.mark.parametrize("world", [Unstack(9, 5, 1), Unstack(2), Unstack(1, 1, 4, 4, 4)])
def test_unstack_scales_by_following_the_policy(world):
    assert follow(world, learn(UNSTACK)[1], Unstack.features)


@pytest.mark.parametrize("size", [(8, 3), (5, 8), (6, 6), (8, 1)])
def test_load_scales_by_following_the_policy(size):
    world = Load(*size)
    assert follow(world, learn(LOAD)[1], world.features)


def follow(world, policy, features, steps=200):
    """Take any move with the effects of the rule's abstract action until the goal holds."""
    features = [next(f for f in features if f.text == mine.text) for mine in policy.features]
    state = world.start
    for _ in range(steps):
        if world.goal(state):
            return True
        rule = policy.rule_for([f.value(state) > 0 for f in features])
        effects = policy.action(rule.action).effects
        state = next(
            after
            for after in world.moves(state).values()
            if all(
                sign(f.value(after) - f.value(state))
                == {"": 0, "increase": 1, "true": 1, "decrease": -1, "false": -1}[effects.get(mine.name, "")]
                for f, mine in zip(features, policy.features, strict=True)
            )
        )
    return False


def sign(number):
    return (number > 0) - (number < 0)


def test_a_pool_that_cannot_see_enough_gives_no_policy_or_a_dearer_one():
    few = [f for f in Unstack.features if f.text != "blocks on blocks" and f.text != "blocks below others"]
    data = gather(UNSTACK, few)
    try:
        solution = synthesize_policy(data.facts)
    except Exception as error:
        assert "state" in str(error)
    else:
        assert solution.cost > 4


def test_bytes_do_not_depend_on_hashing():
    script = (
        "import sys; sys.path[:0] = sys.argv[1], sys.argv[1] + '/..'\n"
        "from test_worlds import LOAD, learn\n"
        "from gentamp_lp.policy.bundle import policy_facts\n"
        "policy = learn(LOAD)[1]; print(policy_facts(policy) + policy.svg() + policy.text())"
    )
    here = str(Path(__file__).parent)
    outputs = {
        subprocess.run(
            [sys.executable, "-c", script, here],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONIOENCODING": "utf-8"},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("0", "1", "77")
    }
    assert len(outputs) == 1
