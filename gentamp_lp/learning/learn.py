"""From a task to a policy: demonstrations, feature pool, abstraction and policy, roll-outs, constrained domain."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import Any

from gentamp_lp.base.fairness import ProgramName
from gentamp_lp.constrained.encodings import constrained_domain, doubtful, to_text
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.demonstrations.demonstrate import demonstrate
from gentamp_lp.features.pool import check_grammars
from gentamp_lp.learning.candidates import Candidate, candidates
from gentamp_lp.learning.clock import Clock
from gentamp_lp.learning.learned import Learned
from gentamp_lp.learning.rollouts import Trials, Tried, try_out
from gentamp_lp.learning.run import Progress, Run
from gentamp_lp.policy.learn_report import Failure
from gentamp_lp.policy.learn_settings import LearnSettings
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task

__all__ = ["LearnSettings", "Learned", "learn"]

ROUNDS = 5  # of refinement


def learn(
    task: Task,
    settings: LearnSettings = LearnSettings(),
    *,
    failures: Sequence[Failure] = (),
    start: Policy | None = None,
    time_limit: float = 600.0,
    cache: bool = True,
    program: ProgramName = "lazy",
    progress: Progress = lambda _: None,
    **changes: Any,
) -> Learned:
    """Learn a policy for a task (paper, Algorithm 1, with the changes of docs/method.md).

    Settings may be given by name, too: `learn(task, seed=1, max_complexity=4)`; `LearnSettings` says what there is. A
    policy must also solve the problems of `failures`; where `start` fails on them, its failing states are learned from
    at once. `time_limit` bounds demonstrations and each pool and solver call, in seconds. `program` = "reference" gives
    the same policy by the complete ASP program, where the data are few. Raises NoAnswer with an explanation when no
    policy exists over the pool, LimitReached when the limit ends without one or the data are too many.
    """
    run = Run(task, settings.changed(changes), Clock(time_limit), progress, program)
    check_grammars(run.grammars)  # before minutes of planning, not after
    with run.clock.stage("demonstrations"):
        data = _demonstrations(run, time_limit, cache)
    trials = Trials.of(run, failures)
    notes = () if start is None else try_out(start, [trials.failed], data, run).notes
    for rounds in count():
        best, tried = _policy_that_passes(run, data, trials)
        notes += tried.notes
        if best.interrupted:
            notes += ("interrupted: the policy is the best found so far and was not rolled out",)
        if not tried.failures or rounds == ROUNDS:
            break
    if tried.failures:
        notes += ("the policy still fails on training or validation problems after all refinement rounds",)
    with run.clock.stage("compilation"):
        domain_pddl, stream_pddl = _constrained(task, best.policy, data)
    return Learned(
        task=task,
        settings=run.settings,
        policy=best.policy,
        dataset=data,
        pool=best.pool,
        solution=best.solution,
        complexity=best.complexity,
        proved=best.proved,
        interrupted=best.interrupted,
        rounds=rounds,
        notes=notes,
        refined_on=tuple(failures),
        domain_pddl=domain_pddl,
        stream_pddl=stream_pddl,
        seconds=run.clock.seconds(),
    )


def _demonstrations(run: Run, time_limit: float, cache: bool) -> Dataset:
    """Plan the training problems, and look at the states around the plans."""
    settings = run.settings
    data = demonstrate(
        run.task,
        seed=settings.seed,
        robot=settings.robot,
        around=settings.around,
        time_limit=time_limit,
        cache=cache,
        progress=run.progress,
    )
    run.progress(f"{len(data.states)} states, {len(data.transitions)} transitions of {len(data.problems)} problem(s)")
    return data


def _policy_that_passes(run: Run, data: Dataset, trials: Trials) -> tuple[Candidate, Tried]:
    """The cheapest policy, and where it failed; every policy on the way is tried out, and the first to fail is the
    last to be looked for, since what is learned from its failure changes what is cheapest.
    """
    policy: Policy | None = None
    unfinished: tuple[str, ...] = ()
    tried = Tried()
    for best in candidates(run, data):
        if best.policy is not policy and not best.interrupted:
            policy = best.policy
            tried = try_out(policy, [trials.training, trials.validation + trials.failed], data, run)
            unfinished += tried.unfinished
        if tried.failures:
            break
    return best, Tried(tried.failures, unfinished)


def _constrained(task: Task, policy: Policy, data: Dataset) -> tuple[str, str]:
    """The policy as a constrained PDDLStream domain: its `domain.pddl` and `stream.pddl`."""
    domain = constrained_domain(policy, task.folder, data.sorts)
    stream_pddl = (task.folder.path / "stream.pddl").read_text(encoding="utf-8")
    return to_text(domain, policy, doubtful(policy, task.folder)), stream_pddl
