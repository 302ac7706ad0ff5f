"""What a policy may assume of its nondeterministic outcomes."""

from __future__ import annotations

from typing import Literal, get_args

Fairness = Literal["strong", "qnp", "strong-cyclic"]
"""`strong`: nothing, no run loops. `qnp`: a count that falls for ever and rises only finitely often reaches zero.
`strong-cyclic`: each outcome of an endlessly repeated step happens some day."""

LEVELS: tuple[Fairness, ...] = get_args(Fairness)
"""Strongest first."""

Unseen = Literal["drop", "refuse"]
"""What to make of outcomes of falling counts that no seen state shows: `drop` them, or `refuse` the policy."""

ProgramName = Literal["lazy", "reference"]
"""The ASP program that selects features: `asp/abstraction.lp` with lazy clauses, or `asp/reference.lp`; same answer."""
