"""Policies for QNP and FOND problems: reading, synthesis, certificate and its check.

problem.py       what all formats become: a graph of states and choices, with conditional fairness
facts.py         `.lp` files of facts, with the line of each
reading.py       graph facts, QNP facts, PDDL: which format, and how it becomes a problem
fond.py          PDDL with `oneof`, made propositional
solving.py       the program `asp/synthesis.lp` and termination as lazy clauses
explaining.py    why there is no policy
certificate.py   what `--out` writes, and its check
"""

from gentamp_lp.synthesis.problem import Choice, Problem
from gentamp_lp.synthesis.reading import read_problem
from gentamp_lp.synthesis.solving import Synthesis, synthesize

__all__ = ["Choice", "Problem", "Synthesis", "read_problem", "synthesize"]
