"""`asp/certificate.lp` against the Python oracle, on shipped bundles and on bundles with a seeded mistake."""

import random
import re
import subprocess
import sys
from collections import Counter
from itertools import count
from pathlib import Path

import pytest
from helpers.certificate_oracle import problems

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.policy.check import SENTENCES
from gentamp_lp.policy.policy import Policy
from gentamp_lp.solvers.asp import deduce

PROGRAM = resource("asp", "certificate.lp")
BUNDLES = {
    name: Path(__file__).parents[1] / "policies" / name for name in ("unstack", "load", "clutter", "sort", "transport")
}
WRONG = 200
WORDS = ("true", "false", "positive", "zero", "increase", "decrease")
OTHER = {"true": "false", "false": "true", "positive": "zero", "zero": "positive",
         "increase": "decrease", "decrease": "increase"}  # fmt: skip
Fact = tuple[str, ...]  # predicate and arguments


def verdict(text: str) -> set[str]:
    """The kinds of reasons that speak against a policy.lp; none if it is right."""
    shown = deduce([PROGRAM], text)
    kinds = {reason if isinstance(reason, str) else reason[0] for (reason,) in shown.get("wrong", [])}
    assert bool(kinds) != ("right" in shown)
    return kinds


# ---- Mistakes: each takes the facts of a policy and a random source, and changes the facts


def pick(facts, rng, *names):
    return rng.choice([fact for fact in facts if fact[0] in names])


def states(facts):
    return sorted({fact[1] for fact in facts if fact[0] == "value"})


def drop_rule(facts, rng):
    _, state, _ = pick(facts, rng, "rule")
    facts[:] = [fact for fact in facts if fact[:2] not in (("rule", state), ("outcome", state))]


def drop_rule_only(facts, rng):
    facts.remove(pick(facts, rng, "rule"))


def drop_outcome(facts, rng):
    facts.remove(pick(facts, rng, "outcome"))


def drop_outcomes(facts, rng):
    _, state, _ = pick(facts, rng, "outcome")
    facts[:] = [fact for fact in facts if fact[:2] != ("outcome", state)]


def wrong_outcome(facts, rng):
    _, state, after = fact = pick(facts, rng, "outcome")
    others = [s for s in states(facts) if s != after and ("outcome", state, s) not in facts]
    facts[facts.index(fact)] = ("outcome", state, rng.choice(others or [state]))


def unmet_precondition(facts, rng):
    _, action, feature, value = fact = pick(facts, rng, "precondition")
    facts[facts.index(fact)] = ("precondition", action, feature, OTHER[value])


def drop_precondition(facts, rng):
    facts.remove(pick(facts, rng, "precondition"))


def other_action(facts, rng):
    _, state, action = fact = pick(facts, rng, "rule")
    facts[facts.index(fact)] = ("rule", state, rng.choice([f[1] for f in facts if f[0] == "action" and f[1] != action]))


def other_effect(facts, rng):
    _, action, feature, word = fact = pick(facts, rng, "effect")
    facts[facts.index(fact)] = ("effect", action, feature, OTHER[word])


def drop_effect(facts, rng):
    facts.remove(pick(facts, rng, "effect"))


def flip_value(facts, rng):
    _, state, feature, value = fact = pick(facts, rng, "value")
    facts[facts.index(fact)] = ("value", state, feature, OTHER[value])


def drop_value(facts, rng):
    facts.remove(pick(facts, rng, "value"))


def drop_step(facts, rng):
    _, number, _ = pick(facts, rng, "cut")
    facts[:] = [fact for fact in facts if fact[:2] not in (("cut", number), ("within", number))]


def other_step(facts, rng):
    _, number, feature = fact = pick(facts, rng, "cut")
    others = [f[1] for f in facts if f[0] == "feature" and f[1] != feature]
    facts[facts.index(fact)] = ("cut", number, rng.choice(others))


def drop_within(facts, rng):
    facts.remove(pick(facts, rng, "within"))


def drop_goal(facts, rng):
    facts.remove(pick(facts, rng, "goal"))


def rule_in_goal(facts, rng):
    _, state = pick(facts, rng, "goal")
    facts += [("rule", state, pick(facts, rng, "action")[1]), ("outcome", state, state)]


def goal_as_start(facts, rng):
    """A state that was only seen: with its goal dropped, nothing is said of it."""
    _, state = fact = pick(facts, rng, "goal")
    facts[facts.index(fact)] = ("initial", state)


def claim_strong(facts, rng):
    facts[facts.index(pick(facts, rng, "fairness"))] = ("fairness", '"strong"')


def claim_less(facts, rng):
    facts[facts.index(pick(facts, rng, "fairness"))] = ("fairness", '"strong-cyclic"')


def unknown_action(facts, rng):
    _, state, _ = fact = pick(facts, rng, "rule")
    facts[facts.index(fact)] = ("rule", state, "a99")


REACH = {"not_closed", "no_rule", "no_goal"}
KINDS = {
    drop_rule: REACH,
    drop_rule_only: {"outcome_without_rule"},
    drop_outcome: {"no_outcome", "no_goal", "component"},
    drop_outcomes: {"no_outcome"},
    wrong_outcome: {"outcome", "not_closed"},
    unmet_precondition: {"precondition"},
    drop_precondition: {"no_precondition"},
    other_action: {"precondition", "effect", "outcome"},
    other_effect: {"effect", "outcome", "rises", "loop"},
    drop_effect: {"outcome", "loop"},
    flip_value: {"two_rules", "rule_in_goal", "precondition", "effect", "outcome"},
    drop_value: {"no_value"},
    drop_step: {"loop", "component"},
    other_step: {"rises", "loop"},
    drop_within: {"component", "loop"},
    drop_goal: {"not_closed"},
    rule_in_goal: {"rule_in_goal"},
    goal_as_start: {"not_closed", "no_rule"},
    claim_strong: {"loop"},
    claim_less: set(),
    unknown_action: {"no_action"},
}  # fmt: skip


def read(text: str) -> list[Fact]:
    """The facts that the program reads; no string in them has a comma, but for the texts of features."""
    found = re.findall(r"(?m)(?:^|  )([a-z]+)\((.*?)\)\.(?=  |$)", text)
    return [(name, *arguments.split(", ", 3)) for name, arguments in found]


def write(facts: list[Fact]) -> str:
    return "".join(f"{name}({', '.join(arguments)}).\n" for name, *arguments in facts)


def oracle(folder: Path) -> tuple[Policy | None, list[str]]:
    """What the reader or the Python checker says of a bundle."""
    try:
        policy = Policy.load(folder)
    except InputError as error:
        return None, [str(error)]
    return policy, problems(policy)


@pytest.mark.parametrize("task", BUNDLES)
def test_shipped_policies_are_right(task):
    text = (BUNDLES[task] / "policy.lp").read_text()
    assert verdict(text) == set()
    assert Policy.load(BUNDLES[task]).check() == problems(Policy.load(BUNDLES[task])) == []
    assert verdict(write(read(text))) == set()


@pytest.mark.parametrize("task", BUNDLES)
def test_clingo_alone_gives_the_verdict(task, tmp_path):
    def run(policy: Path) -> str:
        command = [sys.executable, "-m", "clingo", "--warn=all", str(PROGRAM), str(policy)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.stderr == ""
        return re.search(r"Answer: 1.*\n(.*)", done.stdout)[1]

    assert run(BUNDLES[task] / "policy.lp") == "right"
    text = (BUNDLES[task] / "policy.lp").read_text()
    broken = tmp_path / "policy.lp"
    broken.write_text(re.sub(r"(?m)^cut.*", "", text))
    assert "wrong(loop(s1))" in run(broken)
    broken.write_text(text.replace("rule(s1, a1).", "rule(s1, a2)."))
    assert "wrong(precondition(s1,a2," in run(broken)


def test_200_mistakes_are_found_and_the_oracle_agrees(tmp_path):
    rng, wrong, right = random.Random(0), Counter(), Counter()
    mistakes, tasks = list(KINDS), list(BUNDLES)
    for number in count():
        mistake, bundle = mistakes[number % len(mistakes)], BUNDLES[tasks[number // len(mistakes) % len(tasks)]]
        facts = read((bundle / "policy.lp").read_text())
        mistake(facts, rng)
        (tmp_path / "policy.lp").write_text(write(facts))
        (tmp_path / "features.pl").write_text((bundle / "features.pl").read_text())
        found = verdict(write(facts))
        policy, expected = oracle(tmp_path)
        assert bool(found) == bool(expected), (mistake.__name__, bundle.name, found, expected)
        if policy is not None:
            assert comparable(policy.check()) == comparable(expected)
        if found:
            assert found & KINDS[mistake], (mistake.__name__, bundle.name, found)
        (wrong if found else right)[mistake] += 1
        if wrong.total() == WRONG:
            break
    assert wrong.keys() == {mistake for mistake in KINDS if KINDS[mistake]}
    assert right.total() < WRONG / 2


def comparable(sentences: list[str]) -> set[str]:
    """What both must say: the oracle keeps the outcomes of two rules apart, and ends at the first step that fails."""
    if any(sentence.startswith("two rules") for sentence in sentences):
        return {"two rules"}
    return {"no end" if s.startswith(("certificate step", "a loop is left")) else s for s in sentences}


def test_more_features_than_bits_are_no_guarantee():
    """The numbers of states would run over, and different states become one."""
    assert "many_features" in verdict("".join(f'feature(f{i}, boolean, 1, "").\n' for i in range(31)))


def test_every_reason_has_a_sentence():
    """What the rules derive and what Python words are the same kinds."""
    rules = "".join(path.read_text() for path in resource("asp", "certificate").glob("*.lp"))
    assert set(re.findall(r"(?m)^(?:fault|wrong)\(([a-z_]+)", rules)) == set(SENTENCES)
