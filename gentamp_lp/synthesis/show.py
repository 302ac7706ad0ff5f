"""A synthesised policy for people, and as the document of `--json`."""

from __future__ import annotations

from typing import Any

from gentamp_lp.base.documents import Document
from gentamp_lp.base.fairness import Fairness
from gentamp_lp.synthesis.solving import Synthesis


class Decision(Document):
    """What the policy does in a state."""

    state: str
    action: str


class ProblemSize(Document):
    """How large the problem was."""

    states: int
    choices: int


class SynthesisReport(Document):
    """What `synthesize --json` prints."""

    solvable: bool | None
    """null if a limit came first"""
    fairness: Fairness
    policy: list[Decision]
    states: int
    """states in which the policy acts"""
    optimal: bool
    """no policy has fewer states (`--minimize`)"""
    bound: int
    problem: ProblemSize
    seconds: float
    statistics: dict[str, int]
    reason: str | None = None
    """why there is no policy"""


def report(found: Synthesis, reason: str | None = None) -> dict[str, Any]:
    """Return the JSON document of `gentamp-lp synthesize`."""
    name = found.problem.states
    document = SynthesisReport.model_validate(
        {
            "solvable": found.solvable,
            "fairness": found.fairness,
            "policy": [{"state": name[state], "action": choice.action} for state, choice in found.policy.items()],
            "states": len(found.policy),
            "optimal": found.optimal,
            "bound": found.bound,
            "problem": {"states": len(name), "choices": len(found.problem.choices)},
            "seconds": round(found.seconds, 3),
            "statistics": found.statistics,
            **({} if reason is None else {"reason": reason}),
        }
    )
    return document.model_dump(mode="json", exclude_unset=True)


def text(found: Synthesis) -> str:
    """Return the policy with its outcomes, and why it ends."""
    problem = found.problem
    name = problem.states
    lines = ["Policy"]
    for state, choice in found.policy.items():
        lines.append(f"  {name[state]}  do {choice.action}{'  (initial)' if state in problem.initial else ''}")
        for after in choice.outcomes:
            lines.append(f"      to {name[after]}{'  (goal)' if after in problem.goals else ''}")
    if found.cuts:
        lines += ["", "Why it ends"]
    for number, cut in enumerate(found.cuts, 1):
        constraint, states = problem.constraints[cut.variable], f"{len(cut.nodes)} state(s)"
        if problem.numeric:
            lines.append(f"  {number}. {constraint} falls and never rises among {states}")
        else:
            lines.append(f"  {number}. among {states} actions of con_A({constraint}) are fair, and may leave")
    return "\n".join([*lines, "", _summary(found)])


def _summary(found: Synthesis) -> str:
    size = f"{len(found.policy)} policy states"
    proof = " (proved minimal)" if found.optimal else f" (at least {found.bound})" if found.bound else ""
    total = f"{len(found.problem.states)} states, {len(found.problem.choices)} choices"
    return f"fairness {found.fairness}, {size}{proof}; {total}, {found.seconds:.2f} s"
