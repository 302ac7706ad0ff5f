"""SIEVE on the loops that are easy to get wrong."""

import random

from helpers.brute import closed_walks

from gentamp_lp.synthesis.sieve import Edge, sieve

X, Y, Z = 1, 2, 3


def edge(source, target, lowered=(), raised=()):
    return Edge(source, target, frozenset(lowered), frozenset(raised))


def test_no_loop_ends():
    assert sieve([edge("a", "b"), edge("b", "c")]).terminates


def test_a_self_loop_that_lowers_ends():
    verdict = sieve([edge("a", "a", lowered=[X])])
    assert verdict.terminates
    assert [(cut.variable, cut.nodes) for cut in verdict.cuts] == [(X, ("a",))]


def test_a_self_loop_that_raises_or_does_nothing_does_not_end():
    assert not sieve([edge("a", "a", raised=[X])]).terminates
    assert not sieve([edge("a", "a")]).terminates


def test_lowering_and_raising_in_one_loop_does_not_end():
    """The smallest strong cyclic policy that never ends."""
    assert not sieve([edge("a", "b", lowered=[X]), edge("b", "a", raised=[X])]).terminates


def test_raising_outside_the_component_is_harmless():
    assert sieve([edge("s", "a", raised=[X]), edge("a", "a", lowered=[X])]).terminates


def test_nested_loops_need_a_second_look():
    """Inner loop lowers Y; the outer one lowers X and raises Y: X first, Y only after the components changed."""
    edges = [
        edge("a", "b", lowered=[X], raised=[Y]),
        edge("b", "b", lowered=[Y]),
        edge("b", "a", lowered=[Y]),
    ]
    verdict = sieve(edges)
    assert verdict.terminates
    assert [cut.variable for cut in verdict.cuts] == [X, Y]


def test_three_levels():
    edges = [
        edge("a", "b", lowered=[X], raised=[Y]),
        edge("b", "c", lowered=[Y], raised=[Z]),
        edge("c", "c", lowered=[Z]),
        edge("c", "b", lowered=[Z]),
        edge("c", "a", lowered=[Z]),
    ]
    assert [cut.variable for cut in sieve(edges).cuts] == [X, Y, Z]
    assert not sieve([*edges, edge("c", "c", raised=[Z])]).terminates


def test_the_stuck_component_is_named():
    good = [edge("g", "g", lowered=[X]), edge("g", "a")]
    bad = [edge("a", "b", lowered=[X]), edge("b", "a", raised=[X])]
    assert [set(part) for part in sieve(good + bad).stuck] == [set(bad)]


def test_against_all_edge_sets_that_a_run_can_repeat():
    endless = 0
    for seed in range(400):
        rng = random.Random(seed)
        nodes = range(rng.randint(1, 4))
        effects = {n: (set(), set()) for n in nodes}
        for n in nodes:
            for variable in (X, Y):
                choice = rng.choice(["", "", "lower", "raise"])
                if choice:
                    effects[n][choice == "raise"].add(variable)
        edges = [edge(a, b, *effects[a]) for a in nodes for b in nodes if rng.random() < 0.5]
        repeats = False
        for walk in closed_walks([(e.source, e.target) for e in edges]):
            lowered = set().union(*(effects[a][0] for a, _ in walk))
            raised = set().union(*(effects[a][1] for a, _ in walk))
            repeats |= not lowered - raised
        endless += repeats
        assert sieve(edges).terminates == (not repeats)
    assert 50 < endless < 350
