"""What the documentation shows to users works: a task and a robot of their own."""

from pathlib import Path

from gentamp_lp.learning.learn import learn
from gentamp_lp.planning.solve import solve
from gentamp_lp.tasks.task import Task

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def test_the_sixth_task_is_learned_on_the_users_own_robot() -> None:
    """Both halves of `docs/tasks.md` and `docs/robots.md`: half.yaml and arm.yaml."""
    task = Task.load(EXAMPLES / "03-own-task" / "half.yaml")
    learned = learn(task, robot="gripper", max_complexity=3, cache=False)
    assert learned.solution.optimal and not learned.notes
    assert [f.text for f in learned.policy.features] == ["Holding(x)", "∃y On(x,y) ∧ ¬Blue(y)"]
    for robot in ("panda", str(EXAMPLES / "04-own-robot" / "arm.yaml"), "mobile_panda"):
        result = solve(task, "4-2", 1, policy=learned.policy, robot=robot)
        assert result.valid and result.planner == "guided" and result.plan is not None
        assert len(result.plan.steps) == 8 and result.plan.robot == robot


def test_the_page_shows_the_file() -> None:
    """docs/tasks.md quotes half.yaml, docs/robots.md quotes arm.yaml."""
    page = (EXAMPLES.parent / "tasks.md").read_text()
    for line in (EXAMPLES / "03-own-task" / "half.yaml").read_text().splitlines():
        assert line.startswith("#") or line.strip() in page
