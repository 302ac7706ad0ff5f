"""The check of certificates: it accepts what is right, and nothing else."""

import copy
import json
import random

import pytest
from helpers.problem_brute import random_fond
from helpers.problem_examples import nested

from gentamp_lp.errors import InputError
from gentamp_lp.synthesis import synthesize
from gentamp_lp.synthesis.certificate import FORMAT, certificate, check
from gentamp_lp.synthesis.reading import parse_problem
from gentamp_lp.synthesis.solving import sieve_policy

SOURCES = [("nested.lp", nested(2))]


@pytest.fixture
def right():
    found = synthesize(parse_problem(SOURCES))
    document = json.loads(json.dumps(certificate(found, SOURCES)))
    assert check(document) == []
    return document


def test_a_rule_less(right):
    right["rules"] = right["rules"][1:]
    assert any("no rule" in problem for problem in check(right))


def test_another_action(right):
    right["rules"][0]["action"] = "a1"
    assert check(right) == ["a1 cannot be taken in x0>0, x1=0, x2=0"]


def test_an_outcome_less(right):
    right["rules"][0]["outcomes"].pop()
    assert check(right) == ["the outcomes of a0 in x0>0, x1=0, x2=0 are not those of the problem"]


def test_more_fairness(right):
    right["rules"][0]["con_B"] = []
    assert check(right) == ["the fairness of a0 in x0>0, x1=0, x2=0 is not that of the problem"]


def test_a_deletion_less(right):
    assert [row["constraint"] for row in right["deletions"]][:3] == ["x0", "x1", "x2"]
    for number in range(len(right["deletions"])):
        document = copy.deepcopy(right)
        del document["deletions"][number]
        assert check(document) != []


def test_deletions_in_a_wrong_order(right):
    right["deletions"].reverse()
    assert "con_B(x2) is taken in its states" in check(right)[0] or "a loop leaves its states" in check(right)[0]


def test_a_stronger_level(right):
    right["fairness"] = "strong"
    assert check(right) == ["a loop is left: the policy is not strong"]


def test_another_problem(right):
    right["sources"][0]["text"] += "init(x2, positive)."
    with pytest.raises(InputError, match="contradicts"):
        check(right)
    right["sources"][0]["text"] = SOURCES[0][1].replace("init(x1, zero)", "init(x1, positive)")
    assert check(right)[0] == "the initial states are not those of the problem"


@pytest.mark.parametrize("key", ["sources", "rules", "fairness", "initial", "deletions", "version"])
def test_parts_missing(right, key):
    del right[key]
    with pytest.raises(InputError, match="not a whole certificate"):
        check(right)


def test_no_false_certificate():
    """Every policy of random problems, with SIEVE's deletions and with random ones, against enumeration."""
    ends = never = 0
    for seed in range(200):
        rng = random.Random(seed)
        while not (tiny := random_fond(rng)).few(6, 40):
            pass
        sources = [("tiny.lp", tiny.text)]
        problem = parse_problem(sources)
        number = {name: i for i, name in enumerate(problem.states)}
        choices = {(choice.state, choice.action): choice for choice in problem.choices}
        for names in tiny.policies():
            policy = {number[state]: choices[number[state], action] for state, action in names.items()}
            terminates = "qnp" in tiny.levels(names)
            verdict = sieve_policy(policy)
            assert verdict.terminates == terminates, f"seed {seed}: {names}"
            ends, never = ends + terminates, never + (not terminates)
            document = forged(problem, policy, sources)
            document["deletions"] = [
                {"constraint": problem.constraints[cut.variable], "states": [problem.states[s] for s in cut.nodes]}
                for cut in verdict.cuts
            ]
            assert (check(document) == []) == terminates, f"seed {seed}: {names}"
            for _ in range(0 if terminates or not problem.constraints else 10):
                document["deletions"] = [
                    {
                        "constraint": rng.choice(problem.constraints),
                        "states": rng.sample(sorted(names), rng.randint(1, len(names))),
                    }
                    for _ in range(rng.randint(1, 4))
                ]
                assert check(document) != [], f"seed {seed}: {names}"
    assert ends > 200 and never > 200


def forged(problem, policy, sources):
    name, constraint = problem.states, problem.constraints
    return {
        "format": FORMAT,
        "version": 1,
        "fairness": "qnp",
        "initial": [name[state] for state in problem.initial],
        "rules": [
            {
                "state": name[state],
                "action": choice.action,
                "outcomes": [name[after] for after in choice.outcomes],
                "con_A": [constraint[i] for i in choice.lowered],
                "con_B": [constraint[i] for i in choice.raised],
            }
            for state, choice in policy.items()
        ],
        "sources": [{"name": source, "text": text} for source, text in sources],
    }
