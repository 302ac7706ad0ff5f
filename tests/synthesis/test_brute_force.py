"""Synthesis against exhaustive enumeration, on random QNPs and FOND problems with conditional fairness."""

import json
import random

import pytest
from helpers.problem_brute import random_fond, random_pddl, random_qnp

from gentamp_lp.synthesis import synthesize
from gentamp_lp.synthesis.certificate import certificate, check
from gentamp_lp.synthesis.explaining import explain
from gentamp_lp.synthesis.reading import parse_problem

LEVELS = ("strong", "qnp", "strong-cyclic")


def compare(tiny, levels):
    """Compare some levels (None: the strongest that has a policy); return the smallest policy sizes."""
    sources = [("tiny.pddl" if tiny.text.startswith("(") else "tiny.lp", tiny.text)]
    problem = parse_problem(sources)
    best = tiny.best()
    for level in levels:
        found = synthesize(problem, fairness=level, minimize=True)
        wanted = best.get(level) if level else next((best[name] for name in LEVELS if name in best), None)
        assert found.solvable == (wanted is not None), level
        if found.solvable:
            assert found.optimal and len(found.policy) == found.bound == wanted, level
            assert level is not None or found.fairness == next(name for name in LEVELS if name in best)
            assert check(json.loads(json.dumps(certificate(found, sources)))) == []
        else:
            assert explain(problem, found.fairness).startswith(f"no {found.fairness} policy for the initial state")
    return best


def sweep(make, seeds, states, policies, levels):
    """Return how many problems have policies of which levels."""
    counts = {}
    for seed in seeds:
        rng = random.Random(seed)
        while not (tiny := make(rng)).few(states, policies):
            pass
        try:
            best = compare(tiny, levels or (("qnp",), ("qnp", "strong-cyclic"), ("qnp",), (None, "strong"))[seed % 4])
        except Exception:
            print(f"seed {seed}\n{tiny.text}")
            raise
        counts[tuple(sorted(best))] = counts.get(tuple(sorted(best)), 0) + 1
    return counts


@pytest.mark.parametrize("make", [random_fond, random_qnp])
@pytest.mark.parametrize("block", range(2))
def test_random_problems(make, block):
    counts = sweep(make, range(500 * block, 500 * (block + 1)), 7, 60, None)
    assert len(counts) == 4 and min(counts.values()) >= 3, counts


def test_random_pddl():
    counts = sweep(random_pddl, range(250), 7, 60, None)
    assert len(counts) == 3 and min(counts.values()) >= 3, counts


@pytest.mark.slow
@pytest.mark.parametrize("make", [random_fond, random_qnp, random_pddl])
@pytest.mark.parametrize("block", range(5))
def test_more_random_problems(make, block):
    sweep(make, range(10_000 + 400 * block, 10_000 + 400 * (block + 1)), 9, 300, (*LEVELS, None))
