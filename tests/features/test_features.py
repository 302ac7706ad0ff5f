"""Features mean the same as axioms (evaluated in Python) and as formulas of the pool (evaluated in Prolog)."""

import re
from collections.abc import Iterable

import pytest
from helpers.brute_force import pool_rows

from gentamp_lp.demonstrations.dataset import Dataset, TrainingProblem
from gentamp_lp.features.axioms import Features, to_formula
from gentamp_lp.features.feature import Feature
from gentamp_lp.features.pool import Pool, generate_pool, split_formula
from gentamp_lp.features.values import matches_effects, valuation
from gentamp_lp.learning.learn import Learned
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Not, Or
from gentamp_lp.streams.pddl import Axiom, Domain, Predicate, parse_domain
from gentamp_lp.streams.semantics import Program, View

SAMPLE = 35


def closed(domain: Domain, data: Dataset, problem: TrainingProblem) -> FactBase:
    """What the dataset knows of a problem, with no streams to ask for more."""
    names = {name: name for names in problem.entities.values() for name in names}
    sorts = {name: tuple(row) for name, row in data.predicates.items()}
    base = FactBase(domain, (), {}, names, sorts)
    for fact in problem.static:
        base.add(fact)
    return base


def as_features(pool: Pool, chosen: Iterable[int]) -> Features:
    kinds = dict(re.findall(r"feature\((\d+),\d+,(\w+)\)", pool.facts))
    found = []
    for i in chosen:
        variable, sort, body = split_formula(pool.formulas[i])
        found.append(Feature(f"feature{i}", kinds[str(i)], 1, body, variable, sort))
    return Features.of(found)


def test_python_and_prolog_agree_on_every_feature(learned: Learned) -> None:
    data, domain = learned.dataset, learned.task.folder.domain
    pool = generate_pool(data.pool_facts(), max_cost=3)
    chosen = [i for i, formula in pool.formulas.items() if formula.count("cfree(") < 2]  # joins of two take seconds
    chosen = chosen[:: max(1, len(chosen) // SAMPLE)]
    features = as_features(pool, chosen)
    program = Program.of(domain, features.axioms)
    bases = [closed(domain, data, problem) for problem in data.problems]
    steps = {n: t for n, t in enumerate(data.transitions) if t.demonstrated}
    values = {}
    for number in sorted({end for t in steps.values() for end in (t.source, t.target)}):
        state = data.states[number]
        fluents = frozenset(fact for fact in state.facts if fact[0] in domain.fluents)
        values[number] = features.values(View(program, bases[state.problem], fluents))
    pos, inc, dec = (pool_rows(pool, name) for name in ("pos", "inc", "dec"))
    for i in chosen:
        counts = {number: value[f"feature{i}"] for number, value in values.items()}
        changes = {n: counts[t.target] - counts[t.source] for n, t in steps.items()}
        assert {s for s, count in counts.items() if count} == pos[i] & counts.keys(), pool.formulas[i]
        assert {n for n, change in changes.items() if change > 0} == inc[i] & steps.keys(), pool.formulas[i]
        assert {n for n, change in changes.items() if change < 0} == dec[i] & steps.keys(), pool.formulas[i]
        assert max(counts.values()) <= 1 or features.features[chosen.index(i)].kind == "numeric"


def test_the_sample_covers_what_features_are_made_of(learned: Learned) -> None:
    """Else the comparison above would be about little."""
    pool = generate_pool(learned.dataset.pool_facts(), max_cost=3)
    for word in ("some(", "every(", "neg(", "conj(", "implies("):
        assert any(word in formula for formula in pool.formulas.values()), word


def test_selected_features_have_the_values_the_policy_was_built_on(learned: Learned) -> None:
    """The rules' preconditions and effects, computed anew on the demonstrated transitions."""
    data, policy, domain = learned.dataset, learned.policy, learned.task.folder.domain
    features = Features.of(policy.features)
    program = Program.of(domain, features.axioms)
    bases = [closed(domain, data, problem) for problem in data.problems]
    kinds = {f.name: f.kind for f in policy.features}

    def values(number: int) -> dict[str, int]:
        state = data.states[number]
        fluents = frozenset(fact for fact in state.facts if fact[0] in domain.fluents)
        return features.values(View(program, bases[state.problem], fluents))

    for number, state in enumerate(data.states):
        if state.goal:
            assert tuple(valuation(values(number)).values()) in policy.goals
            assert policy.rule_for(valuation(values(number))) is None
    for number in sorted({t.source for t in data.transitions if t.demonstrated}):
        before = values(number)
        rule = policy.rule_for(valuation(before))
        assert rule is not None
        action = policy.action(rule.action)
        follows = [
            t for t in data.transitions
            if t.source == number and matches_effects(action.effects, kinds, before, values(t.target))
        ]  # fmt: skip
        assert follows, f"the policy's action {action.name} is not possible in state {number}"


# ---- From terms to formulas

P, Q = Atom("p", ("?v0",)), Atom("q", ("?v0",))
R = Atom("r", ("?v0", "?v1"))
SORT = Atom("sort-o", ("?v1",))


@pytest.mark.parametrize(
    ("term", "formula"),
    [
        ("true", And(())),
        ("flag", Atom("flag", ())),
        ("p(v0)", P),
        ("'on-top'(v0,v1)", Atom("on-top", ("?v0", "?v1"))),
        ("neg(p(v0))", Not(P)),
        ("conj(p(v0),q(v0))", And((P, Q))),
        ("disj(p(v0),q(v0))", Or((P, Q))),
        ("implies(p(v0),q(v0))", Or((Not(P), Q))),
        ("some(v1,o,r(v0,v1))", Exists(("?v1",), R)),
        ("some(v1,o,neg(r(v0,v1)))", Exists(("?v1",), And((SORT, Not(R))))),
        ("some(v1,o,p(v0))", Exists(("?v1",), And((SORT, P)))),
        ("some(v1,o,disj(r(v0,v1),p(v1)))", Exists(("?v1",), Or((R, Atom("p", ("?v1",)))))),
        ("some(v1,o,disj(r(v0,v1),p(v0)))", Exists(("?v1",), And((SORT, Or((R, P)))))),
        ("some(v1,o,some(v2,o,r(v1,v2)))", Exists(("?v1",), Exists(("?v2",), Atom("r", ("?v1", "?v2"))))),
        ("some(v1,o,conj(neg(p(v1)),r(v0,v1)))", Exists(("?v1",), And((Not(Atom("p", ("?v1",))), R)))),
        ("every(v1,o,r(v0,v1))", Forall(("?v1",), Or((Not(SORT), R)))),
        ("every(v1,o,neg(r(v0,v1)))", Forall(("?v1",), Not(R))),
        (
            "every(v1,o,implies(r(v0,v1),p(v1)))",
            Forall(("?v1",), Or((Not(R), Atom("p", ("?v1",))))),
        ),
        ("every(v1,o,implies(p(v0),r(v0,v1)))", Forall(("?v1",), Or((Not(SORT), Or((Not(P), R)))))),
    ],
)
def test_terms_become_formulas(term: str, formula: object) -> None:
    assert to_formula(term) == (formula, [])


def test_a_closure_becomes_a_recursive_axiom() -> None:
    formula, axioms = to_formula("conj(p(v0),closure(v1,v2,o,r(v1,v2),v0,v3))", "f7")
    assert formula == And((P, Atom("f7-closure1", ("?v0", "?v3"))))
    step, between = Atom("r", ("?v1", "?v2")), Atom("r", ("?v1", "?v2-between"))
    onward = Exists(("?v2-between",), And((between, Atom("f7-closure1", ("?v2-between", "?v2")))))
    assert axioms == [Axiom(Atom("f7-closure1", ("?v1", "?v2")), Or((step, onward)))]


@pytest.mark.parametrize("term", ["some(v1,o)", "closure(v1)", "every(v1)", "neg", "", "conj(p(v0)", "p(q(v0))"])
def test_what_is_no_formula_of_the_pool_is_refused(term: str) -> None:
    with pytest.raises(ValueError, match="not a formula"):
        to_formula(term)


def test_a_feature_over_things_that_lack_something_counts_entities_of_its_sort_only() -> None:
    features = Features.of([Feature("f1", "numeric", 1, "neg(p(v0))", "v0", "o")])
    assert features.axioms == (Axiom(Atom("f1", ("?v0",)), And((Atom("sort-o", ("?v0",)), Not(P)))),)
    domain = Domain("d", {"p": Predicate("p", "p", 1), "s": Predicate("s", "s", 1)}, (), (), ())
    base = FactBase(domain, (), {}, dict.fromkeys(["a", "b", "g"]), {"p": ("o",), "s": ("g",)})
    for fact in (("p", "a"), ("s", "g")):
        base.add(fact)
    base.sorts = {**base.sorts, "t": ("o",)}
    base.add(("t", "b"))
    view = View(Program.of(domain, features.axioms), base, frozenset())
    assert view.extension("f1") == [("b",)]
    assert features.values(view) == {"f1": 1}


# ---- Closures and recursion

TOWERS = """(define (domain d) (:predicates (on ?x ?y) (above ?x ?y) (bad ?x) (lonely ?x ?y))
  (:action noop :parameters (?x ?y) :effect (not (on ?x ?y)))
  (:derived (above ?x ?y) (or (on ?x ?y) (exists (?z) (and (on ?x ?z) (above ?z ?y))))))"""


def towers(*pairs: str) -> tuple[Domain, FactBase, frozenset[tuple[str, ...]]]:
    domain = parse_domain(TOWERS)
    base = FactBase(domain, (), {}, dict.fromkeys("abcde"), {"thing": ("o",)})
    for name in "abcde":
        base.add(("thing", name))
    return domain, base, frozenset(("on", *pair) for pair in pairs)


def count(term: str, *pairs: str, variable: str | None = "v0") -> int:
    domain, base, state = towers(*pairs)
    features = Features.of([Feature("f1", "numeric", 1, term, variable, "o" if variable else None)])
    return features.values(View(Program.of(domain, features.axioms), base, state))["f1"]


def test_closure_values() -> None:
    above_something = "some(v3,o,closure(v1,v2,o,on(v1,v2),v0,v3))"
    assert count(above_something, "ab", "bc", "de") == 3
    above_c = "some(v3,o,conj(closure(v1,v2,o,on(v1,v2),v0,v3),neg(some(v4,o,on(v3,v4)))))"
    assert count(above_c, "ab", "bc", "cd") == 3
    assert count("closure(v1,v2,o,on(v1,v2),v0,v0)", "ab", "ba", "bc") == 2
    assert count("neg(some(v3,o,closure(v1,v2,o,on(v1,v2),v0,v3)))", "ab", "bc") == 3
    assert count("some(v3,o,closure(v1,v2,o,on(v1,v2),v3,v3))", "ab", "bc", "ca", variable=None) == 1


def test_a_closure_over_what_another_recursion_denies() -> None:
    """`not above` inside a closure: the inner recursion must be complete before the outer one starts."""
    far = "some(v3,o,closure(v1,v2,o,neg(above(v1,v2)),v0,v3))"
    pairs = [x + y for x in "abcde" for y in "abcde"]
    assert count(far, *pairs) == 0  # everything is above everything
    chain = ["ab", "bc", "cd", "de", "ea"]  # so it is along a ring, but only after four rounds
    assert count(far, *chain) == 0
    domain, base, state = towers(*chain)
    features = Features.of([Feature("aaa", "numeric", 1, far, "v0", "o")])  # sorts before `above`
    assert features.values(View(Program.of(domain, features.axioms), base, state)) == {"aaa": 0}


def test_recursions_that_meet_through_a_plain_axiom_are_complete() -> None:
    text = TOWERS.replace(
        "(:derived (above",
        """(:derived (lonely ?x ?y) (above ?y ?x))
  (:derived (bad ?x) (exists (?y) (and (lonely ?x ?y) (or (on ?x ?x) (bad ?y) (above ?y ?y)))))
  (:derived (above""",
    )
    domain = parse_domain(text)
    _, base, state = towers("ab", "bc", "cd", "aa")
    view = View(Program.of(domain), base, state)
    assert sorted(view.extension("bad")) == [("a",), ("b",), ("c",), ("d",)]
    assert len(view.extension("above")) == 7


# ---- Effects


@pytest.mark.parametrize("kind", ["numeric", "boolean"])
@pytest.mark.parametrize("effect", [None, "increase", "decrease", "true", "false"])
def test_matches_effects(kind: str, effect: str | None) -> None:
    effects = {} if effect is None else {"f": effect}
    for before in range(4):
        for after in range(4):
            if kind == "numeric":
                change = "increase" if after > before else "decrease" if after < before else None
            else:
                change = None if (before > 0) == (after > 0) else "true" if after else "false"
            found = matches_effects(effects, {"f": kind}, {"f": before}, {"f": after})
            assert found == (change == effect), (before, after)


def test_every_feature_has_to_match() -> None:
    kinds = {"f": "numeric", "g": "boolean"}
    effects = {"f": "decrease", "g": "true"}
    assert matches_effects(effects, kinds, {"f": 2, "g": 0}, {"f": 1, "g": 1})
    assert not matches_effects(effects, kinds, {"f": 2, "g": 0}, {"f": 1, "g": 0})
    assert not matches_effects(effects, kinds, {"f": 2, "g": 0}, {"f": 2, "g": 1})
    assert not matches_effects({"g": "true"}, kinds, {"f": 2, "g": 0}, {"f": 1, "g": 1})


def test_valuation() -> None:
    assert valuation({"f1": 0, "f2": 3}) == {"f1": False, "f2": True}
