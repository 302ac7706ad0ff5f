"""Guided planning follows the policy to valid plans, and says why when it cannot."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.pace import at_most

from gentamp_lp.errors import LimitReached
from gentamp_lp.features.values import matches_effects, valuation
from gentamp_lp.learning.learn import Learned
from gentamp_lp.planning.guided import DeadEnd, GuidedPlanner, GuidedResult
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.semantics import View, apply, precondition_holds
from gentamp_lp.tasks.task import Instance, Task

SIZES = {"unstack": ["2", "5", "9"], "load": ["1-2", "2-2", "3-5", "4"]}


def follow(learned: Learned, size: str, seed: int, robot: str) -> tuple[GuidedPlanner, Instance, GuidedResult]:
    instance = learned.task.instance(size, seed, robot=robot)
    planner = GuidedPlanner(learned.policy, instance)
    return planner, instance, planner.solve(time_limit=60)


@pytest.mark.parametrize("robot", ["gripper", "panda"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_plans_are_valid_and_each_step_is_the_policys(learned: Learned, seed: int, robot: str) -> None:
    policy = learned.policy
    for size in SIZES[learned.task.name]:
        planner, instance, result = follow(learned, size, seed, robot)
        assert validate(Plan.of(instance, result.steps), learned.task) == []
        assert len(result.steps) == len(result.abstract) == len(result.states) - 1
        assert result.states[0] == instance.state
        for step, name, state, after in zip(
            result.steps, result.abstract, result.states, result.states[1:], strict=False
        ):
            view = View(planner.program, instance.base, state)
            assert precondition_holds(view, step)
            assert apply(view, step) == after
            assert not view.holds(learned.task.goal)
            values, values_after = (
                planner.features.values(view),
                planner.features.values(View(planner.program, instance.base, after)),
            )
            rule = policy.rule_for(valuation(values))
            assert rule is not None and rule.action == name
            action = policy.action(name)
            assert step.schema in action.schemas
            assert matches_effects(action.effects, planner.outcomes.kinds, values, values_after)
            assert all(valuation(values)[f] == positive for f, positive in action.preconditions.items())
        assert View(planner.program, instance.base, result.states[-1]).holds(learned.task.goal)


def test_the_goal_may_hold_from_the_start(unstack: Learned) -> None:
    result = solve(unstack.task, 1, 0, policy=unstack.policy)
    assert result.valid and result.plan is not None
    assert (result.plan.steps, result.plan.entities, result.plan.facts) == ((), {}, ())
    assert validate(Plan.of(result.instance, ()), unstack.task) == []


def without(learned: Learned, index: int) -> Learned:
    rules = learned.policy.rules
    return replace(learned, policy=replace(learned.policy, rules=(*rules[:index], *rules[index + 1 :])))


def test_a_state_without_a_rule_is_named(learned: Learned) -> None:
    """Without the first rule, there is nothing to do in the initial state."""
    with pytest.raises(DeadEnd, match="no rule for the abstract state f1=0, ") as caught:
        follow(without(learned, 0), learned.task.file.train[0], 0, "gripper")
    assert caught.value.path == [caught.value.state]
    assert str(caught.value) == caught.value.reason


def test_a_state_without_a_rule_on_the_way_is_named(learned: Learned) -> None:
    """Without the second rule, the first one leads out of the policy."""
    size = {"unstack": "6", "load": "2-4"}[learned.task.name]
    with pytest.raises(DeadEnd, match=r"no concrete step carries out .* there is none for f1=1, ") as caught:
        follow(without(learned, 1), size, 0, "gripper")
    assert caught.value.path[-1] == caught.value.state


def test_the_abstract_state_is_told_in_the_report(unstack: Learned) -> None:
    """Planning then turns to the constrained domain, which has no plan either."""
    broken = without(unstack, 0)
    told: list[str] = []
    result = solve(broken.task, 6, 1, policy=broken.policy, robot="gripper", progress=told.append)
    assert not result.valid and result.plan is None and not result.limited
    assert "no rule for the abstract state f1=0" in str(result.reason)
    assert any("searching the constrained domain" in line for line in told)
    report = result.report()
    assert (report["solved"], report["plan"], report["reason"]) == (False, None, result.reason)


def test_an_action_that_cannot_be_done_is_named(unstack: Learned) -> None:
    """The policy asks to place where only picking is possible."""
    action = unstack.policy.action("a1")
    impossible = replace(action, schemas=("place",))
    actions = tuple(impossible if a.name == "a1" else a for a in unstack.policy.actions)
    broken = replace(unstack, policy=replace(unstack.policy, actions=actions))
    with pytest.raises(DeadEnd, match=r"no concrete step carries out abstract action a1 .* f1=0, f2=\d+$"):
        follow(broken, "6", 1, "gripper")


@pytest.mark.parametrize("limit", [0.0, 1e-6, 0.02])
def test_time_limit(unstack: Learned, limit: float) -> None:
    instance = unstack.task.instance(12, 1, robot="panda")
    with pytest.raises(LimitReached, match="time limit"):
        GuidedPlanner(unstack.policy, instance).solve(time_limit=limit)
    with at_most(1.05 * limit, starts=200):
        result = solve(unstack.task, 12, 1, policy=unstack.policy, time_limit=limit)
    assert result.limited and result.plan is None and "time limit" in str(result.reason)


def test_unguided_planning_is_valid_and_limited_too(unstack: Learned) -> None:
    result = solve(unstack.task, 3, 1, robot="gripper", time_limit=30)
    assert (result.mode, result.planner) == ("unguided", "adaptive") and result.valid
    result = solve(unstack.task, 8, 1, robot="gripper", time_limit=1e-3)
    assert result.limited and not result.valid


def test_a_policy_without_progress_is_rescued_by_the_constrained_domain(load: Learned, monkeypatch) -> None:
    def give_up(*_: object, **__: object) -> None:
        raise DeadEnd("told to give up")

    monkeypatch.setattr(GuidedPlanner, "solve", give_up)
    result = solve(load.task, "1-2", 1, policy=load.policy, robot="gripper", time_limit=60)
    assert result.valid and result.planner == "constrained domain"
    assert result.plan is not None and {s.schema for s in result.plan.steps} <= {"pick", "place"}


PROGRAM = """
import json, sys
from gentamp_lp.planning.solve import solve
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task
for task, size, robot in (("unstack", "7", "panda"), ("load", "2-4", "gripper")):
    result = solve(Task.load(task), size, 4, policy=Policy.load(f"{sys.argv[1]}/{task}"), robot=robot)
    print(json.dumps(result.plan.to_json()))
"""


def test_a_seed_gives_the_same_plan_everywhere(unstack: Learned, load: Learned, tmp_path) -> None:
    unstack.save(tmp_path / "unstack")
    load.save(tmp_path / "load")
    texts = []
    for hash_seed in ("1", "77"):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(tmp_path)],
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr
        texts.append(done.stdout)
    assert texts[0] == texts[1]
    plans = [json.loads(line) for line in texts[0].splitlines()]
    assert all(plan["steps"] for plan in plans)
    again = solve(Task.load("load"), "2-4", 4, policy=load.policy, robot="gripper").plan
    assert again is not None and again.to_json() == plans[1]


def test_calls_whose_outputs_cannot_have_the_effect_are_not_made(load: Learned) -> None:
    """The policy puts things on the tray: a place on the table is tried once for a thing, not sampled for more."""
    _, instance, result = follow(load, "3-8", 1, "gripper")
    stream = next(s for s in instance.base.streams if s.name == "sample-placement")
    drawn = [instance.base.drawn(stream, inputs) for inputs in instance.base.inputs(stream)]
    assert result.steps and max(drawn) <= instance.task.file.samples["sample-placement"] + 1


def test_few_tests_answer_a_question_about_all_places(load: Learned) -> None:
    """What no step needs to know is not tested: a fraction of all pairs of a place and a thing that stands."""
    planner, instance, result = follow(load, "3-12", 1, "gripper")
    places, things = len(instance.base.relation("stand")), 13
    assert instance.base.statistics["test-cfree"].calls < places * things
    assert result.backtracks <= 3
    values = planner.features.values(View(planner.program, instance.base, result.states[-1]))
    assert planner.outcomes.values.counts() == values


POLICIES = Path(__file__).parents[1] / "policies"


def test_places_are_sampled_when_they_are_asked_for() -> None:
    """What stands somewhere stands in a place that is known: features that say so need no samples beforehand."""
    task = Task.load("sort")
    instance = task.instance("8-8", 0)
    GuidedPlanner(Policy.load(POLICIES / "sort"), instance).solve(time_limit=60)
    supports = len(instance.base.relation("surface"))
    assert instance.base.statistics["sample-placement"].calls <= 16 * supports < 16 * supports * 3


def test_only_what_is_in_the_way_is_looked_at() -> None:
    """A pick must take something out of what is in the way, or take the mug: nothing else is grasped."""
    instance = Task.load("clutter").instance("16", 0, robot="gripper")
    result = GuidedPlanner(Policy.load(POLICIES / "clutter"), instance).solve(time_limit=60)
    picks = sum(step.schema == "pick" for step in result.steps)
    assert instance.base.statistics["sample-grasp"].calls <= 2 * picks < 16


@pytest.mark.parametrize("seed", range(3))
def test_a_step_that_ends_at_a_goal_is_tried_first(seed: int) -> None:
    """The policy's "pick" may be of a thing or of the tray: it is of the tray when that is all that is missing."""
    instance = Task.load("load").instance("2-5", seed)
    result = GuidedPlanner(Policy.load(POLICIES / "load"), instance).solve(time_limit=60)
    assert result.backtracks == 0
    assert [step.schema for step in result.steps] == ["pick", "place", "pick", "place", "pick"]


def test_steps_back_are_not_evaluated(unstack: Learned, monkeypatch) -> None:
    """What was put down last is the first candidate; to pick it up again leads nowhere new, and says nothing more."""
    instance = Task.load("unstack").instance("8", 0, robot="gripper")
    planner, been = GuidedPlanner(unstack.policy, instance), set()
    outcome = planner.outcomes.of

    def noted(state, added, deleted, *rest):
        been.add(state)
        assert (state - frozenset(deleted)) | frozenset(added) not in been
        return outcome(state, added, deleted, *rest)

    monkeypatch.setattr(planner.outcomes, "of", noted)
    result = planner.solve(time_limit=60)
    assert been == set(result.states[:-1])


def test_a_crowded_table_is_rearranged(unstack: Learned, tmp_path) -> None:
    """Ten blocks of 5 cm, and fingers between them, on a table of 18 by 20 cm: undoing steps in turn takes minutes."""
    text = (Path(__file__).parents[2] / "tasks" / "unstack.yaml").read_text(encoding="utf-8")
    crowded = "table: {area: {x: [0.40, 0.58], y: [-0.10, 0.10]}}"
    (tmp_path / "crowded.yaml").write_text(re.sub(r"table: \{area: .*", crowded, text), encoding="utf-8")
    task = Task.load(str(tmp_path / "crowded.yaml"))
    instance = task.instance("10", 0, robot="gripper")
    result = GuidedPlanner(unstack.policy, instance).solve(time_limit=60)
    assert validate(Plan.of(instance, result.steps), task) == []
    assert result.rounds == 2 and result.backtracks > 30  # the second round repairs


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size", ["2-32", "2-64"])
def test_transport_beyond_the_papers_sizes(size: str, seed: int) -> None:
    policy = Policy.load(POLICIES / "transport")
    result = solve(Task.load("transport"), size, seed, policy=policy, time_limit=120)
    assert result.valid and result.planner == "guided"
