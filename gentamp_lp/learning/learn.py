"""From a task to a policy: demonstrations, feature pool, abstraction and policy, roll-outs, bundle."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import count
from pathlib import Path
from typing import Any

from gentamp_lp.abstraction.choose import NoPolicy, Solution, synthesize_policy
from gentamp_lp.abstraction.observations import parse_evidence
from gentamp_lp.base.version import __version__
from gentamp_lp.constrained.encodings import constrained_domain, doubtful, to_text
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.demonstrations.demonstrate import Recorder, demonstrate, short_plan
from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.explaining.why_no_policy import absence
from gentamp_lp.explaining.why_selected import reasons
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.open_world import Openness
from gentamp_lp.features.pool import Pool, check_grammars, deepen
from gentamp_lp.features.terms import describe, split_formula
from gentamp_lp.features.values import describe_value, recorded
from gentamp_lp.planning.guided import DeadEnd, GuidedPlanner
from gentamp_lp.policy.learn_report import Failure
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Instance, Task

Progress = Callable[[str], None]
Rollout = tuple[int | str, int, str | None]  # size, seed, robot
FIRST_LEVEL = 3  # complexity at which the pool starts; deeper levels only while they can pay
ROLLOUT_ROUNDS = 5
VALIDATION_SEEDS = 500  # added to the index of a validation problem, to keep it apart from training problems
_ROLLOUT_SECONDS = 60.0  # for one problem
_ROLLOUT_TRIES = 2  # rounds of guided planning before a roll-out counts as failed
STAGES = ("demonstrations", "pool", "theory", "solving", "policy", "rollouts", "compilation")


@dataclass
class Learned:
    """A learned policy with all that is reported about it."""

    task: Task
    policy: Policy
    dataset: Dataset
    pool: Pool
    solution: Solution
    facts: str = field(repr=False)  # what the ASP program was given
    complexity: int  # of the pool the policy was found in
    proved: int  # no abstraction with features up to this complexity is cheaper
    rounds: int
    seconds: dict[str, float]
    interrupted: bool = False
    settings: dict[str, Any] = field(default_factory=dict)  # arguments of `learn` that the result depends on
    refined_on: Sequence[Failure] = ()
    domain_pddl: str = ""
    stream_pddl: str = ""
    notes: list[str] = field(default_factory=list)

    def report(self) -> dict[str, Any]:
        """The JSON document of `gentamp-lp learn`."""
        policy = self.policy
        names = [feature.name for feature in policy.features]
        sorts = {name: tuple(row) for name, row in self.dataset.predicates.items()}
        openness = Openness(self.task.folder.domain, self.task.folder.streams, sorts)
        why = self.reasons
        return {
            "task": self.task.name,
            "version": __version__,
            "features": [
                {
                    "name": f.name,
                    "formula": f.text,
                    "term": f.formula,
                    "kind": f.kind,
                    "cost": f.cost,
                    "open": openness.is_open(f.formula, f.variable, f.sort),
                    "why": why[f.name],
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
            "pruning": [{"level": row.level, "rule": row.rule, **row.counts} for row in self.pool.pruned],
            "refinement_rounds": self.rounds,
            "refined_on": [asdict(failure) for failure in self.refined_on],
            "validation": self.task.validation_sizes,
            "notes": self.notes,
            "settings": self.settings,
            "seconds": {
                **{k: round(v, 3) for k, v in self.seconds.items()},
                "total": round(sum(self.seconds.values()), 3),
            },
        }

    @cached_property
    def reasons(self) -> dict[str, str]:
        """Why each feature was selected: what goes wrong without it."""
        chosen = {t.source: t for t in (self.dataset.transitions[number] for number in self.solution.chosen)}
        features = dict(zip(self.solution.features, self.policy.features, strict=True))
        see = recorded(self.dataset, self.task, Features.of(self.policy.features))

        def step(state: int) -> str:
            return str(chosen[state])

        found = reasons(
            self.solution,
            parse_evidence(self.facts),
            self.policy.fairness,
            self.settings["unseen"],
            lambda number, state: f"{self.dataset.name(state)}, where {describe_value(features[number], see(state))}",
            step,
        )
        return {f.name: found[number] for number, f in features.items()}

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
    solver_seed: int | None = None,
    robot: str | None = None,
    grammars: Sequence[Path] = (),
    max_complexity: int | None = None,
    around: bool = True,
    fairness: str = "qnp",
    unseen: str = "drop",
    failures: Sequence[Failure] = (),
    start: Policy | None = None,
    time_limit: float = 600.0,
    cache: bool = True,
    progress: Progress = lambda _: None,
) -> Learned:
    """Learn a policy for a task (paper, Algorithm 1, with the changes of docs/method.md).

    `seed` determines the training problems, and clingo's search unless there is a `solver_seed`. A policy must also
    solve the problems of `failures`; where `start` fails on them, its failing states are learned from at once.
    `time_limit` bounds demonstrations and each pool and solver call, in seconds. Raises NoAnswer with an explanation
    when no policy exists over the pool, LimitReached when the limit ends without one.
    """
    settings = {
        "task": task.reference,
        "seed": seed,
        "solver_seed": solver_seed,
        "robot": robot,
        "grammars": [str(path) for path in grammars],
        "max_complexity": max_complexity,
        "around": around,
        "fairness": fairness,
        "unseen": unseen,
    }
    solver_seed = seed if solver_seed is None else solver_seed
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
    training = [(size, seed * 1000 + index, robot) for index, size in enumerate(task.file.train)]
    beyond: list[Rollout] = [
        (size, seed * 1000 + VALIDATION_SEEDS + i, robot) for i, size in enumerate(task.validation_sizes)
    ]
    asked: list[Rollout] = [(failure.size, failure.seed, failure.robot) for failure in failures]
    notes: list[str] = []

    def fails(policy: Policy, *stages: Sequence[Rollout]) -> list[str]:
        """Where the policy fails in the first of the stages that it does not pass."""
        with clock.stage("rollouts"):
            every = (_roll_out(task, policy, problems, data, deadline, around, progress, notes) for problems in stages)
            return next(filter(None, every), [])

    if start is not None:
        notes += fails(start, asked)
    for rounds in count():
        found: list[str] = []
        for learned in _policies(
            task, data, grammars, highest, fairness, unseen, solver_seed, deadline, clock, progress
        ):
            if learned.interrupted:
                notes.append("interrupted: the policy is the best found so far and was not rolled out")
                break
            found = fails(learned.policy, training, beyond + asked)
            if found:
                break
        notes += found
        if not found:
            break
        if rounds == ROLLOUT_ROUNDS:
            notes.append("the policy still fails on training or validation problems after all refinement rounds")
            break
    with clock.stage("compilation"):
        sorts = {name: tuple(s) for name, s in data.predicates.items()}
        domain = constrained_domain(learned.policy, task.folder, sorts)
        learned.domain_pddl = to_text(domain, learned.policy, doubtful(learned.policy, task.folder))
        learned.stream_pddl = (task.folder.path / "stream.pddl").read_text(encoding="utf-8")
    learned.rounds, learned.notes, learned.settings, learned.refined_on = rounds, notes, settings, failures
    return learned


def _policies(
    task: Task,
    data: Dataset,
    grammars: Sequence[Path],
    highest: int,
    fairness: str,
    unseen: str,
    seed: int,
    deadline: float,
    clock: _Clock,
    progress: Progress,
) -> Iterator[Learned]:
    """Yield a cheapest policy, then ever cheaper ones, as long as a deeper feature could make one.

    Asking for the next one updates what is proved about the last. Raises NoAnswer when there is no policy at all.
    """
    learned: Learned | None = None
    failure: NoAnswer | None = None
    levels = range(min(FIRST_LEVEL, highest), highest + 1)
    pools = deepen(data.pool_facts(), costs=levels, grammars=grammars, time_limit=deadline - time.monotonic())
    for level in levels:
        try:
            with clock.stage("pool"):
                pool = next(pools)
        except LimitReached:
            if learned is None:
                raise
            progress(f"complexity {level}: the pool was not finished within the limit")
            return
        progress(f"complexity {level}: {pool.size} features")
        facts = data.policy_facts() + pool.facts
        start = time.perf_counter()
        try:
            solution = synthesize_policy(
                facts,
                fairness=fairness,
                unseen=unseen,
                time_limit=deadline - time.monotonic(),
                seed=seed,
                improve=(learned.solution.cost, level - 1) if learned else None,
                explain=level == highest,
                progress=progress,
            )
        except NoAnswer as error:
            failure = error
            clock.seconds["solving"] += time.perf_counter() - start
            progress(f"complexity {level}: no {'cheaper ' if learned else ''}policy")
            if learned is not None:
                learned.proved = level
        except KeyboardInterrupt:
            if learned is None:
                raise
            learned.interrupted = True
            yield learned
            return
        except LimitReached as error:
            if learned is None:
                raise
            clock.seconds["solving"] += time.perf_counter() - start
            progress(f"complexity {level}: undecided whether a cheaper abstraction exists ({error})")
            return
        else:
            for stage in ("theory", "solving"):
                clock.seconds[stage] += solution.seconds[stage]
            if learned is None or solution.optimal:
                with clock.stage("policy"):
                    policy = _policy(task, data, pool, solution, facts)
                # an abstraction with a deeper feature costs at least level + 1
                proved = 0 if not solution.optimal else highest if solution.cost <= level + 1 else level
                learned = Learned(
                    task, policy, data, pool, solution, facts, level, proved, 0, clock.seconds, solution.by_user
                )
                yield learned
            if not solution.optimal:
                return
        if learned is not None and learned.solution.cost <= level + 1:
            learned.proved = highest
            return
    if learned is None:
        if isinstance(failure, NoPolicy):
            raise NoAnswer(absence(failure, data, pool, highest, fairness, task.folder.domain.fluents))
        raise failure or LimitReached("the time limit ended learning before a pool was searched")


def _policy(task: Task, data: Dataset, pool: Pool, solution: Solution, facts: str) -> Policy:
    parts = {f: split_formula(pool.formulas[f]) for f in solution.features}
    return Policy.from_solution(
        solution,
        facts,
        {f: body for f, (_, _, body) in parts.items()},
        {f: describe(body, data.display) for f, (_, _, body) in parts.items()},
        task=task.name,
        variables={f: (variable, sort) for f, (variable, sort, _) in parts.items()},
        extra={"sorts": data.predicates},
    )


def _roll_out(
    task: Task,
    policy: Policy,
    problems: Iterable[Rollout],
    data: Dataset,
    deadline: float,
    around: bool,
    progress: Progress,
    notes: list[str],
) -> list[str]:
    """Follow the policy on problems; where it fails, add a demonstration from the failing state.

    Returns the failures. A roll-out that takes too long shows nothing; it is only noted.
    """
    failures = []
    for size, seed, robot in problems:
        instance = task.instance(size, seed, robot=robot)
        try:
            left = max(1.0, min(_ROLLOUT_SECONDS, deadline - time.monotonic()))
            GuidedPlanner(policy, instance).solve(time_limit=left, max_rounds=_ROLLOUT_TRIES)
        except LimitReached:
            notes.append(f"{task.name}-{size}: the roll-out was not finished within {left:.0f} s")
            progress(notes[-1])
        except DeadEnd as end:
            failures.append(f"{task.name}-{size}: {end}")
            progress(f"roll-out failed on {failures[-1]}")
            _learn_from(end, instance, data, deadline, around)
    return failures


def _learn_from(end: DeadEnd, instance: Instance, data: Dataset, deadline: float, around: bool) -> None:
    """Record what the planner does from where the policy failed, as a problem of its own.

    What the roll-out sampled in vain is forgotten: features should see as many samples there as elsewhere.
    """
    task, state = instance.task, end.state
    base = instance.base.trimmed(task.file.samples, {name for fact in state for name in fact[1:]})
    left = max(1.0, deadline - time.monotonic())
    plan = short_plan(task, base, state, time_limit=left, seed=instance.seed)
    Recorder(task, data, around=around).record(replace(instance, base=base), plan, state)
