"""Asking for an improvement with deeper features: against brute force, with and without the listed kernels."""

import random

import pytest
from helpers.brute import Sample

from gentamp_lp.abstraction import facts as encoding
from gentamp_lp.abstraction.choose import NoPolicy, synthesize_policy
from gentamp_lp.abstraction.hitting_sets import kernels
from gentamp_lp.abstraction.observations import parse_observations
from gentamp_lp.abstraction.theory import compress


def within(sample, theory, dear, level):
    """What brute force accepts within the bounds, of the features that are left after equal ones are merged."""
    kept = set(theory.observations.ids(theory.features))
    for cost, _, _, _, features, _ in sample.optima("qnp"):
        if cost < dear and set(features) <= kept and any(sample.cost[f] > level for f in features):
            yield cost, features


@pytest.mark.parametrize("listed", [True, False])
def test_the_cheapest_improvement_is_found_or_refuted(listed, monkeypatch):
    if not listed:
        monkeypatch.setattr(encoding, "_KERNELS", 0)
    found = refuted = 0
    for seed in range(400):
        sample = Sample(random.Random(30_000 + seed))
        theory = compress(parse_observations(sample.facts()), "qnp")
        dear, level = random.Random(seed).randint(3, 12), random.Random(-seed).randint(1, 3)
        wanted = min((cost for cost, _ in within(sample, theory, dear, level)), default=None)
        try:
            answer = synthesize_policy(sample.facts(), improve=(dear, level)).cost
            found += 1
        except NoPolicy:
            answer, refuted = None, refuted + 1
        assert answer == wanted, f"sample {seed}: cheaper than {dear} with a feature above {level}"
    assert found > 40 and refuted > 40


def test_every_abstraction_within_the_bounds_contains_a_kernel():
    compared = 0
    for seed in range(300):
        sample = Sample(random.Random(40_000 + seed))
        theory = compress(parse_observations(sample.facts()), "qnp")
        listed = kernels(theory, 10, 2, 10_000)
        sets = [set(theory.observations.ids(kernel)) for kernel in listed]
        assert all(any(sample.cost[f] > 2 for f in kernel) for kernel in sets)
        assert all(sum(sample.cost[f] for f in kernel) < 10 for kernel in sets)
        for _, features in within(sample, theory, 10, 2):
            compared += 1
            assert any(kernel <= set(features) for kernel in sets), f"sample {seed}: {features}"
    assert compared > 100


def test_too_many_kernels_are_not_listed():
    sample = Sample(random.Random(1))
    theory = compress(parse_observations(sample.facts()), "qnp")
    assert len(kernels(theory, 20, 0, 10_000)) > 1
    assert kernels(theory, 20, 0, 1) is None
