"""The constrained domain allows exactly the steps of the policy, and planners can read it."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.following import QUOTA, Case, case_of, extensions, fluents, plans_by, plans_in, policy_steps, sorts_of

from gentamp_lp.constrained.encodings import constrained_domain, doubtful, original_step, to_text
from gentamp_lp.features.feature import Feature
from gentamp_lp.learning.learn import Learned
from gentamp_lp.planning.solve import solve
from gentamp_lp.policy.model import AbstractAction, Rule
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import TRUE, And, Atom, conjuncts
from gentamp_lp.streams.incremental import run_tests, sample, simulate, solve_incremental
from gentamp_lp.streams.pddl import Domain, parse_domain
from gentamp_lp.streams.problem_text import write_problem
from gentamp_lp.streams.semantics import Program, State, Step, View, applicable, apply
from gentamp_lp.tasks.task import Task

FAR = float("inf")
CASES = [("unstack", "3", 2), ("unstack", "4", 3), ("load", "1-2", 1), ("load", "2-2", 1)]


def compiled(learned: Learned) -> Domain:
    return constrained_domain(learned.policy, learned.task.folder, sorts_of(learned.policy))


@pytest.fixture(params=CASES, ids=lambda c: f"{c[0]}-{c[1]}")
def case(request) -> Case:
    name, size, seed = request.param
    learned: Learned = request.getfixturevalue(name)
    return case_of(learned.policy, learned.task.instance(size, seed, robot="gripper"), "check")


# ---- The text


def test_our_parser_reads_what_is_written(learned: Learned) -> None:
    domain = compiled(learned)
    again = parse_domain(learned.domain_pddl)
    assert again.predicates == domain.predicates
    assert [a.name for a in again.actions] == [a.name for a in domain.actions]
    assert {a.head for a in again.axioms} == {a.head for a in domain.axioms}
    assert [a.precondition for a in again.actions] == [a.precondition for a in domain.actions]
    assert [a.body for a in again.axioms] == [a.body for a in domain.axioms]
    assert to_text(domain, learned.policy, doubtful(learned.policy, learned.task.folder)) == learned.domain_pddl
    for ours, read in zip(domain.actions, again.actions, strict=True):
        for one, two in zip(ours.effects, read.effects, strict=True):
            assert replace(one, condition=TRUE) == replace(two, condition=TRUE)
            assert conjuncts(one.condition) == conjuncts(two.condition)
    Program.of(again)  # stratified


def test_the_comments_tell_the_features(learned: Learned) -> None:
    for feature in learned.policy.features:
        assert f"; {feature.name} ({feature.kind}): {feature.text}\n" in learned.domain_pddl
    assert "#" not in learned.domain_pddl


def test_the_written_problem_is_read_by_the_translator(case: Case, tmp_path: Path) -> None:
    goal = And((case.task.goal, Atom("ready", ())))
    texts = write_problem(case.constrained, case.instance.base, case.instance.state, goal)
    for name, text in zip(("domain.pddl", "problem.pddl"), texts, strict=True):
        (tmp_path / name).write_text(text)
    translate(tmp_path)


def test_the_bundles_domain_is_read_by_the_translator(learned: Learned, tmp_path: Path) -> None:
    """Other PDDLStream planners get this text, with no help from our writer."""
    (tmp_path / "domain.pddl").write_text(learned.domain_pddl)
    name = parse_domain(learned.domain_pddl).name
    (tmp_path / "problem.pddl").write_text(
        f"(define (problem p) (:domain {name}) (:objects a w g) (:init (handempty) (movable a) (grasp a g)"
        " (atpose a w)) (:goal (ready)))"
    )
    translate(tmp_path)


def translate(folder: Path) -> None:
    command = [sys.executable, "-m", "fast_downward.translate", "domain.pddl", "problem.pddl"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (folder / "output.sas").stat().st_size > 100


# ---- Steps of the constrained domain are the policy's, and the other way round


def checked(case: Case, state: State) -> list[State]:
    """What the `check` actions make of a state of the constrained domain."""
    view = View(case.constrained, case.instance.base, state)
    return [apply(view, step) for step in applicable(view) if original_step(step) is None]


def test_constrained_steps_are_policy_steps(case: Case) -> None:
    """Breadth first over all reachable states, up to a bound; both directions in each."""
    (start,) = checked(case, case.instance.state)
    todo, seen, steps = [start], {start}, 0
    while todo and steps < 60:
        state = todo.pop(0)
        plain = fluents(case, state)
        was = {(f"was-{name}", *row) for name, rows in extensions(case, plain).items() for row in rows}
        assert {fact for fact in state if fact[0].startswith("was-")} == was
        assert ("ready",) in state and not any(fact[0].startswith("pending") for fact in state)
        view = View(case.constrained, case.instance.base, state)
        found: set[tuple[Step, State]] = set()
        for step in applicable(view):
            own = original_step(step)
            assert own is not None
            after = apply(view, step)
            assert ("ready",) not in after
            for final in checked(case, after):
                found.add((own, fluents(case, final)))
                steps += 1
                if final not in seen:
                    seen.add(final)
                    todo.append(final)
        assert found == set(policy_steps(case, plain))
    assert steps > 3


def test_nothing_happens_before_the_first_check(case: Case) -> None:
    view = View(case.constrained, case.instance.base, case.instance.state)
    assert [step.schema for step in applicable(view)] == ["check--start"]


def test_a_refused_step_is_a_dead_end(case: Case) -> None:
    """Some step of an allowed schema has another effect; after it, no check can follow."""
    (start,) = checked(case, case.instance.state)
    view = View(case.constrained, case.instance.base, start)
    allowed = {step for step, _ in policy_steps(case, case.instance.state)}
    refused = [s for s in applicable(view) if original_step(s) not in allowed]
    for step in refused:
        after = apply(view, step)
        assert checked(case, after) == []
        assert list(applicable(View(case.constrained, case.instance.base, after))) == []
    if case.task.name == "unstack":
        return
    assert allowed


# ---- The same of the paper's own encoding, and whole plans of both


def ordered(case: Case) -> Program:
    policy, folder = case.policy, case.task.folder
    return Program.of(constrained_domain(policy, folder, sorts_of(policy), "order"))


def look(case: Case, state: State) -> tuple[bool, ...]:
    return tuple(bool(rows) for rows in extensions(case, state).values())


def order_steps(case: Case, state: State) -> Iterator[tuple[Step, State]]:
    """Algorithm 2: any step from where a rule applies to where one of its edges leads."""
    rule = case.policy.rule_for(look(case, state))
    if rule is not None:
        view = View(case.original, case.instance.base, state)
        for step in applicable(view):
            successor = apply(view, step)
            if look(case, successor) in rule.outcomes:
                yield step, successor


@pytest.mark.parametrize("encoding", ["check", "order"])
def test_plans_of_the_constrained_domain_are_those_that_follow_the_policy(case: Case, encoding: str) -> None:
    """Algorithm 2 also wants to end in an abstract goal; no plan of these problems ends elsewhere."""
    program, follow = {"check": (case.constrained, policy_steps), "order": (ordered(case), order_steps)}[encoding]
    depth = {"3": 4, "4": 4, "1-2": 3, "2-2": 5}[case.instance.size]
    wanted = set(plans_by(case, follow, case.instance.state, depth))
    assert wanted and set(plans_in(case, program, case.instance.state, depth)) == wanted


def test_the_papers_encoding_copies_every_action_for_every_edge(load: Learned) -> None:
    names = {"check": set(), "order": set()}
    for encoding, found in names.items():
        domain = constrained_domain(load.policy, load.task.folder, sorts_of(load.policy), encoding)
        found |= {action.name for action in domain.actions}
    edges = sum(len(rule.outcomes) for rule in load.policy.rules)
    schemas = len(load.task.folder.domain.actions)
    assert len([name for name in names["order"] if not name.startswith("check")]) == edges * schemas
    assert len([name for name in names["check"] if not name.startswith("check")]) == len(load.policy.actions)


def test_features_that_read_tests_are_marked(unstack: Learned, load: Learned) -> None:
    assert doubtful(unstack.policy, unstack.task.folder) == {}
    assert "optimistic" not in unstack.domain_pddl
    marks = doubtful(load.policy, load.task.folder)
    assert set(map(tuple, marks.values())) == {("cfree",)}
    (name,) = marks
    feature = next(f for f in load.policy.features if f.name == name)
    assert f"; {name} (numeric): {feature.text}\n;   reads tests (CFree): use an incremental" in load.domain_pddl


# ---- Planning in it


def test_plans_of_the_constrained_domain_execute_in_the_original(case: Case) -> None:
    task, instance = case.task, case.instance
    goal = And((task.goal, Atom("ready", ())))
    found = solve_incremental(
        case.constrained, instance.base, instance.state, goal, quota=task.file.samples, time_limit=60, max_levels=3
    )
    assert found[0].schema == "check--start"
    steps = [step for step in map(original_step, found) if step is not None]
    states = simulate(case.original, instance.base, instance.state, steps)
    assert states is not None
    assert View(case.original, instance.base, states[-1]).holds(task.goal)
    for step, before, after in zip(steps, states, states[1:], strict=False):
        assert (step, after) in set(policy_steps(case, before))


def test_original_step() -> None:
    assert original_step(Step("pick--a1", ("b", "p"))) == Step("pick", ("b", "p"))
    assert original_step(Step("check--a1", ())) is None
    assert original_step(Step("check--start", ())) is None


def test_features_over_sorts_can_be_planned_with(unstack: Learned) -> None:
    """A feature that needs a sort's guard: its sort predicate is derived and may not also be stated."""
    task = unstack.task
    lying = Feature("f1", "numeric", 3, "neg(some(v1,o,conj(on(v0,v1),table(v1))))", "v0", "o", "")
    holding = Feature("f2", "boolean", 1, "holding(v0)", "v0", "o", "")
    policy = replace(
        unstack.policy,
        features=(lying, holding),
        actions=(
            AbstractAction("a1", {}, {"f2": "true"}, ("pick",)),
            AbstractAction("a2", {}, {"f1": "decrease", "f2": "false"}, ("place",)),
        ),
        rules=(Rule((True, False), "a1", ()), Rule((True, True), "a2", ())),
    )
    domain = constrained_domain(policy, task.folder, sorts_of(policy))
    assert "sort-o" in {axiom.head.predicate for axiom in domain.axioms}
    instance = task.instance("4", 3, robot="gripper")
    goal = And((task.goal, Atom("ready", ())))
    plan = solve_incremental(
        Program.of(domain), instance.base, instance.state, goal, quota=task.file.samples, time_limit=60, max_levels=2
    )
    assert [s.schema for s in plan if original_step(s)] == ["pick--a1", "place--a2"] * (len(plan) // 4)


def test_sort_predicates_mean_the_same_in_both(learned: Learned) -> None:
    """Derived in the constrained domain, recorded by the fact base."""
    policy = replace(
        learned.policy,
        features=tuple(
            Feature(f"f{i}", "numeric", 1, "neg(holding(v0))" if sort == "o" else "neg(flag)", "v0", sort)
            for i, sort in enumerate(("o", "w", "g", "t"))
        ),
        actions=(),
        rules=(),
    )
    domain = constrained_domain(policy, learned.task.folder, sorts_of(policy))
    size = {"unstack": "3", "load": "1-2"}[learned.task.name]
    instance = Task.load(learned.task.name).instance(size, 1, robot="gripper")
    sample(instance.base, QUOTA, FAR)
    run_tests(instance.base, FAR)
    facts: dict[str, list[Fact]] = {s: [] for s in ("o", "w", "g", "t")}
    view = View(Program.of(domain), instance.base, instance.state)
    for sort in facts:
        assert {row[0] for row in view.extension(f"sort-{sort}")} == set(instance.base.entities(sort)) != set()


def test_a_policy_planned_in_its_domain_solves_the_task(unstack: Learned, monkeypatch) -> None:
    from gentamp_lp.planning import guided

    def fail(*_: object, **__: object) -> None:
        raise guided.DeadEnd("not today")

    monkeypatch.setattr(guided.GuidedPlanner, "solve", fail)
    result = solve(unstack.task, "5", 1, policy=unstack.policy, robot="gripper", time_limit=60)
    assert result.valid and result.planner == "constrained domain"
