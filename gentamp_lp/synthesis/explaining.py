"""Why a problem has no policy: an initial state at fault, and what stands in the way there."""

from __future__ import annotations

import time
from collections.abc import Container
from dataclasses import replace

from gentamp_lp.synthesis.problem import Choice, Problem
from gentamp_lp.synthesis.sieve import Edge, components, short_loops
from gentamp_lp.synthesis.solving import sieve_policy, synthesize

_SECONDS = 2.0  # for finding the initial state at fault
_SHOWN = 8
_ENDLESS = "only non-terminating ones"


def explain(problem: Problem, fairness: str) -> str:
    """Return the reason why there is no policy of this level, for people; the first line says it all."""
    hopeful = _hopeful(problem, dict.fromkeys(range(len(problem.states))))
    for state in problem.initial:
        if state not in hopeful:
            return _unreachable(problem, fairness, state)
    region = dict.fromkeys(hopeful)
    while (smaller := _hopeful(problem, region)) != set(region):
        region = dict.fromkeys(smaller)
    for state in problem.initial:
        if state not in region:
            return _trapped(problem, fairness, state, hopeful)
    return _endless(problem, fairness)


def _hopeful(problem: Problem, region: Container[int]) -> set[int]:
    """Return the states that can reach a goal by choices that do not leave the region."""
    back: dict[int, list[int]] = {}
    for choice in problem.choices:
        if choice.state in region and all(after in region for after in choice.outcomes):
            for after in choice.outcomes:
                back.setdefault(after, []).append(choice.state)
    found = {goal for goal in problem.goals if goal in region}
    waiting = list(found)
    while waiting:
        for state in back.get(waiting.pop(), ()):
            if state not in found:
                found.add(state)
                waiting.append(state)
    return found


def _head(problem: Problem, fairness: str, state: int, reason: str) -> str:
    return f"no {fairness} policy for the initial state `{problem.states[state]}`: {reason}"


def _unreachable(problem: Problem, fairness: str, start: int) -> str:
    own: dict[int, list[Choice]] = {}
    for choice in problem.choices:
        own.setdefault(choice.state, []).append(choice)
    seen = [start]
    for state in seen:
        seen += dict.fromkeys(a for choice in own.get(state, ()) for a in choice.outcomes if a not in seen)
    ends = [state for state in seen if state not in own]
    lines = [_head(problem, fairness, start, "the goal is unreachable")]
    lines.append(f"  {len(seen)} state(s) can be reached from it, none of them a goal")
    if ends:
        lines.append(f"  nothing can be done in: {problem.names(ends)}")
    return "\n".join(lines)


def _trapped(problem: Problem, fairness: str, start: int, hopeful: set[int]) -> str:
    traps = [state for state in range(len(problem.states)) if state not in hopeful]
    return "\n".join(
        [
            _head(problem, fairness, start, "no closed policy"),
            "  whatever it does, a run may come to a state from which no goal can be reached",
            f"  such states: {problem.names(traps)}",
        ]
    )


def _endless(problem: Problem, fairness: str) -> str:
    """Show an endless run of a strong cyclic policy from an initial state that has no better one."""
    subject, head = problem, f"no {fairness} policy for the initial states together: {_ENDLESS}"
    deadline = time.monotonic() + _SECONDS
    for state in problem.initial:
        alone = replace(problem, initial=(state,))
        left = max(deadline - time.monotonic(), 0.01)
        if len(problem.initial) == 1 or synthesize(alone, fairness=fairness, time_limit=left).solvable is False:
            subject, head = alone, _head(problem, fairness, state, _ENDLESS)
            break
        if time.monotonic() > deadline:
            break
    policy = synthesize(subject, fairness="strong-cyclic").policy
    if fairness == "strong":
        edges = [Edge(s, after) for s, choice in policy.items() for after in choice.outcomes if after in policy]
        loop = next((loop for part in components(edges) for loop in short_loops(part)), [])
    else:
        stuck = sieve_policy(policy).stuck
        loop = min((list(part) for part in stuck), key=len, default=[])
    nodes = list(dict.fromkeys(edge.source for edge in loop))
    lines = [
        head,
        "  strong-cyclic policies exist, but a run may stay for ever in a loop, for instance:",
    ]
    lines += [f"    {problem.states[node]}  do {policy[node].action}" for node in nodes[:_SHOWN]]
    if len(nodes) > _SHOWN:
        lines.append(f"    and {len(nodes) - _SHOWN} more states")
    if fairness == "strong":
        return "\n".join([*lines, "  in it: whatever is fair, strong policies have no loop"])
    return "\n".join([*lines, *_blame(problem, [policy[node] for node in nodes])])


def _blame(problem: Problem, choices: list[Choice]) -> list[str]:
    """Say of each constraint in a loop why it does not end the loop."""
    lowered = frozenset[int]().union(*(choice.lowered for choice in choices))
    raised = frozenset[int]().union(*(choice.raised for choice in choices))
    lines = []
    for i in sorted(lowered & raised):
        name = problem.constraints[i]
        how = f"{name} is lowered and raised" if problem.numeric else f"actions of con_A({name}) and con_B({name})"
        lines.append(f"  in it: {how}")
    if not lowered:
        lines.append("  in it: no variable is lowered" if problem.numeric else "  in it: no action of any con_A")
    for i in sorted(lowered - raised):
        lines.append(f"  in it: {problem.constraints[i]} is fair, but no outcome of its actions leaves the loop")
    return lines
