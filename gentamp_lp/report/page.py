"""The report page: a policy, its demonstrations and perhaps a plan as one HTML file that needs no network.

The page is `assets/report.html` with its style and script and one JSON value. Its script writes that value as text
only, and its content security policy forbids every request, so nothing from a task file can become code.
"""

from __future__ import annotations

import json
from pathlib import Path
from string import Template
from typing import Any

from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.demonstrations.demonstrate import Progress, demonstrate
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.explaining.what_it_does import ExplainedState, explain, purpose, retrace, trace
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import adopt, validate
from gentamp_lp.policy.drawing import draw
from gentamp_lp.policy.learn_report import read_report
from gentamp_lp.policy.policy import Policy
from gentamp_lp.report.document import PageData
from gentamp_lp.tasks.domain_folder import running
from gentamp_lp.tasks.task import Task

_PAGE = Path(__file__).parent / "assets"
_NUMBERS = ("states", "transitions", "problems", "pool_size", "complexity", "proved_complexity", "refinement_rounds")


def report(
    policy: Policy, folder: Path, task: Task, plan: Plan | None = None, *, cache: bool = True,
    time_limit: float = 600.0, progress: Progress = lambda _: None,
) -> PageData:  # fmt: skip
    """What the page shows.

    The demonstrations come from the cache, or are planned again with the bundle's settings. Raises InputError for a
    plan of another task or one that is not valid, and what `demonstrate` raises.
    """
    if task.name != policy.task:
        what = "task" if plan is None else "plan"
        raise InputError(Diagnostic(f"the {what} is for task `{task.name}`, the policy for `{policy.task}`", folder))
    learned = read_report(folder)
    settings = learned.get("settings", {})
    seed, robot, around = settings.get("seed", 0), settings.get("robot"), settings.get("around", True)
    data = demonstrate(
        task, seed=seed, robot=robot, around=around, cache=cache, time_limit=time_limit, progress=progress
    )
    progress("evaluating the features along the demonstrations")
    runs = [
        _run(f"Demonstration {number}: size {problem.size}, seed {problem.seed}", states)
        for number, (problem, states) in enumerate(zip(data.problems, retrace(policy, data, task), strict=True), 1)
    ]
    if plan is not None:
        runs.insert(0, _planned(policy, task, plan, progress))
    return PageData.model_validate(
        {
            "task": policy.task,
            "description": task.file.description,
            "goal": " ".join(task.file.goal.split()),
            "proof": f"cost {policy.cost}, "
            + ("proved optimal" if policy.optimal else f"not proved optimal (at least {policy.bound})"),
            "fairness": policy.fairness,
            "graph": draw(policy, legend=False),
            "features": [vars(row) for row in explain(policy, folder)],
            "states": _states(policy),
            "ends": [
                {"feature": step.feature, "states": [policy.show(valuation) for valuation in step.states]}
                for step in policy.certificate
            ],
            "runs": runs,
            "numbers": {name: learned[name] for name in _NUMBERS if learned.get(name) is not None},
            "seconds": learned.get("seconds", {}),
            "pruning": learned.get("pruning", []),
            "notes": [*learned.get("notes", []), *_differs(data, learned)],
        }
    )


def page(data: dict[str, Any]) -> str:
    """The HTML file that shows what `report` collected, as JSON data."""
    parts = {name: (_PAGE / f"report.{name}").read_text(encoding="utf-8") for name in ("html", "css", "js")}
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    return Template(parts["html"]).substitute(style=parts["css"], script=parts["js"], data=text)


def _states(policy: Policy) -> list[dict[str, Any]]:
    """The abstract states in the order of the drawing's rules, then those without a rule."""
    rules = {rule.valuation: rule for rule in policy.rules}
    valuations = dict.fromkeys(
        [*rules, *(after for rule in policy.rules for after in rule.outcomes), *policy.initial, *policy.goals]
    )
    found = []
    for valuation in valuations:
        rule = rules.get(valuation)
        found.append(
            {
                "state": policy.show(valuation),
                "values": [f.show(value) for f, value in zip(policy.features, valuation, strict=True)],
                "initial": valuation in policy.initial,
                "goal": valuation in policy.goals,
                "does": purpose(policy, rule) if rule else "",
                "outcomes": [policy.show(after) for after in rule.outcomes] if rule else [],
            }
        )
    return found


def _run(title: str, states: list[ExplainedState], animation: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"title": title, "states": [vars(state) for state in states], "animation": animation}


def _planned(policy: Policy, task: Task, plan: Plan, progress: Progress) -> dict[str, Any]:
    """A plan, with its animation if the domain makes one."""
    progress(f"evaluating the features along the plan: {len(plan.steps)} steps")
    states = trace(policy, plan, task)
    progress("checking the plan")
    if problems := validate(plan, task):
        raise InputError(Diagnostic(f"the plan is not valid: {problems[0]}", hint="gentamp-lp validate says more"))
    title = f"Plan: size {plan.size}, seed {plan.seed}"
    animate = task.folder.code.animate_plan
    if animate is None:
        return _run(title, states)
    instance = task.instance(plan.size, plan.seed, robot=plan.robot)
    adopt(plan, instance)
    steps = [(step.schema, step.args) for step in plan.steps]
    progress("playing the plan")
    with running(task.folder, "animate_plan"):
        made = animate(instance.world, steps, instance.base.values, *plan.transit_args)
    camera = {"eye": made.camera.eye, "target": made.camera.target, "angle": made.camera.angle}
    return _run(title, states, {"viewer": made.viewer, "frames": made.frames, "camera": camera})


def _differs(data: Dataset, learned: Any) -> list[str]:
    """Say when other demonstrations were learned from than the ones shown."""
    seen = learned.get("states"), learned.get("transitions")
    if None in seen or seen == (len(data.states), len(data.transitions)):
        return []
    return [
        f"learned from {seen[0]} states and {seen[1]} transitions; the training plans shown here have "
        f"{len(data.states)} and {len(data.transitions)} (roll-outs or refinement added some, or the task has changed)"
    ]
