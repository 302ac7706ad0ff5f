"""The encoding `local` allows exactly the steps of the policy, with no steps of its own where regression decides."""

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.following import Case, case_of, change, extensions, fluents, plans_by, plans_in, policy_steps, sorts_of
from hypothesis import given, settings
from hypothesis import strategies as st

from gentamp_lp.constrained.encodings import (
    constrained_domain,
    doubtful,
    invariants,
    left_to_checks,
    original_step,
    to_text,
)
from gentamp_lp.constrained.regression import Regression
from gentamp_lp.features.feature import Feature
from gentamp_lp.learning.learn import Learned
from gentamp_lp.policy.model import AbstractAction, Rule, Valuation
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.downward import search
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Formula, Not, Or, normalize
from gentamp_lp.streams.incremental import simulate
from gentamp_lp.streams.pddl import parse_domain
from gentamp_lp.streams.relations import Relation
from gentamp_lp.streams.semantics import Program, State, Step, View, applicable, apply
from gentamp_lp.tasks.invariants import exclusive
from gentamp_lp.tasks.task import Task

#: Task, size, seed, steps of the longest plans that are compared (0: none are).
CASES = [
    ("unstack", "4", 3, 4), ("load", "1-2", 1, 3), ("load", "2-2", 1, 5), ("sort", "1-1", 1, 4),
    ("clutter", "4", 2, 3), ("transport", "1-1", 1, 7), ("transport", "2-2", 1, 0),
]  # fmt: skip


def policy_of(request, name: str) -> Policy:
    if name in ("unstack", "load"):
        learned: Learned = request.getfixturevalue(name)
        return learned.policy
    return Policy.load(Path(__file__).parents[1] / "policies" / name)


def local_case(policy: Policy, size: str, seed: int) -> Case:
    robot = "mobile_gripper" if policy.task == "transport" else "gripper"
    return case_of(policy, Task.load(policy.task).instance(size, seed, robot=robot), "local")


@pytest.fixture(params=CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def case(request) -> Case:
    name, size, seed, _ = request.param
    return local_case(policy_of(request, name), size, seed)


def settled(case: Case, state: State) -> Iterator[State]:
    """The state, or what the checks make of it."""
    view = View(case.constrained, case.instance.base, state)
    if view.holds(Atom("ready", ())):
        yield state
    else:
        yield from (apply(view, step) for step in applicable(view) if original_step(step) is None)


def constrained_steps(case: Case, state: State) -> Iterator[tuple[Step, State]]:
    view = View(case.constrained, case.instance.base, state)
    for step in applicable(view):
        if (own := original_step(step)) is not None:
            yield from ((own, final) for final in settled(case, apply(view, step)))


# ---- Exactness


def test_every_step_follows_the_policy_and_all_that_do_are_allowed(case: Case) -> None:
    """In states the policy leads to, and in what any other steps make of them."""
    todo, seen, allowed = [case.instance.state], {case.instance.state}, 0
    for state in todo:
        found = set(constrained_steps(case, state))
        assert found == set(policy_steps(case, state))
        allowed += len(found)
        view = View(case.original, case.instance.base, state)
        following = [*(successor for _, successor in sorted(found)), *(apply(view, s) for s in applicable(view))]
        todo += dict.fromkeys(s for s in following if s not in seen and len(todo) < 200)
        seen |= set(todo)
    assert allowed > 8 and len(todo) > 8


@pytest.mark.parametrize("seed", range(3))
def test_so_do_steps_of_any_other_policy_over_these_features(case: Case, seed: int) -> None:
    """In each abstract state the policy wants some change that some step makes there."""
    states, base = [case.instance.state], case.instance.base
    changes: dict[Valuation, dict[tuple[tuple[str, str], ...], None]] = {}
    schemas: dict[tuple[tuple[str, str], ...], set[str]] = {}
    for state in states:
        view, before = View(case.original, base, state), extensions(case, state)
        for step in applicable(view):
            after = extensions(case, successor := apply(view, step))
            effects = {f.name: change(f, before[f.name], after[f.name]) for f in case.policy.features}
            if "mixed" not in effects.values():
                effect = tuple((name, word) for name, word in effects.items() if word)
                changes.setdefault(tuple(map(bool, before.values())), {})[effect] = None
                schemas.setdefault(effect, set()).add(step.schema)
            if successor not in states and len(states) < 40:
                states.append(successor)
    chosen = {look: random.Random(seed).choice(list(options)) for look, options in changes.items()}
    actions, names = [], [f.name for f in case.policy.features]
    for effect in dict.fromkeys(chosen.values()):
        looks = [dict(zip(names, look, strict=True)) for look in chosen if chosen[look] == effect]
        agreed = {name: looks[0][name] for name in names if len({look[name] for look in looks}) == 1}
        actions.append(AbstractAction(f"a{len(actions)}", agreed, dict(effect), tuple(sorted(schemas[effect]))))
    named = {tuple(action.effects.items()): action.name for action in actions}
    rules = tuple(Rule(look, named[effect], ()) for look, effect in chosen.items())
    other = case_of(replace(case.policy, actions=tuple(actions), rules=rules), case.instance, "local")
    assert not any(action.name.startswith("check") for action in other.constrained.domain.actions)
    found = {state: set(constrained_steps(other, state)) for state in states}
    assert found == {state: set(policy_steps(other, state)) for state in states} and any(found.values())


def test_plans_are_those_that_follow_the_policy(case: Case, request) -> None:
    *_, depth = request.node.callspec.params["case"]
    if depth:
        wanted = set(plans_by(case, policy_steps, case.instance.state, depth))
        assert wanted and set(plans_in(case, case.constrained, case.instance.state, depth)) == wanted


def test_fast_downward_finds_such_a_plan(case: Case) -> None:
    goal = And((case.task.goal, Atom("ready", ())))
    plan = search(case.constrained, case.instance.base, case.instance.state, goal, time_limit=60)
    assert plan is not None and not any(step.schema.startswith("check") for step in plan)
    steps = [own for own in map(original_step, plan) if own is not None]
    states = simulate(case.original, case.instance.base, case.instance.state, steps)
    assert states is not None and View(case.original, case.instance.base, states[-1]).holds(case.task.goal)
    for step, before, after in zip(steps, states, states[1:], strict=False):
        assert (step, after) in set(policy_steps(case, before))


def test_what_is_written_is_read_back(case: Case) -> None:
    policy, folder = case.policy, case.task.folder
    domain = constrained_domain(policy, folder, sorts_of(policy), "local", [case.instance.state])
    supposed = invariants(folder.domain, [case.instance.state])
    text = to_text(domain, policy, doubtful(policy, folder), supposed)
    assert "; Initial states have at most one of (atgrasp ?x ?y1) (atpose ?x ?y1) for each ?x.\n" in text
    again = parse_domain(text)
    assert [a.precondition for a in again.actions] == [a.precondition for a in domain.actions]
    assert [a.body for a in again.axioms] == [a.body for a in domain.axioms]


# ---- What is decided, and what is not


def test_nothing_is_left_to_checks_in_the_shipped_tasks(case: Case) -> None:
    policy, folder = case.policy, case.task.folder
    assert left_to_checks(policy, folder, sorts_of(policy), [case.instance.state]) == {}
    assert not any(action.name.startswith("check") for action in case.constrained.domain.actions)


def test_conditions_are_static_where_invariants_say_enough(unstack: Learned) -> None:
    """To take a block from a block, and put it on none: nothing but the placement decides it."""
    case = local_case(unstack.policy, "4", 3)
    (axiom,) = (a for a in case.constrained.domain.axioms if a.head.predicate.startswith("case-"))
    assert axiom.body == Exists(("?x3",), And((Atom("pose", ("?x1", "?x2", "?x3")), Atom("block", ("?x3",)))))
    required = {a.name: set(a.precondition.parts) for a in case.constrained.domain.actions}
    condition = Atom(axiom.head.predicate, ("?o", "?p"))
    assert condition in required["pick--a1"] and Not(condition) in required["place--a2"]
    assert Not(Atom("block", ("?s",))) in required["place--a2"]  # follows from it, and keeps the ground actions few


def test_without_invariants_more_is_tested_and_the_steps_are_the_same(unstack: Learned) -> None:
    case = local_case(unstack.policy, "4", 3)
    policy, folder = case.policy, case.task.folder
    domain = constrained_domain(policy, folder, sorts_of(policy), "local")
    assert len(domain.axioms) > len(case.constrained.domain.axioms)
    bare = replace(case, constrained=Program.of(domain))
    todo = [case.instance.state]
    for state in todo:
        found = dict(constrained_steps(bare, state))
        assert found.items() == set(policy_steps(case, state))
        todo += [s for s in found.values() if s not in todo and len(todo) < 20]


def test_an_initial_state_without_the_invariant_is_not_said_to_have_it(unstack: Learned) -> None:
    """A block is in two places at once."""
    case = local_case(unstack.policy, "4", 3)
    policy, folder, base = case.policy, case.task.folder, case.instance.base
    stacked = next(name for name, _, below in base.relation("pose").rows if below.startswith("block"))
    places = [pose for name, pose, _ in base.relation("pose").rows if name == stacked]
    state = case.instance.state | {("atpose", stacked, pose) for pose in places}
    supposed = [invariants(folder.domain, [s]) for s in (case.instance.state, state)]
    assert len(places) == 2 and [len(words) for words in supposed] == [3, 2]
    domain = constrained_domain(policy, folder, sorts_of(policy), "local", [state])
    right = replace(case, constrained=Program.of(domain))
    assert set(constrained_steps(right, state)) == set(policy_steps(case, state))


def above(policy: Policy) -> Policy:
    """The policy of Unstack where the count is of blocks above a block, at any height."""
    formula = "some(v1,o,conj(closure(v2,v3,o,on(v2,v3),v0,v1),block(v1)))"
    holding, stacked = policy.features
    return replace(policy, features=(holding, Feature(stacked.name, "numeric", 3, formula, "v0", "o", "above")))


def test_a_closure_is_left_to_checks_and_the_rest_is_not(unstack: Learned) -> None:
    policy = above(unstack.policy)
    case = local_case(policy, "4", 3)
    reasons = left_to_checks(policy, case.task.folder, sorts_of(policy), [case.instance.state])
    assert reasons == {
        "pick--a1": {"f2": "pick changes what its closure reads"},
        "place--a2": {"f2": "place changes what its closure reads"},
    }
    names = [a.name for a in case.constrained.domain.actions]
    assert names == ["check--start", "pick--a1", "check--a1", "place--a2", "check--a2"]
    assert "was-f1" not in case.constrained.domain.predicates
    view = View(case.constrained, case.instance.base, case.instance.state)
    todo = [apply(view, step) for step in applicable(view)]
    for state in todo:
        found = set(constrained_steps(case, state))
        assert {(step, fluents(case, s)) for step, s in found} == set(policy_steps(case, fluents(case, state)))
        todo += [s for _, s in sorted(found) if s not in todo and len(todo) < 30]
    assert len(todo) > 4


def test_a_closure_that_an_action_leaves_alone_is_decided(unstack: Learned) -> None:
    """Only actions that change what it reads need checks; the others neither check nor record."""
    policy = above(unstack.policy)
    driving = replace(policy.actions[0], name="a9", effects={}, schemas=("move",))
    case = local_case(replace(policy, actions=(*policy.actions, driving)), "4", 3)
    (move,) = (a for a in case.constrained.domain.actions if a.name == "move--a9")
    assert not any(e.atom.predicate in ("ready", "pending-a9") for e in move.effects)
    assert "check--a9" not in [a.name for a in case.constrained.domain.actions]


def test_an_action_that_cannot_have_the_effect_gets_no_copy(unstack: Learned) -> None:
    first, second = unstack.policy.actions
    policy = replace(unstack.policy, actions=(replace(first, schemas=("pick", "place", "move")), second))
    case = local_case(policy, "4", 3)
    assert [a.name for a in case.constrained.domain.actions] == ["pick--a1", "place--a2"]


def test_conditions_on_too_many_entities_are_left_to_checks(unstack: Learned, monkeypatch) -> None:
    monkeypatch.setattr("gentamp_lp.constrained.local_encoding.WIDEST", 1)
    policy, folder = unstack.policy, unstack.task.folder
    state = unstack.task.instance("4", 3, robot="gripper").state
    reasons = left_to_checks(policy, folder, sorts_of(policy), [state])
    assert reasons["pick--a1"] == {"f2": "its change by pick depends on more than 1 entities at once"}
    domain = constrained_domain(policy, folder, sorts_of(policy), "local", [state])
    assert not any(name.startswith("case-") for name in domain.predicates)


# ---- Regression itself

DOMAIN = parse_domain("""
(define (domain d) (:predicates (p ?x) (q ?x ?y) (r ?x) (s ?x) (d ?x) (e ?x ?y))
  (:action swap :parameters (?a ?b) :precondition (and (p ?a) (r ?b) (not (q ?b ?a)))
    :effect (and (not (p ?a)) (p ?b) (q ?a ?b) (not (q ?b ?b))))
  (:action sweep :parameters (?a) :precondition (d ?a)
    :effect (and (forall (?z) (when (q ?a ?z) (not (q ?a ?z)))) (when (exists (?v) (and (s ?v) (q ?v ?a))) (r ?a))))
  (:derived (d ?x) (exists (?y) (and (q ?x ?y) (p ?y))))
  (:derived (e ?x ?y) (or (q ?x ?y) (and (r ?x) (not (d ?y))))))
""")
NAMES = ("a1", "a2", "a3")
FACTS = [(p, x) for p in "prs" for x in NAMES] + [("q", x, y) for x in NAMES for y in NAMES]


def formulas(scope: tuple[str, ...] = ("?u",), depth: int = 3) -> st.SearchStrategy[Formula]:
    names = st.sampled_from(scope)
    unary = st.builds(lambda p, x: Atom(p, (x,)), st.sampled_from("prsd"), names)
    binary = st.builds(lambda p, x, y: Atom(p, (x, y)), st.sampled_from("qe="), names, names)
    if depth == 0:
        return unary | binary
    inner, new = formulas(scope, depth - 1), f"?v{depth}"
    pairs = st.tuples(inner, inner)
    deeper = formulas((*scope, new), depth - 1)
    quantified = deeper.map(lambda f: Exists((new,), f)) | deeper.map(lambda f: Forall((new,), f))
    return unary | binary | inner.map(Not) | pairs.map(And) | pairs.map(Or) | quantified


@settings(max_examples=400, deadline=None)
@given(formulas(), st.sets(st.sampled_from(FACTS)), st.sampled_from(["swap", "sweep"]), st.booleans())
def test_regression_tells_what_an_action_does(formula: Formula, facts: set, name: str, invariant: bool) -> None:
    """Compared with the formula's truth in the successor, for each entity and each applicable step."""
    program = Program.of(DOMAIN)
    base = FactBase(DOMAIN, (), {}, {n: n for n in NAMES})
    base.static["s"] = Relation([fact[1:] for fact in sorted(facts) if fact[0] == "s"])
    state = frozenset(fact for fact in facts if fact[0] != "s")
    groups = exclusive(DOMAIN, [state]) if invariant else []
    regression = Regression(DOMAIN.action(name), program, groups)
    normal = normalize(Exists((), formula))
    changes = {truth: regression.simplified(regression.becomes(normal, truth)) for truth in (True, False)}
    after = regression.simplified(regression.after(normal))
    view = View(program, base, state)
    for step in applicable(view):
        if step.schema != name:
            continue
        later = View(program, base, apply(view, step))
        for entity in NAMES:
            binding = dict(zip(DOMAIN.action(name).parameters, step.args, strict=True)) | {"?u": entity}
            was, will = view.holds(formula, {"?u": entity}), later.holds(formula, {"?u": entity})
            assert view.holds(after, binding) == will
            assert view.holds(changes[True], binding) == (will and not was)
            assert view.holds(changes[False], binding) == (was and not will)
