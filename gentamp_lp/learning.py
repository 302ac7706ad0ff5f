"""From a task to a policy: demonstrations, feature pool, abstraction and policy, roll-outs, bundle."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gentamp_lp
from gentamp_lp.abstraction import NoPolicy, Solution, synthesize_policy
from gentamp_lp.compile import constrained_domain, to_text
from gentamp_lp.dataset import Dataset
from gentamp_lp.demonstrations import Recorder, canonical, demonstrate
from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.guided import DeadEnd, GuidedPlanner
from gentamp_lp.openness import Openness
from gentamp_lp.policy import Policy
from gentamp_lp.pool import Pool, check_grammars, deepen, describe, split_formula
from gentamp_lp.streams.incremental import solve_incremental
from gentamp_lp.task import Instance, Task

Progress = Callable[[str], None]
FIRST_LEVEL = 3  # complexity at which the pool starts; deeper levels only while they can pay
ROLLOUT_ROUNDS = 5
_EXPLAINED = 6  # states shown when there is no policy
_ROLLOUT_TRIES = 3  # rounds of guided planning before a roll-out counts as failed
STAGES = ("demonstrations", "pool", "theory", "solving", "policy", "rollouts", "compilation")


@dataclass
class Learned:
    """A learned policy with all that is reported about it."""

    task: Task
    policy: Policy
    dataset: Dataset
    pool: Pool
    solution: Solution
    complexity: int  # of the pool the policy was found in
    proved: int  # no abstraction with features up to this complexity is cheaper
    rounds: int
    seconds: dict[str, float]
    interrupted: bool = False
    domain_pddl: str = ""
    stream_pddl: str = ""
    notes: list[str] = field(default_factory=list)

    def report(self) -> dict[str, Any]:
        """The JSON document of `gentamp-lp learn`."""
        policy = self.policy
        names = [feature.name for feature in policy.features]
        sorts = {name: tuple(row) for name, row in self.dataset.predicates.items()}
        openness = Openness(self.task.folder.domain, self.task.folder.streams, sorts)
        return {
            "task": self.task.name,
            "version": gentamp_lp.__version__,
            "features": [
                {
                    "name": f.name,
                    "formula": f.text,
                    "term": f.formula,
                    "kind": f.kind,
                    "cost": f.cost,
                    "open": openness.is_open(f.formula, f.variable, f.sort),
                }
                for f in policy.features
            ],
            "actions": [
                {
                    "name": a.name,
                    "schemas": list(a.schemas),
                    "preconditions": dict(a.preconditions),
                    "effects": dict(a.effects),
                }
                for a in policy.actions
            ],
            "policy": [
                {"state": dict(zip(names, rule.valuation, strict=True)), "action": rule.action} for rule in policy.rules
            ],
            "fairness": policy.fairness,
            "optimal": self.solution.optimal,
            "cost": self.solution.cost,
            "bound": self.solution.bound,
            "complexity": self.complexity,
            "proved_complexity": self.proved,
            "states": len(self.dataset.states),
            "transitions": len(self.dataset.transitions),
            "problems": len(self.dataset.problems),
            "pool_size": self.pool.size,
            "pool_statistics": dict(self.pool.statistics),
            "refinement_rounds": self.rounds,
            "notes": self.notes,
            "seconds": {
                **{k: round(v, 3) for k, v in self.seconds.items()},
                "total": round(sum(self.seconds.values()), 3),
            },
        }

    def save(self, folder: Path) -> None:
        """Write the policy bundle, whole or not at all."""
        self.policy.save(folder, domain_pddl=self.domain_pddl, stream_pddl=self.stream_pddl, report=self.report())


@dataclass
class _Clock:
    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))

    @contextmanager
    def stage(self, name: str) -> Any:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - start


def learn(
    task: Task,
    *,
    seed: int = 0,
    robot: str | None = None,
    grammars: Sequence[Path] = (),
    max_complexity: int | None = None,
    around: bool = True,
    fairness: str = "qnp",
    time_limit: float = 600.0,
    cache: bool = True,
    progress: Progress = lambda _: None,
) -> Learned:
    """Learn a policy for a task (paper, Algorithm 1, with the changes of docs/method.md).

    `time_limit` bounds demonstrations and each pool and solver call, in seconds. Raises NoAnswer with an explanation
    when no policy exists over the pool, LimitReached when the limit ends without one.
    """
    grammars = task.grammars(grammars)
    check_grammars(grammars)  # before minutes of planning, not after
    clock = _Clock()
    deadline = time.monotonic() + time_limit
    with clock.stage("demonstrations"):
        data = demonstrate(
            task, seed=seed, robot=robot, around=around, time_limit=time_limit, cache=cache, progress=progress
        )
    progress(f"{len(data.states)} states, {len(data.transitions)} transitions of {len(data.problems)} problem(s)")
    highest = max_complexity or task.file.max_complexity
    notes: list[str] = []
    rounds = -1
    while True:
        rounds += 1
        learned = _choose(task, data, grammars, highest, fairness, seed, deadline, clock, progress)
        if learned.interrupted:
            notes.append("interrupted: the policy is the best found so far and was not rolled out")
            break
        with clock.stage("rollouts"):
            failures = _roll_out(learned.policy, task, seed, robot, data, deadline, around, progress)
        if not failures:
            break
        notes += failures
        if rounds == ROLLOUT_ROUNDS:
            notes.append("the policy still fails on training problems after all refinement rounds")
            break
    with clock.stage("compilation"):
        sorts = {name: tuple(s) for name, s in data.predicates.items()}
        domain = constrained_domain(learned.policy, task.folder, sorts)
        learned.domain_pddl = to_text(domain, learned.policy)
        learned.stream_pddl = (task.folder.path / "stream.pddl").read_text(encoding="utf-8")
    learned.rounds, learned.notes = rounds, notes
    return learned


def _choose(
    task: Task,
    data: Dataset,
    grammars: Sequence[Path],
    highest: int,
    fairness: str,
    seed: int,
    deadline: float,
    clock: _Clock,
    progress: Progress,
) -> Learned:
    """Deepen the pool level by level while a deeper feature could still give a cheaper abstraction."""
    best: tuple[Pool, Solution, int, str] | None = None
    failure: NoAnswer | None = None
    interrupted = False
    proved = 0  # no abstraction with features up to this complexity is cheaper than the best
    levels = range(min(FIRST_LEVEL, highest), highest + 1)
    pools = deepen(data.pool_facts(), costs=levels, grammars=grammars, time_limit=deadline - time.monotonic())
    for level in levels:
        try:
            with clock.stage("pool"):
                pool = next(pools)
        except LimitReached:
            if best is None:
                raise
            progress(f"complexity {level}: the pool was not finished within the limit")
            break
        try:
            progress(f"complexity {level}: {pool.size} features")
            facts = data.policy_facts() + pool.facts
            start = time.perf_counter()
            solution = synthesize_policy(
                facts,
                fairness=fairness,
                time_limit=deadline - time.monotonic(),
                seed=seed,
                improve=(best[1].cost, level - 1) if best else None,
                explain=level == highest,
                progress=progress,
            )
        except NoAnswer as error:
            failure = error
            clock.seconds["solving"] += time.perf_counter() - start
            progress(f"complexity {level}: {error}")
            proved = level
        except KeyboardInterrupt:
            if best is None:
                raise
            interrupted = True
            break
        except LimitReached as error:
            if best is None:
                raise
            clock.seconds["solving"] += time.perf_counter() - start
            progress(f"complexity {level}: undecided whether a cheaper abstraction exists ({error})")
            break
        else:
            for stage in ("theory", "solving"):
                clock.seconds[stage] += solution.seconds[stage]
            interrupted = solution.by_user
            if best is None or solution.optimal:
                best = (pool, solution, level, facts)
            if not solution.optimal:
                break
            proved = level
        if best is not None and best[1].cost <= level + 1:
            proved = highest  # an abstraction with a deeper feature costs at least level + 1
            break
    if best is None:
        raise _explained(failure, data, task)
    pool, solution, level, facts = best
    with clock.stage("policy"):
        parts = {f: split_formula(pool.formulas[f]) for f in solution.features}
        policy = Policy.from_solution(
            solution,
            facts,
            {f: body for f, (_, _, body) in parts.items()},
            {f: describe(body, data.display) for f, (_, _, body) in parts.items()},
            task=task.name,
            variables={f: (variable, sort) for f, (variable, sort, _) in parts.items()},
            extra={"sorts": data.predicates},
        )
    return Learned(task, policy, data, pool, solution, level, proved, 0, clock.seconds, interrupted)


def _explained(failure: NoAnswer | None, data: Dataset, task: Task) -> Exception:
    """The failure with the concrete states it speaks of."""
    if not isinstance(failure, NoPolicy):
        return failure or LimitReached("the time limit ended learning before a pool was searched")
    states = [s for pair in failure.pairs for s in pair] or list(failure.states)
    shown = list(dict.fromkeys(states))[:_EXPLAINED]
    return NoAnswer("\n".join([str(failure), *(data.describe(s, task.folder.domain.fluents) for s in shown)]))


def _roll_out(
    policy: Policy,
    task: Task,
    seed: int,
    robot: str | None,
    data: Dataset,
    deadline: float,
    around: bool,
    progress: Progress,
) -> list[str]:
    """Follow the policy on the training problems; where it fails, add a demonstration from the failing state."""
    failures = []
    for index, size in enumerate(task.file.train):
        instance = task.instance(size, seed * 1000 + index, robot=robot)
        try:
            left = max(1.0, deadline - time.monotonic())
            GuidedPlanner(policy, instance).solve(time_limit=left, max_rounds=_ROLLOUT_TRIES)
        except DeadEnd as end:
            failures.append(f"{task.name}-{size}: {end}")
            progress(f"roll-out failed on {failures[-1]}")
            _learn_from(end, instance, task, data, deadline, around)
    return failures


def _learn_from(end: DeadEnd, instance: Instance, task: Task, data: Dataset, deadline: float, around: bool) -> None:
    """Record what the planner does from where the policy failed, as a problem of its own."""
    state = end.state
    base, program = instance.base, task.program
    left = max(1.0, deadline - time.monotonic())
    plan = solve_incremental(program, base, state, task.goal, quota=task.file.samples, time_limit=left)
    plan = canonical(program, base, state, task.goal, plan)
    Recorder(task, data, around=around).record(instance, plan, state)
