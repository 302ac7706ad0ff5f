"""The lazy program against brute force and against the declarative reference, on random tiny samples."""

import random
from collections import Counter
from dataclasses import replace

import pytest
from helpers.brute import Sample

from gentamp_lp.abstraction.choose import NoPolicy, synthesize_policy
from gentamp_lp.abstraction.facts import theory_facts
from gentamp_lp.abstraction.lazy_clauses import refute
from gentamp_lp.abstraction.observations import observation_facts, parse_observations
from gentamp_lp.abstraction.theory import compress
from gentamp_lp.base.shipped import resource
from gentamp_lp.solvers.asp import GroundProgram

LEVELS = ("qnp", "strong-cyclic", "strong")


def solved(sample, fairness, seed=0, unseen="drop"):
    try:
        answer = synthesize_policy(sample.facts(), fairness=fairness, unseen=unseen, seed=seed)
    except NoPolicy:
        return None
    assert answer.optimal and answer.bound == answer.cost
    return (answer.cost, len(answer.features), answer.features, answer.chosen)


@pytest.mark.parametrize("block", range(6))
def test_the_answer_is_the_first_optimum_of_brute_force(block):
    found = 0
    for seed in range(250 * block, 250 * (block + 1)):
        sample = Sample(random.Random(seed))
        fairness = LEVELS[seed % 3]
        optima = sample.optima(fairness)
        wanted = None
        if optima:
            cost, _, number, _, features, moves = optima[0]
            wanted = (cost, number, features, tuple(sorted(moves)))
            found += 1
        assert solved(sample, fairness, seed=seed % 4) == wanted, f"sample {seed}, {fairness}"
    assert found > 20


@pytest.mark.parametrize("block", range(5))
def test_subsets_of_up_to_twelve_features(block):
    found = 0
    for seed in range(120 * block, 120 * (block + 1)):
        sample = Sample(random.Random(50_000 + seed), features=(8, 12))
        fairness = LEVELS[seed % 3]
        wanted, answer = sample.least(fairness), solved(sample, fairness)
        found += wanted is not None
        assert (answer and (answer[0], answer[1])) == (wanted and (wanted[0], wanted[2])), f"sample {seed}, {fairness}"
    assert found > 60


def test_unseen_outcomes_can_be_refused():
    found = differ = 0
    for seed in range(500):
        sample = Sample(random.Random(60_000 + seed))
        fairness = LEVELS[seed % 3]
        optima, lenient = sample.optima(fairness, "refuse"), sample.optima(fairness)
        answer = solved(sample, fairness, unseen="refuse")
        assert (answer and answer[:3]) == (optima[0][0], optima[0][2], optima[0][4]) if optima else answer is None
        found += bool(optima)
        differ += bool(lenient) and (not optima or optima[0] != lenient[0])
    assert found > 20 and differ > 20


@pytest.mark.parametrize("fairness, unseen", [*((level, "drop") for level in LEVELS), ("qnp", "refuse")])
def test_the_declarative_reference_agrees(fairness, unseen):
    found = 0
    for seed in range(200):
        sample = Sample(random.Random(10_000 + seed))
        options = ["--opt-mode=opt", "-c", f"fairness={fairness.replace('-', '_')}", "-c", f"unseen={unseen}"]
        answers = GroundProgram([resource("asp", "reference.lp")], sample.facts(), options=options).solve().answers
        optima = sample.optima(fairness, unseen)
        assert bool(answers) == bool(optima), f"sample {seed}"
        if answers:
            found += 1
            assert answers[-1].cost == optima[0][:3], f"sample {seed}"
            assert answers[-1].atoms.get("selected") in [row[4] for row in optima if row[:3] == optima[0][:3]]
    assert found > 20


@pytest.mark.parametrize("fairness, unseen", [*((level, "drop") for level in LEVELS), ("qnp", "refuse")])
def test_a_candidate_is_refuted_exactly_where_the_reference_forbids_it(fairness, unseen):
    """Any features and moves, not only optimal ones: clauses in Python against the rules they stand for."""
    constants = ["-c", f"fairness={fairness.replace('-', '_')}", "-c", f"unseen={unseen}"]
    verdicts = Counter()
    for seed in range(250):
        rng = random.Random(80_000 + seed)
        observations = parse_observations(Sample(rng, features=(2, 4)).facts())
        theory = compress(observations, fairness, unseen)
        selection = theory.features & rng.choice([rng.getrandbits(8), -1, -1])
        moves = {state.id: rng.choice(state.moves) for state in theory.expanded}
        chosen = [
            next(t for t in options if same_change(observations.transitions[t], moves[theory.home[s]], theory.features))
            for s, options in observations.candidates.items()
        ]
        fixed = [f":- selected({f}).\n" for f in observations.ids(theory.features & ~selection)]
        fixed += [f":- not selected({f}).\n" for f in observations.ids(selection)]
        fixed += [f":- not chosen({transition}).\n" for transition in chosen]
        facts = observation_facts(observations, theory.features) + "".join(fixed)
        program = GroundProgram([resource("asp", "reference.lp")], facts, options=constants)
        allowed = bool(program.solve(optimize=False).answers)
        idle = any(not (move.inc | move.dec) & selection for move in moves.values())  # asp/abstraction/moves.lp
        refuted = idle or refute(theory, selection, {state: move.id for state, move in moves.items()})
        assert allowed == (not refuted), f"sample {seed}: {refuted}"
        verdicts[allowed] += 1
    assert min(verdicts[True], verdicts[False]) > 10


def same_change(transition, move, features):
    return not ((transition.inc ^ move.inc) | (transition.dec ^ move.dec)) & features


def test_covers_are_consequences():
    """Leaving the covers out changes no answer: brute force, which knows none, has the same optima."""
    rows = 0
    for seed in range(300):
        sample = Sample(random.Random(20_000 + seed))
        theory = compress(parse_observations(sample.facts()), "qnp")
        pairs = {}
        for line in theory_facts(theory).splitlines():
            if line.startswith("tells("):
                s, t, f = map(int, line[6:-2].split(","))
                pairs.setdefault((s, t), set()).add(f)
        for *_, features, _ in sample.optima("strong-cyclic"):
            for pair, cover in pairs.items():
                rows += 1
                # the program may have merged equal features: compare by their values
                same = {f for f in features if any(equal(sample, f, g) for g in cover)}
                assert same, f"sample {seed}: {features} violates the cover of {pair}"
    assert rows > 100


def equal(sample, f, g):
    rows = [t for t, _, _ in sample.trans]
    return sample.kind[f] == sample.kind[g] and all(
        [
            all((sample.value[f, s] > 0) == (sample.value[g, s] > 0) for s in sample.states),
            all(sample.change(f, t) == sample.change(g, t) for t in rows),
        ]
    )


def test_a_merged_pool_answers_like_the_full_one():
    """Twins of every feature, dearer or later, change nothing."""
    for seed in range(60):
        sample = Sample(random.Random(30_000 + seed))
        before = solved(sample, "qnp")
        twin = len(sample.features)
        for f in list(sample.features):
            g = f + twin
            sample.features.append(g)
            sample.cost[g], sample.kind[g] = sample.cost[f] + seed % 2, sample.kind[f]
            sample.sizes[g] = sample.sizes[f]
            sample.value |= {(g, s): sample.value[f, s] for s in sample.states}
        assert solved(sample, "qnp") == before


def test_fewer_features_than_the_pool_are_considered_after_merging():
    facts = "state(1,1). state(2,1). goal(2). transition(1,1,2). candidate(1).\n" + "\n".join(
        f"feature({f},{f},boolean). pos({f},1). dec({f},1)." for f in (1, 2, 3)
    )
    theory = compress(parse_observations(facts), "qnp")
    assert theory.features == 1
    assert refute(replace(theory, fairness="strong"), 1, {1: 1}) == []


def test_every_choice_of_moves_of_a_conflict_is_explained():
    """Clashes bar features one after the other, each once; with the others something is violated."""
    clashing = 0
    for seed in range(150):
        sample, fairness = Sample(random.Random(90_000 + seed)), LEVELS[seed % 3]
        try:
            synthesize_policy(sample.facts(), fairness=fairness)
        except NoPolicy as error:
            assert bool(error.attempts) == bool(error.states and not error.pairs)
            for attempt in error.attempts:
                assert attempt.kind != "consistency" and (attempt.kind or attempt.idle), f"sample {seed}, {fairness}"
                assert tuple(attempt.moves) == error.states
                barred = [feature for clash in attempt.clashes for feature in clash.barred]
                clashing += bool(barred)
                assert len(barred) == len(set(barred))
    assert clashing > 5
