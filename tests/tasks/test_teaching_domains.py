"""The numbered domains of docs/examples/06-own-domain: learned on small problems, right on larger ones."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gentamp_lp.geometry.transforms import pose
from gentamp_lp.learning.learn import learn
from gentamp_lp.planning.solve import Solved, solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.domain_code import COMPULSORY
from gentamp_lp.tasks.task import Task

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples" / "06-own-domain"
BELT, SHELF, PALLET = "01-belt/sort", "02-shelf/pack", "03-pallet/pack"


@cache
def loaded(name: str) -> Task:
    return Task.load(EXAMPLES / f"{name}.yaml", trust=True)


@cache
def policy(name: str) -> Policy:
    learned = learn(loaded(name), cache=False)
    assert not learned.notes and learned.solution.optimal
    return learned.policy


@cache
def solved(name: str, size: str, seed: int, robot: str | None = None) -> Solved:
    result = solve(loaded(name), size, seed, policy=policy(name), robot=robot)
    assert result.valid, result.problems or result.reason
    assert result.plan is not None and result.planner == "guided"
    return result


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("name", "size"), [(BELT, "40"), (SHELF, "12"), (PALLET, "10")])
def test_a_policy_from_small_problems_solves_larger_ones(tmp_path: Path, name: str, size: str, seed: int) -> None:
    plan = solved(name, size, seed).plan
    plan.save(tmp_path / "plan.json")
    assert validate(Plan.load(tmp_path / "plan.json"), loaded(name)) == []


def test_the_smallest_domain_is_small() -> None:
    """At most 60 lines of Python, and nothing beyond what is compulsory."""
    task = loaded(BELT)
    assert sum(len(path.read_text().splitlines()) for path in task.folder.path.rglob("*.py")) <= 60
    given = set(vars(task.folder.code)) - {"module"}
    assert given == set(COMPULSORY) and solved(BELT, "4", 0).plan.robot == "none"


def test_parcels_end_in_the_bin_for_their_width() -> None:
    """As few changes as there are bins to fill, and each parcel where it belongs."""
    result = solved(BELT, "40", 1)
    world, steps = result.instance.world, result.plan.steps
    dropped = {args[0]: args[1] for args in (step.args for step in steps if step.schema == "drop")}
    assert dropped.keys() == world.widths.keys()
    assert all(np.searchsorted([0.1, 0.2], world.widths[p], "right") + 1 == int(b[3:]) for p, b in dropped.items())
    assert len(steps) - len(dropped) <= 2


def checked(name: str, edit: Callable[[dict[str, Any], Any], None]) -> list[str]:
    """What the domain's own check says of a plan of four with values changed."""
    result = solved(name, "4", 1)
    values = dict(result.instance.base.values)
    edit(values, [step.args for step in result.plan.steps if step.schema in ("put", "place")])
    steps = [(step.schema, step.args) for step in result.plan.steps]
    return loaded(name).folder.code.check_plan(result.instance.world, steps, values)


def test_the_shelf_sees_boxes_that_overlap_or_stick_out() -> None:
    def together(values: dict[str, Any], puts: Any) -> None:
        values[puts[0][1]] = values[puts[1][1]]

    def beyond(values: dict[str, Any], puts: Any) -> None:
        values[puts[0][1]] = type(values[puts[0][1]])(-0.5)

    assert checked(SHELF, lambda values, puts: None) == []
    assert any("overlap" in problem for problem in checked(SHELF, together))
    assert any("beyond the shelf" in problem for problem in checked(SHELF, beyond))


def test_the_pallet_is_replayed_independently() -> None:
    def together(values: dict[str, Any], places: Any) -> None:
        for index in (1, 2):
            values[places[0][index]] = values[places[1][index]]

    def elsewhere(values: dict[str, Any], places: Any) -> None:
        values[places[0][1]] = pose(0.0, 0.3) @ values[places[0][1]]

    assert checked(PALLET, lambda values, places: None) == []
    assert any("inside" in problem for problem in checked(PALLET, together))
    assert any("off" in problem for problem in checked(PALLET, elsewhere))


def test_the_pallet_serves_an_arm() -> None:
    assert solved(PALLET, "5", 2, "panda").plan.robot == "panda"


@pytest.mark.parametrize("suffix", [".png", pytest.param(".gif", marks=pytest.mark.slow)])
def test_the_pallet_is_drawn(tmp_path: Path, suffix: str) -> None:
    result, path = solved(PALLET, "2", 0), tmp_path / f"plan{suffix}"
    steps = [(step.schema, step.args) for step in result.plan.steps]
    loaded(PALLET).folder.code.render_plan(result.instance.world, steps, result.instance.base.values, path)
    assert path.stat().st_size > 5000
