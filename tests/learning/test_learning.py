"""Learning as a loop: what fails one size above training is learned from."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gentamp_lp import solve
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.learning import rollouts
from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.tasks.task import Task


@pytest.fixture(scope="module")
def refined(tmp_path_factory: pytest.TempPathFactory) -> Learned:
    """Two training problems do not show how things on the table and free places matter together."""
    text = resource("tasks", "load.yaml").read_text(encoding="utf-8")
    path = tmp_path_factory.mktemp("few") / "load.yaml"
    path.write_text(re.sub(r"(?m)^train: .*", "train: [3-1, 1-2]", text))
    return learn(Task.load(path), max_complexity=3, cache=False)


def test_a_policy_that_fails_one_size_above_is_replaced(refined: Learned) -> None:
    assert refined.report()["validation"] == ["4-2", "3-3"]
    assert refined.rounds >= 1
    assert all(re.match("load-(4-2|3-3): ", note) for note in refined.notes) and refined.notes
    assert len(refined.dataset.problems) > len(refined.task.file.train)
    assert refined.solution.optimal and refined.policy.check() == []


def test_its_refinement_sees_no_more_samples_than_its_demonstrations(refined: Learned) -> None:
    """One reach for each grasp and place, twice as many of all where a plan needs it; roll-outs try sixteen times."""
    samples = refined.task.file.samples
    for problem in refined.dataset.problems:
        capacity, things = map(int, problem.size.split("-"))
        places = (things + 1) * (1 + samples["sample-placement"] + min(capacity, samples["sample-cell"]))
        assert len(problem.entities["t"]) <= 4 * places * samples["sample-grasp"]


@pytest.mark.parametrize(("size", "seed"), [("3-6", 0), ("2-7", 1), ("5-4", 2), ("4-8", 3)])
def test_the_new_policy_solves_other_sizes(refined: Learned, size: str, seed: int) -> None:
    result = solve(refined.task, size, seed, policy=refined.policy)
    assert result.valid and result.report()["planner"] == "guided"


def test_a_roll_out_that_takes_too_long_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rollouts, "_SECONDS", 0.0)
    monkeypatch.setattr("gentamp_lp.planning.guided.GuidedPlanner._check_time", out_of_time)
    learned = learn(Task.load("unstack"), max_complexity=3)
    assert learned.rounds == 0
    assert learned.notes == tuple(f"unstack-{size}: the roll-out was not finished within 1 s" for size in (8, 9))


def out_of_time(_: object) -> None:
    raise LimitReached("the time limit ended guided planning")


# ---- A distractor: half of the things are blue, which has nothing to do with the task


def half_blue(name: str, train: str, tmp_path: Path) -> Task:
    text = resource("tasks", f"{name}.yaml").read_text(encoding="utf-8")
    before, rest = text.split("    - name: thing\n" if name == "load" else "    - name: block\n")
    group, after = rest.split("\ngoal:")
    blue = group.replace("is: [Block]", "is: [Block, Blue]") if name == "unstack" else f"      is: [Blue]\n{group}"
    kind = "thing" if name == "load" else "block"
    text = f"{before}    - name: {kind}\n{group}    - name: blue_{kind}\n{blue}\ngoal:{after}"
    lines = [f"train: [{train}]" if line.startswith("train:") else line for line in text.splitlines()]
    path = tmp_path / f"{name}.yaml"
    path.write_text("\n".join(line for line in lines if not line.startswith("test:")) + "\n")
    return Task.load(path)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("name", "train"), [("unstack", "4"), ("load", "3-1, 2-2, 4-2, 1-1")])
def test_a_distractor_does_not_enter_the_policy(name: str, train: str, seed: int, tmp_path: Path) -> None:
    """Which of several like things a demonstration takes first is random, so that their looks explain nothing."""
    learned = learn(half_blue(name, train, tmp_path), seed=seed, max_complexity=3, cache=False)
    assert any("blue(" in formula for formula in learned.pool.formulas.values())
    assert not any("blue(" in feature.formula for feature in learned.policy.features)
    assert learned.solution.optimal


@pytest.mark.parametrize("task, complexity", [("load", 1), ("clutter", 2), ("transport", 2)])
def test_no_policy_is_explained_with_concrete_states(task, complexity):
    """Goals that no feature separates; like states with moves that differ. The culprits are named, with a remedy."""
    with pytest.raises(NoAnswer) as error:
        learn(Task.load(task), max_complexity=complexity)
    golden = Path(__file__).parents[1] / "golden" / f"no-policy-{task}.txt"
    assert str(error.value) + "\n" == golden.read_text(encoding="utf-8")
    assert len(str(error.value).splitlines()) <= 12
