"""Choose features and moves that make a policy: one optimising ASP program with lazy clauses.

The rules are in `asp/abstraction.lp` and `gentamp_lp/lemmas.py`; this module turns a sample into the program's
facts, runs it, breaks ties, and says why when there is no answer. The lazy formulation follows D2L (Frances,
Bonet and Geffner, AAAI 2021) in solving with few pairs and adding those that an answer violates.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from gentamp_lp.asp import Answer, Atom, Clause, Outcome, Program
from gentamp_lp.errors import InputError, LimitReached, NoAnswer
from gentamp_lp.evidence import Evidence, bits, parse_evidence
from gentamp_lp.lemmas import FAIRNESS, Theory, compress, minimal
from gentamp_lp.resources import resource

_GOAL_PAIRS = 300  # pairs of goal and other states given from the start
_COVERS = 400  # covers given from the start: the shortest, more do not help the bound
_TIES = 200  # optimal selections that are compared to break ties
_EXPLAIN = 20.0  # seconds spent on making an explanation small


@dataclass(frozen=True)
class Solution:
    """Selected features, one chosen transition for every expanded state, and what is proved about the cost."""

    features: tuple[int, ...]
    cost: int
    bound: int
    optimal: bool
    chosen: tuple[int, ...]
    seconds: dict[str, float] = field(compare=False)
    statistics: dict[str, int] = field(compare=False)


class NoPolicy(NoAnswer):
    """No abstraction of the pool has a policy; `states` or `pairs` (goal, other) are what stands in the way."""

    def __init__(
        self, message: str, *, states: tuple[int, ...] = (), pairs: tuple[tuple[int, int], ...] = ()
    ) -> None:
        super().__init__(message)
        self.states = states
        self.pairs = pairs


def synthesize_policy(
    facts: str | Evidence,
    *,
    fairness: str = "qnp",
    time_limit: float | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """Return the cheapest abstraction with a policy for every expanded state of the sample.

    `fairness` is the least that must be guaranteed: `strong` (no loop), `qnp` (every loop lowers a count it
    never raises) or `strong-cyclic` (a goal stays in reach). Among optimal answers the one with the fewest
    features, then the fewest policy rules, then the smallest numbers is returned, whatever the seed.

    Raises NoPolicy with the states at fault, or LimitReached if the limit ends before any answer; an answer
    that was not proved optimal in time comes back with `optimal` False and a lower `bound`.
    """
    if fairness not in FAIRNESS:
        raise InputError(f"unknown fairness {fairness!r}: one of {', '.join(FAIRNESS)}")
    say = progress or (lambda message: None)
    clock = _Clock(time_limit)
    evidence = parse_evidence(facts) if isinstance(facts, str) else facts
    _goals_can_be_told(evidence)
    theory = compress(evidence, fairness)
    lazy = LazyPolicy(theory)
    ties = _Ties(say)
    program = Program(
        [resource("asp", "abstraction.lp")],
        theory_facts(theory),
        options=["--opt-strategy=usc,stratify", "--opt-mode=optN", "--project=project", "0", *_random(seed)],
        theory=lazy,
    )
    prepared = clock.now()
    say(f"{theory.features.bit_count()} features, {len(theory.expanded)} state classes")
    outcome = program.solve(
        limit=clock.left(),
        on_answer=ties.report,
        on_bound=lambda bound: say(f"cost at least {bound[0]}"),
    )
    if not outcome.answers:
        if not outcome.complete:
            raise LimitReached(f"no policy found in {time_limit:g} s; {_reached(outcome)}")
        raise _explain(theory, clock)
    best = _best(outcome.answers, theory)
    bound = max(outcome.bound[0], 0) if outcome.bound else 0
    optimal = best.optimal or outcome.complete or bound >= best.cost[0]
    chosen = _first_choice(theory, best.atoms["selected"])
    solved = clock.now()
    return Solution(
        features=best.atoms["selected"],
        cost=best.cost[0],
        bound=best.cost[0] if optimal else bound,
        optimal=optimal,
        chosen=chosen,
        seconds={"theory": prepared, "solving": solved - prepared},
        statistics={
            "pool_classes": theory.features.bit_count(),
            "state_classes": len(theory.expanded),
            "frontier_states": len(theory.frontier),
            "ties": len({answer.atoms["selected"] for answer in outcome.answers if answer.optimal}),
            **program.statistics(),
        },
    )


class _Clock:
    def __init__(self, limit: float | None) -> None:
        self._start, self._limit = time.monotonic(), limit

    def now(self) -> float:
        return time.monotonic() - self._start

    def left(self) -> float | None:
        return None if self._limit is None else max(self._limit - self.now(), 0.0)


class LazyPolicy:
    """The conditions of `lemmas.py` in the vocabulary of the program."""

    predicates = ("selected", "chosen", "relevant")

    def __init__(self, theory: Theory) -> None:
        self.theory = theory
        self._bit = {feature.id: 1 << i for i, feature in enumerate(theory.evidence.features)}
        self._state = {move.id: state.id for state in theory.expanded for move in state.moves}

    def refute(self, true: dict[str, list[int]]) -> Iterable[tuple[str, Clause]]:
        """Return the violated lemmas as clauses."""
        relevant = set(true["relevant"])
        choice = {self._state[move]: move for move in true["chosen"] if self._state[move] in relevant}
        for lemma in self.theory.refute(self.mask(true["selected"]), choice):
            clause: list[tuple[Atom, bool]] = [(("relevant", state), False) for state in sorted(lemma.states)]
            clause += [(("selected", feature), True) for feature in self.theory.evidence.ids(lemma.selected)]
            clause += [(("selected", feature), False) for feature in self.theory.evidence.ids(lemma.unselected)]
            clause += [(("chosen", move), True) for move in lemma.chosen]
            clause += [(("chosen", move), False) for move in lemma.unchosen]
            yield lemma.kind, clause

    def mask(self, features: Iterable[int]) -> int:
        """Return the mask of a selection."""
        return sum(self._bit[feature] for feature in features)


def theory_facts(theory: Theory) -> str:
    """Return the input facts of `asp/abstraction.lp` (documented in `asp/abstraction/defined.lp`)."""
    evidence = theory.evidence
    name = [feature.id for feature in evidence.features]
    lines = [f"feature({name[i]},{evidence.features[i].cost})." for i in bits(theory.features)]
    for state in theory.expanded:
        lines.append(f"expanded({state.id}).")
        for move in state.moves:
            lines.append(f"move({state.id},{move.id}).")
            lines.extend(f"changes({move.id},{name[i]})." for i in bits((move.inc | move.dec) & theory.features))
    for predicate, number, pairs in (
        ("differ", _GOAL_PAIRS, _goal_pairs(theory)),
        ("tells", _COVERS, _cover_pairs(theory)),
    ):
        for mask in minimal(pairs, number):
            lines.extend(f"{predicate}({pairs[mask][0]},{pairs[mask][1]},{name[i]})." for i in bits(mask))
    return "\n".join(lines)


def _goal_pairs(theory: Theory) -> dict[int, tuple[int, int]]:
    """Map each set of features that differ on a goal and another state to one such pair."""
    evidence = theory.evidence
    states = {values & theory.features: s for s, values in reversed(evidence.states.items())}
    goals = {evidence.states[s] & theory.features: s for s in sorted(evidence.goals, reverse=True)}
    return {
        goal ^ other & theory.features: (goals[goal], states[other & theory.features])
        for goal in goals
        for other in (*(state.values for state in theory.expanded), *theory.frontier)
    }


def _cover_pairs(theory: Theory) -> dict[int, tuple[int, int]]:
    """Map each cover (see `asp/abstraction/covers.lp`) to a pair of states, for states with one candidate."""
    single = [(state, state.moves[0]) for state in theory.expanded if len(state.moves) == 1]
    return {
        ((s.values ^ t.values) | (a.inc & b.inc) | (a.dec & b.dec)) & theory.features: (s.id, t.id)
        for i, (s, a) in enumerate(single)
        for t, b in single[:i]
    }


def _random(seed: int) -> list[str]:
    return [f"--seed={seed}", "--rand-freq=0.01"] if seed else []


class _Ties:
    """Stop the listing of optimal selections at some point."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._count = say, 0

    def report(self, answer: Answer) -> bool:
        if answer.optimal:
            self._count += 1
        else:
            self._say(f"a policy of cost {answer.cost[0]} with {answer.cost[1]} features")
        return self._count < _TIES


def _reached(outcome: Outcome) -> str:
    return f"its cost is at least {outcome.bound[0]}" if outcome.bound else "nothing is known about its cost"


def _best(answers: list[Answer], theory: Theory) -> Answer:
    """Break ties: fewest features, fewest policy rules, smallest feature numbers."""
    lazy = LazyPolicy(theory)

    def key(answer: Answer) -> tuple[int, tuple[int, ...], int, tuple[int, ...]]:
        mask = lazy.mask(answer.atoms["selected"])
        rules = len({state.values & mask for state in theory.expanded})
        return (-answer.optimal, answer.cost, rules, answer.atoms["selected"])

    return min(answers, key=key)


def _first_choice(theory: Theory, selected: tuple[int, ...]) -> tuple[int, ...]:
    """Return the smallest transitions that make the selected features work, state by state."""
    evidence = theory.evidence
    moves = {state.id: [move.id for move in state.moves] for state in theory.expanded}
    mask = LazyPolicy(theory).mask(selected)
    if any(len(options) > 1 for options in moves.values()):
        picked = _settle(replace(theory, features=mask, numeric=theory.numeric & mask), selected, moves)
    else:
        picked = {state: options[0] for state, options in moves.items()}
    chosen = []
    for state, candidates in evidence.candidates.items():
        model = evidence.transitions[picked[theory.home[state]]]
        chosen.append(
            next(
                t
                for t in candidates
                if not ((evidence.transitions[t].inc ^ model.inc) | (evidence.transitions[t].dec ^ model.dec)) & mask
            )
        )
    return tuple(sorted(chosen))


def _settle(theory: Theory, selected: tuple[int, ...], moves: dict[int, list[int]]) -> dict[int, int]:
    """Fix the moves one state after the other, each time the smallest that leaves an answer."""
    program = _relaxed(theory)
    fixed: list[Atom] = [("selected", feature) for feature in selected]
    fixed += [("relevant", state) for state in moves]
    picked: dict[int, int] = {}
    for state, options in moves.items():
        for move in options:
            trial = [*fixed, ("chosen", move)]
            if move == options[-1] or program.solve(assume=trial, on_answer=_enough).answers:
                fixed, picked[state] = trial, move
                break
    return picked


def _enough(answer: Answer) -> bool:
    return False


def _relaxed(theory: Theory) -> Program:
    return Program([resource("asp", "explanation.lp")], theory_facts(theory), theory=LazyPolicy(theory))


def _goals_can_be_told(evidence: Evidence) -> None:
    """Raise NoPolicy if a goal state looks like another one to every feature of the pool."""
    if not evidence.goals:
        raise NoPolicy("the sample has no goal state")
    looks: dict[int, list[int]] = {}
    for goal in sorted(evidence.goals):
        looks.setdefault(evidence.states[goal], []).append(goal)
    pairs = tuple(
        (looks[values][0], state)
        for state, values in evidence.states.items()
        if state not in evidence.goals and values in looks
    )
    if pairs:
        shown = ", ".join(f"{goal} and {other}" for goal, other in pairs[:5])
        raise NoPolicy(
            f"no feature of the pool separates these goal states from states that are none: {shown}"
            + (f" and {len(pairs) - 5} more pairs" if len(pairs) > 5 else "")
            + "; try a higher complexity or another grammar rule",
            pairs=pairs,
            states=tuple(sorted({state for pair in pairs for state in pair})),
        )


def _explain(theory: Theory, clock: _Clock) -> NoPolicy:
    """Return the error that names a smallest set of expanded states for which no policy exists together."""
    program = _relaxed(theory)
    left = clock.left()
    deadline = clock.now() + (_EXPLAIN if left is None else min(_EXPLAIN, left))
    core: list[Atom] = [("relevant", state.id) for state in theory.expanded]
    small = _core(program, core, deadline - clock.now())
    tried: list[Atom] = []
    core = core if small is None else small
    minimal = small is not None
    while len(core) > len(tried):
        atom = next(atom for atom in core if atom not in tried)
        small = _core(program, [other for other in core if other != atom], deadline - clock.now())
        if small is None:
            tried.append(atom)
            minimal = minimal and clock.now() < deadline
        else:
            core = small
    return _conflict(theory, tuple(sorted(state for _, state in core)), minimal)


def _core(program: Program, atoms: list[Atom], limit: float) -> list[Atom] | None:
    """Return a core among the atoms; None if they can be demanded together, or nobody knows in time."""
    if limit <= 0:
        return None
    outcome = program.solve(limit=limit, assume=atoms, on_answer=_enough)
    if outcome.answers or outcome.interrupted:
        return None
    return [atom for atom in atoms if atom in outcome.core]


def _conflict(theory: Theory, states: tuple[int, ...], minimal: bool) -> NoPolicy:
    evidence = theory.evidence
    lines = [
        f"no abstraction of the pool has a {theory.fairness} policy for these expanded states together: "
        f"{', '.join(map(str, states))}" + ("" if minimal else " (not proved to be a smallest such set)")
    ]
    shown = [state for state in theory.expanded if state.id in states]
    for state in shown[:8]:
        moves = sorted({evidence.schemas.get(t, f"transition {t}") for t in evidence.candidates[state.id]})
        lines.append(f"  state {state.id}: {' or '.join(moves)}")
        if all(not move.inc | move.dec for move in state.moves):
            lines.append("    no feature of the pool changes along it")
    for i, s in enumerate(shown):
        for t in shown[:i]:
            if s.values == t.values:
                lines.append(f"  states {t.id} and {s.id} look alike to every feature, but no candidates agree")
    lines.append(
        "  demonstrations that treat like states differently are inconsistent: change them, or try a higher "
        "complexity, another grammar rule" + ("" if theory.fairness == "strong-cyclic" else ", a weaker fairness")
    )
    return NoPolicy("\n".join(lines), states=states)
