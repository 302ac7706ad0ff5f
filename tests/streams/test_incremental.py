"""The incremental algorithm on things that move along a line, with axioms over negated tests.

Blocks have positions; a position is `red` when a test on the number says so. The cases are the ones that PDDLStream's
optimistic algorithms get wrong: derived predicates that need a test to fail, directly or through another axiom.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from helpers.pace import at_most

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.streams import downward
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.incremental import quota_for, sample, simulate, solve_incremental
from gentamp_lp.streams.language import from_gen_fn, from_test
from gentamp_lp.streams.pddl import parse_domain, parse_formula
from gentamp_lp.streams.semantics import Program, View
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.streams.stream_file import parse_streams

DOMAIN = """(define (domain line)
  (:predicates (Block ?b) (Pose ?b ?p) (Red ?b ?p) (CFree ?b ?p ?b2 ?p2)
               (AtPose ?b ?p) (Holding ?b) (HandEmpty) (Done)
               (Unsafe ?b ?p) (AllRed) (NotAll) (Bad ?b) (Any) (SomePale))
  (:action pick :parameters (?b ?p)
    :precondition (and (Block ?b) (Pose ?b ?p) (AtPose ?b ?p) (HandEmpty))
    :effect (and (Holding ?b) (not (AtPose ?b ?p)) (not (HandEmpty))))
  (:action place :parameters (?b ?p)
    :precondition (and (Block ?b) (Pose ?b ?p) (Holding ?b) (not (Unsafe ?b ?p)))
    :effect (and (AtPose ?b ?p) (HandEmpty) (not (Holding ?b))))
  (:action finish :parameters ()
    :precondition (and (HandEmpty) CONDITION)
    :effect (Done))
  (:derived (Unsafe ?b ?p)
    (exists (?b2 ?p2) (and (Pose ?b ?p) (AtPose ?b2 ?p2) (not (CFree ?b ?p ?b2 ?p2)))))
  (:derived (AllRed) (forall (?b ?p) (imply (AtPose ?b ?p) (Red ?b ?p))))
  (:derived (NotAll) (exists (?b ?p) (and (AtPose ?b ?p) (not (Red ?b ?p)))))
  (:derived (Bad ?b) (exists (?p) (and (AtPose ?b ?p) (not (Red ?b ?p)))))
  (:derived (Any) (exists (?b) (Bad ?b)))
  (:derived (SomePale) (exists (?b ?p) (and (AtPose ?b ?p) (not (Red ?b ?p))))))"""

STREAMS = """(define (stream line)
  (:stream sample-pose :inputs (?b) :domain (Block ?b) :outputs (?p) :certified (Pose ?b ?p))
  (:stream t-red :inputs (?b ?p) :domain (Pose ?b ?p) :certified (Red ?b ?p))
  (:stream t-cfree :inputs (?b ?p ?b2 ?p2) :domain (and (Pose ?b ?p) (Pose ?b2 ?p2))
    :certified (CFree ?b ?p ?b2 ?p2)))"""


@dataclass
class Line:
    """A problem whose blocks stand at 0, 2, 4, ...; red is what lies beyond 10."""

    condition: str
    blocks: int = 2
    positions: tuple[float, ...] = (1.0, 11.0, 11.5, 12.5)
    tested: set[tuple[str, float]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.domain = parse_domain(DOMAIN.replace("CONDITION", self.condition))
        streams = parse_streams(STREAMS, self.domain)
        names = [f"b{i}" for i in range(self.blocks)]
        values: dict[str, object] = {name: name for name in names}
        values |= {f"at-{name}": 2.0 * i for i, name in enumerate(names)}
        facts = [f for n in names for f in (("block", n), ("pose", n, f"at-{n}"))]

        def red(name: str, position: float) -> bool:
            self.tested.add((name, position))
            return position > 10

        generators = {
            "sample-pose": from_gen_fn(lambda _: ((p,) for p in self.positions)),
            "t-red": from_test(red),
            "t-cfree": from_test(lambda a, p, b, q: a == b or abs(p - q) >= 1),
        }
        self.base = FactBase(self.domain, streams, generators, values, infer_sorts(self.domain, streams, facts))
        for fact in facts:
            self.base.add(fact)
        self.state = frozenset([("handempty",), *(("atpose", n, f"at-{n}") for n in names)])
        self.program = Program.of(self.domain)
        self.goal = parse_formula("(Done)", self.domain)

    def solve(self, **options: object) -> list[tuple[str, ...]]:
        options = {"quota": {}, "time_limit": 60.0, **options}
        plan = solve_incremental(self.program, self.base, self.state, self.goal, **options)  # type: ignore[arg-type]
        self.check(plan)
        return [(s.schema, *s.args) for s in plan]

    def check(self, plan: list) -> None:
        """Follow the plan with numbers only, apart from the engine's logic."""
        at = {f"b{i}": 2.0 * i for i in range(self.blocks)}
        held = None
        for name, args in plan:
            if name == "pick":
                assert held is None and at.pop(args[0]) == self.base.values[args[1]]
                held = args[0]
            elif name == "place":
                here = self.base.values[args[1]]
                assert held == args[0] and all(abs(here - there) >= 1 for there in at.values())
                at[args[0]], held = here, None
            else:
                self.final = at
                assert held is None
        assert simulate(self.program, self.base, self.state, plan) is not None
        assert plan[-1][0] == "finish"


RED_CONDITIONS = {
    "A: an axiom with forall and imply": "(AllRed)",
    "B: a negated axiom over a negated test": "(not (NotAll))",
    "C: two levels of axioms": "(not (Any))",
    "D: both": "(AllRed) (not (Any))",
    "G: forall in the precondition": "(forall (?b ?p) (imply (AtPose ?b ?p) (Red ?b ?p)))",
}


@pytest.mark.parametrize("condition", RED_CONDITIONS.values(), ids=[k.split(":")[0] for k in RED_CONDITIONS])
def test_everything_is_moved_until_the_tests_hold(condition: str) -> None:
    line = Line(condition)
    plan = line.solve()
    assert len(plan) == 5
    assert all(position > 10 for position in line.final.values())
    assert {(name, p) for name, p in line.final.items()} <= line.tested  # no test is assumed to succeed


def test_a_test_that_has_to_fail() -> None:
    """F: nothing needs to be done when some block is pale already, and one has to go back when none is."""
    assert Line("(SomePale)").solve() == [("finish",)]
    line = Line("(SomePale)")
    line.base.values |= {"at-b0": 20.0, "at-b1": 30.0}
    line.check = lambda plan: None  # type: ignore[method-assign]  # it knows other initial places
    assert [step[0] for step in line.solve()] == ["pick", "place", "finish"]


def test_collisions_count_while_tests_are_satisfied() -> None:
    """E, H: the two first red places are too close together for two blocks."""
    line = Line("(AllRed)", blocks=3, positions=(11.0, 11.5, 12.5, 14.0))
    line.solve()
    assert sorted(line.final.values()) != [11.0, 11.5, 12.5]


@pytest.mark.parametrize("blocks", [1, 2, 3])
def test_exhausted_streams_give_no_answer(blocks: int) -> None:
    line = Line("(AllRed)", blocks=blocks, positions=(1.0, 3.0))
    with pytest.raises(NoAnswer, match="exhausted"):
        line.solve()
    calls = line.base.statistics["sample-pose"]
    assert (calls.calls, calls.successes) == (3 * blocks, 2 * blocks)


def test_levels_end_the_search_on_endless_streams() -> None:
    def forever(_: str) -> Iterator[tuple[float]]:
        while True:
            yield (1.0,)

    line = Line("(AllRed)")
    line.base.generators["sample-pose"] = from_gen_fn(forever)  # type: ignore[index]
    told: list[str] = []
    with pytest.raises(NoAnswer, match="within 3 levels"):
        line.solve(max_levels=3, progress=told.append)
    assert len(told) == 3


def test_failed_attempts_are_not_the_end() -> None:
    line = Line("(AllRed)", blocks=1)
    line.base.generators["sample-pose"] = from_gen_fn(lambda _: iter([None, None, (11.0,)]))  # type: ignore[index]
    assert len(line.solve()) == 3


def test_an_unsatisfiable_goal_without_streams() -> None:
    line = Line("(AllRed)", blocks=1, positions=())
    with pytest.raises(NoAnswer, match="exhausted after 1 level"):
        line.solve()


@pytest.mark.parametrize("limit", [0.0, 0.2])
def test_time_limit_while_sampling(limit: float) -> None:
    line = Line("(AllRed)")

    def slow(_: str) -> Iterator[tuple[float]]:
        while True:
            time.sleep(0.05)
            yield (1.0,)

    line.base.generators["sample-pose"] = from_gen_fn(slow)  # type: ignore[index]
    with at_most(limit, starts=100), pytest.raises(LimitReached, match="time limit"):
        line.solve(time_limit=limit, quota={"sample-pose": 1000})


def test_quota_is_what_is_asked_for() -> None:
    line = Line("(AllRed)", blocks=2)
    sample(line.base, {"sample-pose": 3}, time.monotonic() + 60)
    assert line.base.statistics["sample-pose"].calls == 6
    assert len(line.base.relation("pose")) == 2 + 6
    assert not sample(line.base, {"sample-pose": 3}, time.monotonic() + 60)
    assert quota_for(line.base, ["pose"], {"sample-pose": 7}) == {"sample-pose": 7, "t-red": 0, "t-cfree": 0}
    assert quota_for(line.base, ["block"], {"sample-pose": 7})["sample-pose"] == 0


def test_constants_in_a_streams_conditions_are_constants() -> None:
    domain = parse_domain(
        "(define (domain d) (:constants red) (:predicates (Kind ?o ?k) (Spot ?o ?x) (Twin ?a ?b))"
        " (:action go :parameters (?o ?x) :precondition (Spot ?o ?x) :effect (and)))"
    )
    streams = parse_streams(
        """(define (stream d)
        (:stream s :inputs (?o) :domain (and (Kind ?o red) (Twin ?o ?o)) :outputs (?x) :certified (Spot ?o ?x)))""",
        domain,
    )
    base = FactBase(domain, streams, {"s": from_gen_fn(lambda _: iter([(1,)]))}, dict.fromkeys(["a", "b", "c", "red"]))
    for fact in (("kind", "a", "red"), ("kind", "b", "blue"), ("kind", "c", "red"), ("twin", "a", "a"),
                 ("twin", "b", "b"), ("twin", "c", "a")):  # fmt: skip
        base.add(fact)
    assert base.inputs(streams[0]) == [("a",)]
    sample(base, {}, time.monotonic() + 60)
    assert [row[0] for row in base.relation("spot").rows] == ["a"]


def test_a_test_is_asked_again_once_its_conditions_are_certified() -> None:
    line = Line("(AllRed)", blocks=1)
    line.base.values["p9"] = 15.0
    assert not line.base.truth("red", ("b0", "p9"))  # p9 is no pose of b0 yet, so the test may not even run
    assert not line.tested and list(line.base.refuted("red")) == []
    line.base.add(("pose", "b0", "p9"))
    assert line.base.truth("red", ("b0", "p9"))


def test_states_are_judged_alike_by_views_and_by_fast_downward() -> None:
    """Each condition, in each state in reach: `finish` alone is a plan exactly when the view says so."""
    for condition in (*RED_CONDITIONS.values(), "(SomePale)"):
        line = Line(condition, blocks=1, positions=(1.0, 11.0))
        sample(line.base, {"sample-pose": 2}, time.monotonic() + 60)
        for (pose,) in [(p,) for _, p in line.base.relation("pose").rows]:
            state = frozenset([("handempty",), ("atpose", "b0", pose)])
            view = View(line.program, line.base, state)
            possible = view.holds(line.program.preconditions["finish"])
            plan = downward.search(line.program, line.base, state, line.goal, time_limit=20)
            assert plan is not None
            assert (len(plan) == 1) == possible, (condition, pose)


def test_trimming_forgets_later_samples_but_not_what_is_needed() -> None:
    line = Line("(AllRed)")
    base, (stream, *_) = line.base, line.base.streams
    sample(base, {"sample-pose": 4}, float("inf"))
    drawn = {b: [p for b2, p in base.relation("pose").rows if b2 == b and p in base.made_by] for b in ("b0", "b1")}
    assert base.truth("red", ("b0", drawn["b0"][3])) and not base.truth("red", ("b0", drawn["b0"][0]))
    trimmed = base.trimmed({"sample-pose": 1}, [drawn["b0"][3]])
    kept = [p for _, p in trimmed.relation("pose").rows if p in base.made_by]
    assert kept == [drawn["b0"][0], drawn["b0"][3], drawn["b1"][0]]
    assert ("b0", drawn["b0"][3]) in trimmed.relation("red").rows
    assert len(base.relation("pose")) == 2 + 8  # the original is as it was
    assert not sample(trimmed, {"sample-pose": 1}, float("inf"))  # one draw each has been made
    assert trimmed.drawn(stream, ("b0",)) == 1
    assert trimmed.new_name("p") not in base.values
