"""Two boxes of width 1 stand on a shelf of width 2.5 without overlapping."""

import random
import sys
from pathlib import Path

from gentamp_lp.streams import And, Exists, PDDLProblem, from_gen_fn, from_test, solve

DOMAIN = """
(define (domain shelf)
  (:types box)
  (:predicates (Spot ?b - box ?x) (Apart ?b1 ?x1 ?b2 ?x2) (On ?b - box ?x) (Taken ?b ?x))
  (:action put :parameters (?b - box ?x)
    :precondition (and (Spot ?b ?x) (not (Taken ?b ?x)))
    :effect (and (On ?b ?x) (increase (total-cost) 2)))
  (:derived (Taken ?b ?x)
    (exists (?b2 ?x2) (and (Spot ?b ?x) (Spot ?b2 ?x2) (On ?b2 ?x2) (not (Apart ?b ?x ?b2 ?x2))))))
"""
STREAMS = """
(define (stream shelf)
  (:stream spot :inputs (?b - box) :outputs (?x) :certified (Spot ?b ?x))
  (:stream apart :inputs (?b1 ?x1 ?b2 ?x2) :domain (and (Spot ?b1 ?x1) (Spot ?b2 ?x2))
    :certified (Apart ?b1 ?x1 ?b2 ?x2)))
"""

rng = random.Random(0)


def spots(box):
    while True:
        yield (rng.uniform(0.0, 1.5),)


functions = {"spot": from_gen_fn(spots), "apart": from_test(lambda b1, x1, b2, x2: abs(x1 - x2) >= 1)}
init = [("box", "red"), ("box", "blue")]
goal = And(Exists(["?x"], ("On", "red", "?x")), Exists(["?x"], ("On", "blue", "?x")))
result = solve(PDDLProblem(DOMAIN, {}, STREAMS, functions, init, goal), max_time=30)

plan, cost, certificate = result
print(cost, [action.name for action in plan])
print(result.status, result.report.streams["spot"].calls > 0)

if len(sys.argv) > 1:  # a picture of the plan
    boxes = "".join(
        f'<rect x="{10 + 100 * x}" y="10" width="100" height="60" fill="{box}" fill-opacity="0.7"/>'
        for _, (box, x) in plan
    )
    shelf = '<rect x="10" y="70" width="250" height="8" fill="#44546a"/>'
    picture = f'<svg xmlns="http://www.w3.org/2000/svg" width="270" height="90">{boxes}{shelf}</svg>\n'
    Path(sys.argv[1]).write_text(picture, encoding="utf-8")
