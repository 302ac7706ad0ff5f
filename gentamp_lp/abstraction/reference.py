"""The complete program `asp/reference.lp`: all pairs of states are written out, nothing is added lazily.

It is given the features that compression keeps, and all states and transitions as they were seen.
"""

from __future__ import annotations

from collections.abc import Sequence

from gentamp_lp.abstraction.observations import observation_facts
from gentamp_lp.abstraction.theory import Theory
from gentamp_lp.base.bitsets import bits
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import LimitReached
from gentamp_lp.solvers.asp import GroundProgram

LARGEST = 3_000_000  # instances of the longest rules: some 40 seconds and 1.5 GB


def reference_program(theory: Theory, improve: tuple[int, int] | None, options: Sequence[str]) -> GroundProgram:
    """Return the grounded program, whose answers are those of `asp/abstraction.lp`.

    Raises LimitReached when there are too many data for it.
    """
    _require_small(theory)
    files = [resource("asp", "reference.lp")]
    facts = observation_facts(theory.observations, theory.features) + "#project selected/1.\n"
    if improve is not None:
        files += [resource("asp", "abstraction", name) for name in ("improve.lp", "forbid.lp")]
        known = [theory.observations.features[i] for i in bits(theory.features)]
        facts += "".join(f"feature({feature.id},{feature.cost}).\n" for feature in known)
        facts += f"cheaper_than({improve[0]}). deeper_than({improve[1]}).\n"
    constants = (f"fairness={theory.fairness.replace('-', '_')}", f"unseen={theory.unseen}")
    return GroundProgram(
        files, facts, options=[*options, *(part for constant in constants for part in ("-c", constant))]
    )


def _require_small(theory: Theory) -> None:
    features, states = theory.features.bit_count(), len(theory.observations.states)
    expanded = len(theory.observations.candidates)
    rounds = min(theory.numeric.bit_count(), expanded)  # of SIEVE, see asp/reference/termination.lp
    if features * states**2 + rounds * expanded**3 > LARGEST:
        raise LimitReached(
            f"too much for the reference program: {features} features, {states} states, {expanded} of them expanded; "
            "train on smaller problems, lower --max-complexity, or leave out --program reference"
        )
