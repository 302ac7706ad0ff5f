"""From training data to policies: the pool, level by level, and the cheapest policy over each level."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from gentamp_lp.abstraction.choose import NoPolicy, Solution, synthesize_policy
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.explaining.why_no_policy import absence
from gentamp_lp.features.pool import Pool, deepen, split_formula
from gentamp_lp.learning.run import Run
from gentamp_lp.policy.policy import Policy

FIRST_LEVEL = 3  # complexity at which the pool starts; deeper levels only while they can pay


@dataclass(frozen=True)
class Candidate:
    """The cheapest policy up to some level of the pool.

    `complexity` is that of the pool in which it was found; no abstraction over features up to complexity `proved` is
    cheaper. `interrupted`: Ctrl-C ended the search.
    """

    policy: Policy
    pool: Pool
    solution: Solution
    complexity: int
    proved: int
    interrupted: bool


def candidates(run: Run, data: Dataset) -> Iterator[Candidate]:
    """Yield what is known after each level, as long as a deeper feature could make a cheaper policy.

    The same policy comes again with a higher `proved` where a level has no cheaper one. Raises NoAnswer with an
    explanation when there is no policy at all, LimitReached when the limit ends before one is found.
    """
    levels = range(min(FIRST_LEVEL, run.highest), run.highest + 1)
    pools = deepen(data.pool_facts(), costs=levels, grammars=run.grammars, time_limit=run.clock.left())
    best: Candidate | None = None
    for level in levels:
        try:
            with run.clock.stage("pool"):
                pool = next(pools)
            run.progress(f"complexity {level}: {pool.size} features")
            found = _cheapest(run, data, pool, level, best)
        except NoAnswer as error:
            run.progress(f"complexity {level}: no {'cheaper ' if best else ''}policy")
            if best is None and level == run.highest:
                raise _explained(error, run, data, pool) from None
            best = best and replace(best, proved=level)
        except LimitReached as error:
            if best is None:
                raise
            run.progress(f"complexity {level}: undecided whether a cheaper abstraction exists ({error})")
            return
        except KeyboardInterrupt:
            if best is None:
                raise
            yield replace(best, interrupted=True)
            return
        else:
            if best is not None and not found.solution.optimal:
                return
            best = found
        if best is not None:
            # an abstraction with a deeper feature costs at least level + 1
            decided = best.solution.optimal and best.solution.cost <= level + 1
            best = replace(best, proved=run.highest) if decided else best
            yield best
            if decided or not best.solution.optimal:
                return


def _cheapest(run: Run, data: Dataset, pool: Pool, level: int, best: Candidate | None) -> Candidate:
    """The cheapest policy over a pool, if it is cheaper than the best so far."""
    settings = run.settings
    with run.clock.stage("solving"):
        solution = synthesize_policy(
            data.policy_facts() + pool.facts,
            fairness=settings.fairness,
            unseen=settings.unseen,
            time_limit=run.clock.left(),
            seed=settings.seed if settings.solver_seed is None else settings.solver_seed,
            improve=(best.solution.cost, level - 1) if best else None,
            explain=level == run.highest,
            program=run.program,
            progress=run.progress,
        )
    run.clock.move("solving", "theory", solution.seconds["theory"])
    with run.clock.stage("policy"):
        policy = _policy(run, data, pool, solution)
    proved = level if solution.optimal else 0
    return Candidate(policy, pool, solution, level, proved, solution.by_user)


def _policy(run: Run, data: Dataset, pool: Pool, solution: Solution) -> Policy:
    parts = {f: split_formula(pool.formulas[f]) for f in solution.features}
    return Policy.from_solution(
        solution,
        solution.theory.observations,
        {f: body for f, (_, _, body) in parts.items()},
        {f: pool.texts[f] for f in solution.features},
        task=run.task.name,
        variables={f: (variable, sort) for f, (variable, sort, _) in parts.items()},
        extra={"sorts": data.predicates},
    )


def _explained(error: NoAnswer, run: Run, data: Dataset, pool: Pool) -> NoAnswer:
    """Why there is no policy, with the states of the training data."""
    if not isinstance(error, NoPolicy):
        return error
    fluents = run.task.folder.domain.fluents
    return NoAnswer(absence(error, data, pool, run.highest, run.settings.fairness, fluents))
