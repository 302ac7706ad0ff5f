"""`learn --program reference`: the complete program gives the answer of the lazy one, or says that it cannot."""

import random
import re
from pathlib import Path

import pytest
from helpers.brute import Sample
from helpers.worlds import LOAD_SIZES, UNSTACK_SIZES, Load, Unstack, gather

from gentamp_lp.abstraction.choose import NoPolicy, synthesize_policy
from gentamp_lp.base.fairness import LEVELS
from gentamp_lp.errors import InputError, LimitReached
from gentamp_lp.learning.learn import learn
from gentamp_lp.policy.bundle import policy_facts
from gentamp_lp.tasks.task import Task

PROGRAMS = ("lazy", "reference")


def answers(facts, **options):
    """The solution by each program; None where there is no policy."""
    found = []
    for program in PROGRAMS:
        try:
            found.append(synthesize_policy(facts, program=program, explain=False, **options))
        except NoPolicy:
            found.append(None)
    return found


@pytest.mark.parametrize("unseen", ["drop", "refuse"])
def test_features_cost_and_moves_are_the_same_on_random_samples(unseen):
    found = better = 0
    for seed in range(150):
        facts, fairness = Sample(random.Random(40_000 + seed)).facts(), LEVELS[seed % 3]
        lazy, reference = answers(facts, fairness=fairness, unseen=unseen)
        assert lazy == reference, f"sample {seed}, {fairness}"
        if lazy is not None:
            found += 1
            # what costs more than the optimum is asked for as after a shallower pool
            lazy, reference = answers(facts, fairness=fairness, unseen=unseen, improve=(lazy.cost + seed % 2, 1))
            assert lazy == reference, f"sample {seed}, {fairness}, improved"
            better += lazy is not None
    assert found > 20 and better > 5


@pytest.mark.parametrize("unseen", ["drop", "refuse"])
@pytest.mark.parametrize(
    "worlds",
    [[Unstack(*size) for size in UNSTACK_SIZES], [Load(*size) for size in LOAD_SIZES]],
    ids=["unstack", "load"],
)
def test_the_worlds_of_the_paper(worlds, unseen):
    lazy, reference = answers(gather(worlds).facts, unseen=unseen)
    assert lazy == reference
    assert lazy.optimal


def test_numbers_of_features_may_be_large():
    """Sums of powers of such numbers would not fit an integer of clingo."""
    facts = gather([Unstack(2, 3)]).facts
    moved = re.sub(r"\b(feature|size|pos|inc|dec)\((\d+)", lambda m: f"{m[1]}({int(m[2]) + 1000}", facts)
    small, large = answers(facts, unseen="refuse")[0], answers(moved, unseen="refuse")
    assert large[0] == large[1]
    assert [feature - 1000 for feature in large[1].features] == list(small.features)


def test_unstack_is_learned_by_the_reference_program():
    """From its own demonstrations and pool, to the byte."""
    bundle = Path(__file__).parents[1] / "policies" / "unstack"
    learned = learn(Task.load("unstack"), program="reference")
    assert policy_facts(learned.policy) == (bundle / "policy.lp").read_text()
    assert learned.solution.optimal


def test_too_many_data_are_refused_with_a_way_out():
    others = ";".join(map(str, range(3, 2001)))
    facts = "".join(f"state({state},1). " for state in range(1, 2001))
    facts += f"goal(2). feature(1,1,numeric). pos(1,(1;{others})). transition(1,1,2). candidate(1). dec(1,1)."
    assert synthesize_policy(facts).features == (1,)
    with pytest.raises(LimitReached, match=r"1 features, 2000 states.*lower --max-complexity"):
        synthesize_policy(facts, program="reference")


def test_an_unknown_program_is_named():
    with pytest.raises(InputError, match="unknown program 'fast': one of lazy, reference"):
        synthesize_policy("", program="fast")
