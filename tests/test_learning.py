"""Learning as a loop: what fails one size above training is learned from."""

from __future__ import annotations

import pytest

from gentamp_lp import solve
from gentamp_lp.learning import Learned, learn
from gentamp_lp.task import Task


@pytest.fixture(scope="module")
def refined() -> Learned:
    """With this seed, the cheapest policy of the training problems is a coincidence."""
    return learn(Task.load("load"), seed=9, max_complexity=3)


def test_a_policy_that_fails_one_size_above_is_replaced(refined: Learned) -> None:
    assert refined.rounds >= 1
    assert any("load-4-4" in note or "load-3-5" in note for note in refined.notes)
    assert refined.report()["validation"] == ["4-4", "3-5"]
    assert len(refined.dataset.problems) > len(refined.task.file.train)
    assert refined.solution.optimal and refined.policy.check() == []


def test_its_refinement_sees_no_more_samples_than_its_demonstrations(refined: Learned) -> None:
    first, *_ = refined.dataset.problems
    for problem in refined.dataset.problems[len(refined.task.file.train) :]:
        assert len(problem.entities["t"]) < 4 * len(first.entities["t"]) * int(problem.size.split("-")[1])


@pytest.mark.parametrize(("size", "seed"), [("3-6", 0), ("2-7", 1), ("5-4", 2), ("4-8", 3)])
def test_the_new_policy_solves_other_sizes(refined: Learned, size: str, seed: int) -> None:
    result = solve(refined.task, size, seed, policy=refined.policy)
    assert result.valid and result.report()["planner"] == "guided"
