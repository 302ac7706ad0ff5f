"""Continuous pick and place for the streams engine: blocks on a line or a plane, and a checker that knows only numbers.

Blocks are squares of width 2. The robot is a point that moves freely and holds a block by its centre or, on the line,
half a unit beside it. `regions` are intervals (of squares on the plane: both coordinates).
"""

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

from gentamp_lp.streams import And, PDDLProblem, from_fn, from_gen_fn, from_test

DOMAIN = """(define (domain pick-and-place)
  (:requirements :typing)
  (:types block region spot grip conf)
  (:predicates (Pose ?b - block ?p - spot) (Grasp ?b - block ?g - grip) (Conf ?q - conf)
    (Contain ?b ?p ?r) (Kin ?b ?p ?g ?q) (Motion ?q1 ?t ?q2) (CFree ?b1 ?p1 ?b2 ?p2) (Clear ?b1 ?p1 ?b2 ?p2)
    (Placeable ?b ?r) (AtPose ?b ?p) (AtGrasp ?b ?g) (AtConf ?q) (HandEmpty) (CanMove)
    (In ?b ?r) (Unsafe ?b ?p) (Blocked ?b ?p))
  (:functions (Distance ?q1 ?q2))
  (:action move :parameters (?q1 ?t ?q2)
    :precondition (and (Motion ?q1 ?t ?q2) (AtConf ?q1) (CanMove))
    :effect (and (AtConf ?q2) (not (AtConf ?q1)) (not (CanMove)) (increase (total-cost) (Distance ?q1 ?q2))))
  (:action pick :parameters (?b - block ?p - spot ?g - grip ?q - conf)
    :precondition (and (Kin ?b ?p ?g ?q) (AtConf ?q) (AtPose ?b ?p) (HandEmpty) (not (Blocked ?b ?p)))
    :effect (and (AtGrasp ?b ?g) (CanMove) (not (AtPose ?b ?p)) (not (HandEmpty)) (increase (total-cost) 1)))
  (:action place :parameters (?b - block ?p - spot ?g - grip ?q - conf)
    :precondition (and (Kin ?b ?p ?g ?q) (AtConf ?q) (AtGrasp ?b ?g) (not (Unsafe ?b ?p)))
    :effect (and (AtPose ?b ?p) (HandEmpty) (CanMove) (not (AtGrasp ?b ?g)) (increase (total-cost) 1)))
  (:derived (In ?b ?r) (exists (?p) (and (Contain ?b ?p ?r) (AtPose ?b ?p))))
  (:derived (Unsafe ?b ?p)
    (exists (?b2 ?p2) (and (Pose ?b ?p) (Pose ?b2 ?p2) (AtPose ?b2 ?p2) (not (CFree ?b ?p ?b2 ?p2)))))
  (:derived (Blocked ?b ?p)
    (exists (?b2 ?p2) (and (Pose ?b ?p) (Pose ?b2 ?p2) (AtPose ?b2 ?p2) (not (Clear ?b ?p ?b2 ?p2))))))"""

STREAMS = """(define (stream pick-and-place)
  (:stream s-region :inputs (?b ?r) :domain (Placeable ?b ?r) :outputs (?p - spot)
    :certified (and (Contain ?b ?p ?r) (Pose ?b ?p)))
  (:stream s-grasp :inputs (?b - block) :outputs (?g - grip) :certified (Grasp ?b ?g))
  (:stream s-ik :inputs (?b ?p ?g) :domain (and (Pose ?b ?p) (Grasp ?b ?g)) :outputs (?q - conf)
    :certified (Kin ?b ?p ?g ?q))
  (:stream s-motion :inputs (?q1 - conf ?q2 - conf) :outputs (?t) :certified (Motion ?q1 ?t ?q2))
  (:stream t-cfree :inputs (?b1 ?p1 ?b2 ?p2) :domain (and (Pose ?b1 ?p1) (Pose ?b2 ?p2))
    :certified (CFree ?b1 ?p1 ?b2 ?p2))
  (:stream t-clear :inputs (?b1 ?p1 ?b2 ?p2) :domain (and (Pose ?b1 ?p1) (Pose ?b2 ?p2))
    :certified (Clear ?b1 ?p1 ?b2 ?p2))
  (:function (Distance ?q1 ?q2) (and (Conf ?q1) (Conf ?q2))))"""

WIDTH = 2.0
Place = tuple[float, ...]


@dataclass(frozen=True)
class At:
    """A pose; equal only to itself."""

    where: Place
    number: object = field(default_factory=object)


@dataclass
class Tamp:
    """A scene: where blocks stand, where they have to be, and which block stands in the way of grasping another."""

    start: dict[str, Place]
    regions: dict[str, tuple[Place, Place]]
    goal: dict[str, str]
    seed: int = 0
    shadows: dict[str, str] = field(
        default_factory=dict
    )  # a block cannot be picked while its shadow stands where it is

    def problem(self) -> PDDLProblem:
        rng = random.Random(self.seed)
        poses = {b: At(where) for b, where in self.start.items()}
        home = ("home",)
        init: list[tuple[object, ...]] = [("HandEmpty",), ("CanMove",), ("Conf", home), ("AtConf", home)]
        for b, p in poses.items():
            init += [("block", b), ("spot", p), ("Pose", b, p), ("AtPose", b, p)]
            init += [("Placeable", b, r) for r in self.regions if r == "table" or self.goal.get(b) == r]

        def placements(_: str, region: str) -> Iterator[tuple[At]]:
            low, high = self.regions[region]
            while True:
                yield (At(tuple(rng.uniform(a + WIDTH / 2, b - WIDTH / 2) for a, b in zip(low, high, strict=True))),)

        def clear(b: str, p: At, b2: str, p2: At) -> bool:
            return not (self.shadows.get(b) == b2 and p.where == self.start[b] and p2.where == self.start[b2])

        streams = {
            "s-region": from_gen_fn(placements),
            "s-grasp": from_fn(lambda b: (("grasp", b),)),
            "s-ik": from_fn(lambda b, p, g: (("conf", b, p),)),
            "s-motion": from_fn(lambda q, q2: (("path", q, q2),)),
            "t-cfree": from_test(lambda b, p, b2, p2: b == b2 or apart(p.where, p2.where)),
            "t-clear": from_test(clear),
            "distance": lambda q, q2: 1.0 + (q == q2),
        }
        goal = And(*[("In", b, r) for b, r in self.goal.items()], ("HandEmpty",))
        return PDDLProblem(DOMAIN, {}, STREAMS, streams, init, goal)

    def check(self, plan: list[tuple[str, tuple]]) -> None:
        """Follow a plan with numbers only."""
        at, held, here, moved = dict(self.start), None, ("home",), False
        for name, args in plan:
            if name == "move":
                assert args[0] == here and not moved and args[1] == ("path", args[0], args[2])
                here, moved = args[2], True
                continue
            block, place, grasp, conf = args
            assert conf == here == ("conf", block, place) and grasp == ("grasp", block)
            moved = False
            if name == "pick":
                assert held is None and at[block] == place.where
                shadow = self.shadows.get(block)
                assert at[block] != self.start[block] or shadow is None or at.get(shadow) != self.start[shadow]
                del at[block]
                held = block
            else:
                assert held == block and all(apart(place.where, other) for other in at.values())
                at[block], held = place.where, None
        assert held is None
        for block, region in self.goal.items():
            for x, low, high in zip(at[block], *self.regions[region], strict=True):
                assert low + WIDTH / 2 <= x <= high - WIDTH / 2


def apart(a: Place, b: Place) -> bool:
    """Whether two blocks do not overlap."""
    return any(abs(x - y) >= WIDTH for x, y in zip(a, b, strict=True))


def line(n: int, *, slack: float, goals: int | None = None, shadows: int = 0, seed: int = 0) -> Tamp:
    """Blocks on a line that (all, or the first `goals`) go into a region `slack` units wide for each of them."""
    start = {f"b{i}": (-4.0 * i - 4.0,) for i in range(n)}
    goals = n if goals is None else goals
    regions = {"table": ((-8.0 * n - 40.0,), (0.0,)), "red": ((4.0,), (4.0 + slack * goals,))}
    goal = {f"b{i}": "red" for i in range(goals)}
    return Tamp(start, regions, goal, seed, {f"b{i}": f"b{n - 1 - i}" for i in range(shadows)})


def plane(n: int, *, fill: float, seed: int = 0) -> Tamp:
    """Blocks on a plane that go into a square of which they fill this share."""
    start = {f"b{i}": (-4.0 * (i % 8) - 4.0, -4.0 * (i // 8) - 4.0) for i in range(n)}
    side = (n * WIDTH * WIDTH / fill) ** 0.5
    regions = {"table": ((-60.0, -60.0), (0.0, 0.0)), "red": ((4.0, 4.0), (4.0 + side, 4.0 + side))}
    return Tamp(start, regions, dict.fromkeys(start, "red"), seed)
