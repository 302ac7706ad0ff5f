"""The PDDLStream entry point: its language, its helpers, its constraints, its answers."""

import itertools
import math
import re
import threading
import warnings

import numpy as np
import pytest

import gentamp_lp.streams as streams
from gentamp_lp.errors import InputError, SolverError
from gentamp_lp.streams import (
    ALGORITHMS,
    INF,
    PLANNERS,
    WILD,
    And,
    Equal,
    Exists,
    Forall,
    FunctionInfo,
    Imply,
    Not,
    Or,
    OrderedSkeleton,
    PartialInputs,
    PDDLProblem,
    PlanConstraints,
    StreamInfo,
    Type,
    WildOutput,
    from_constant,
    from_fn,
    from_gen,
    from_gen_fn,
    from_list_fn,
    from_list_gen_fn,
    from_sampler,
    from_test,
    negate_test,
    print_solution,
    solve,
    solve_adaptive,
    solve_binding,
    solve_focused,
    solve_incremental,
)

TRAVEL = """(define (domain travel)
  (:requirements :typing :action-costs)
  (:types city vehicle - object car train - vehicle)
  (:constants home - city)
  (:predicates (At ?c - city) (Road ?a ?b - city) (Fast ?v - vehicle) (Visited ?c) (Ticket))
  (:functions (Distance ?a ?b) - number (total-cost) - number)
  (:action drive :parameters (?v - car ?a ?b - city)
    :precondition (and (At ?a) (Road ?a ?b))
    :effect (and (At ?b) (not (At ?a)) (Visited ?b) (increase (total-cost) (Distance ?a ?b))))
  (:action ride :parameters (?v - train ?a ?b - city)
    :precondition (and (At ?a) (Ticket))
    :effect (and (At ?b) (not (At ?a)) (Visited ?b) (not (Ticket)) (increase (total-cost) 0.5)))
  (:action buy :parameters () :precondition (not (Ticket))
    :effect (and (Ticket) (forall (?c - city) (when (Visited ?c) (not (Visited ?c)))) (increase (total-cost) 7))))"""

HOME, ROME, OSLO = "home", ("Rome", 41.9), frozenset({"Oslo"})
INIT = [
    ("car", 4), ("train", 5.5), ("city", ROME), ("city", OSLO), ("At", HOME), ("Road", HOME, ROME),
    ("Road", ROME, OSLO),
    Equal(("Distance", HOME, ROME), 2), Equal(("Distance", ROME, OSLO), 3.25), Equal(("total-cost",), 0),
]  # fmt: skip


def travel(goal: object, init: list = INIT) -> PDDLProblem:
    return PDDLProblem(TRAVEL, {}, None, {}, init, goal)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_types_costs_and_values(algorithm: str) -> None:
    """Objects are any Python values; a supertype holds of the objects of its subtypes; costs are added up."""
    plan, cost, certificate = solve(travel(("At", OSLO)), algorithm, planner="max-astar")
    assert plan == [("drive", (4, HOME, ROME)), ("drive", (4, ROME, OSLO))] and cost == 5.25
    assert ("vehicle", 4) in certificate.all_facts and ("road", HOME, ROME) in certificate.preimage_facts
    assert ("train", 5.5) not in certificate.preimage_facts
    result = solve(travel(("At", OSLO)), algorithm, unit_costs=True, planner="max-astar")
    assert result.cost == len(result.plan) == 2


def test_the_cost_of_a_plan_is_bounded() -> None:
    assert solve(travel(("At", OSLO)), max_cost=5.25).cost == 5.25
    for result in (
        solve(travel(("At", OSLO)), max_cost=5.2),
        solve(travel(("At", OSLO)), constraints=PlanConstraints(max_cost=5.2)),
    ):
        assert result.status == "no plan" and result.plan is None and result.cost == INF
    assert solve(travel(("At", OSLO), [*INIT, ("Ticket",)]), success_cost=1.0).cost == 0.5
    assert solve(travel(("At", OSLO), [*INIT, ("Ticket",)]), max_cost=0.6).cost == 0.5


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        (And(("At", ROME), Not(("Visited", ROME))), 2),
        (Or(("At", OSLO), ("At", ROME)), 1),
        (Imply(("At", HOME), ("Ticket",)), 1),
        (Exists(["?c"], And(("At", "?c"), Not(Equal("?c", HOME)))), 1),
        (Exists([Type("?v", "vehicle")], ("At", ROME)), 1),
        (Forall([Type("?c", "city")], Or(("Visited", "?c"), Equal("?c", HOME))), 2),
        (("at", HOME), 0),
    ],
)
def test_goals(goal: object, length: int) -> None:
    result = solve(travel(goal), planner="dijkstra", unit_costs=True)
    assert len(result.plan) == length


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[] if n in ("ff-astar2", "ff-ehc", "cea-wastar1") else pytest.mark.slow) for n in PLANNERS],
)
def test_every_planner_name_is_understood(name: str) -> None:
    assert [a.name for a in solve(travel(("At", OSLO)), planner=name).plan][-1:] in (["drive"], ["ride"])


def test_a_planner_that_fails_is_not_an_answer() -> None:
    with pytest.raises(SolverError, match="code 3"):
        solve(travel(("At", OSLO)), planner="no_such_search()")


SHELF = """(define (domain shelf)
  (:predicates (Item ?i) (Spot ?i ?x) (Stable ?i ?x) (On ?i ?x) (Near ?x ?y) (Seen ?x) (Linked ?x ?y) (Good ?x))
  (:functions (Height ?x))
  (:action put :parameters (?i ?x) :precondition (and (Spot ?i ?x) (Stable ?i ?x) (not (exists (?j) (On ?j ?x))))
    :effect (and (On ?i ?x) (increase (total-cost) (Height ?x))))
  (:action look :parameters (?x ?y) :precondition (and (Linked ?x ?y) (Good ?y)) :effect (Seen ?y)))"""
SHELF_STREAMS = """(define (stream shelf)
  (:stream spots :inputs (?i) :domain (Item ?i) :outputs (?x) :certified (Spot ?i ?x))
  (:predicate (Stable ?i ?x) (Spot ?i ?x))
  (:stream t-near :inputs (?i ?x ?j ?y) :domain (and (Spot ?i ?x) (Spot ?j ?y)) :certified (Near ?x ?y))
  (:stream good :inputs (?i ?x) :domain (Spot ?i ?x) :certified (Good ?x))
  (:rule :inputs (?x ?y) :domain (Near ?x ?y) :certified (Linked ?x ?y))
  (:rule :inputs (?x ?y ?z) :domain (and (Linked ?x ?y) (Linked ?y ?z)) :certified (Linked ?x ?z))
  (:function (Height ?x) (and (Good ?x)))
  (:function (Unused ?x) (Good ?x)))"""


def shelf(goal: object, spots: object, **changes: object) -> PDDLProblem:
    functions = {
        "spots": spots, "stable": lambda i, x: x != 3, "t-near": from_test(lambda i, x, j, y: y - x == 1),
        "GOOD": from_test(lambda i, x: x != 4), "height": lambda x: abs(x), "unused": lambda x: 0.0, **changes,
    }  # fmt: skip
    return PDDLProblem(SHELF, {}, [SHELF_STREAMS], functions, [("Item", "a"), ("Item", "b")], goal)


@pytest.mark.parametrize(
    "spots",
    [
        from_list_fn(lambda i: [(n,) for n in range(3, 7)]),
        from_gen_fn(lambda i: ((n,) if n % 3 != 1 else None for n in range(3, 9))),
        from_gen([(3,), (5,), (6,)]),
        from_gen((n,) for n in itertools.count(3)),
        from_list_fn(lambda i: WildOutput([(3,), (5,), (6,)], [("Good", 9)])),
        from_list_gen_fn(lambda i: iter([[], [(3,), (4,)], [(5,), (6,)], []])),
        lambda i: iter([[(3,)], WildOutput([(5,)], [("Good", 9)]), [(6,)]]),
        from_sampler(lambda i, rows=[(3,), None, (6,), (5,), (7,)] * 50: rows.pop(0) if rows else None, 200),
    ],
    ids=["list_fn", "gen_fn", "gen", "endless gen", "wild list_fn", "list_gen_fn", "raw and wild", "sampler"],
)  # fmt: skip
def test_streams_rules_predicates_and_functions(spots: object) -> None:
    check_shelf("adaptive", spots)


def check_shelf(algorithm: str, spots: object) -> None:
    goal = And(("On", "a", 6), Exists(["?x"], ("On", "b", "?x")))
    result = solve(shelf(goal, spots), algorithm, max_time=30)
    assert result.status == "solved", str(result.report)
    at = {a.args[0]: a.args[1] for a in result.plan if a.name == "put"}
    assert at["a"] == 6 and at["b"] in (5, 7, 8) and result.cost == 6 + at["b"]


def test_streams_rules_predicates_and_functions_incrementally() -> None:
    check_shelf("incremental", from_list_fn(lambda i: [(n,) for n in range(3, 7)]))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_rules_are_chained(algorithm: str) -> None:
    """5 is linked to 7 by way of 6 only, and equal outputs of two streams are one object."""
    result = solve(shelf(("Seen", 7), from_list_fn(lambda i: [(5,), (6,), (7,)])), algorithm, max_time=30)
    assert result.status == "solved", str(result.report)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_tests_may_certify_what_their_conditions_speak_of(algorithm: str) -> None:
    """One says what was known before, another turns its condition round."""
    more = """(:stream again :inputs (?i ?x) :domain (Spot ?i ?x) :certified (Spot ?i ?x))
      (:stream turned :inputs (?x ?y) :domain (Linked ?x ?y) :certified (Linked ?y ?x)))"""
    problem = shelf(("Seen", 5), from_list_fn(lambda i: [(5,), (6,), (8,)]), again=from_test(lambda i, x: x != 5))
    problem.stream_map["turned"] = from_test(lambda x, y: True)
    for files in (SHELF_STREAMS[:-1] + more, [SHELF_STREAMS, "(define (stream more) " + more]):
        result = solve(problem._replace(stream_pddl=files), algorithm, max_time=30)
        assert [(a.name, a.args[1]) for a in result.plan] == [("look", 5)], str(result.report)


def test_constant_and_wild_streams() -> None:
    assert solve(shelf(("On", "a", 8), from_constant((8,)))).cost == 8
    assert solve(shelf(("On", "a", 3), from_constant((3,)))).status == "no plan"  # not stable
    assert solve(shelf(("On", "a", 3), from_constant((3,)), stable=negate_test(lambda i, x: x != 3))).cost == 3
    wild = from_fn(lambda i: WildOutput([(4,)], [("Good", 4), ("Linked", 4, 4)]))
    assert solve(shelf(("Seen", 4), wild)).status == "solved"
    wrong = from_fn(lambda i: WildOutput([(4,)], [("Goood", 4)]))
    with pytest.raises(InputError, match="Goood"):
        solve(shelf(("On", "a", 4), wrong))
    with pytest.raises(InputError, match="not a tuple of 1 output"):
        solve(shelf(("On", "a", 4), from_constant((4, 4))))
    for value, message in ((-1, "numbers from 0"), (math.nan, "numbers from 0"), ("far", "not a number")):
        with pytest.raises(InputError, match=message):
            solve(shelf(("On", "a", 8), from_constant((8,)), height=lambda x, value=value: value))


def test_values_that_cannot_be_hashed_are_themselves() -> None:
    """Two equal arrays are two objects; an array of the initial facts can be named in the goal."""
    target, twin = np.zeros(2), np.zeros(2)
    domain = """(define (domain d) (:predicates (Conf ?q) (At ?q) (Step ?a ?b))
      (:action go :parameters (?a ?b) :precondition (and (At ?a) (Step ?a ?b)) :effect (and (At ?b) (not (At ?a)))))"""
    init = [("Conf", target), ("Conf", twin), ("At", twin)]
    text = (
        "(define (stream s) (:stream next :inputs (?a ?b) :domain (and (Conf ?a) (Conf ?b)) :certified (Step ?a ?b)))"
    )
    result = solve(PDDLProblem(domain, {}, text, {"next": from_test(lambda a, b: True)}, init, ("At", target)))
    assert len(result.plan) == 1 and result.plan[0].args[0] is twin and result.plan[0].args[1] is target


def test_constants_have_the_values_given() -> None:
    domain = """(define (domain d) (:constants @sink) (:predicates (At ?x)) (:action go :effect (At @sink)))"""
    sink = [1, 2]
    assert len(solve(PDDLProblem(domain, {"@sink": sink}, None, {}, [], ("At", sink))).plan) == 1
    assert solve(PDDLProblem(domain, {"@sink": sink}, None, {}, [], ("At", [1, 2]))).plan is None


def test_placeholders_for_every_stream() -> None:
    result = solve(PDDLProblem(SHELF, {}, SHELF_STREAMS, "debug", [("Item", "a")], Exists(["?x"], ("On", "a", "?x"))))
    assert str(result.plan[0].args[1]) == "?x[spots(a)]"


# --- constraints


def test_a_plan_follows_one_skeleton() -> None:
    """Not one after the other, nor parts of both."""
    by_car = [("drive", [WILD, HOME, "?x"]), ("drive", [WILD, "?x", OSLO])]
    by_train = [("buy", []), ("ride", [5.5, WILD, OSLO])]
    for skeletons, name in (([by_car], "drive"), ([by_train], "ride"), ([by_car, by_train], None)):
        plan = solve(travel(("At", OSLO)), constraints=PlanConstraints(skeletons=skeletons)).plan
        assert len(plan) == 2 and (name is None or plan[-1].name == name)
    assert solve(travel(("Ticket",)), constraints=PlanConstraints(skeletons=[by_car, by_train])).plan is None
    assert solve(travel(("At", OSLO)), constraints=PlanConstraints(skeletons=[])).plan is None
    assert solve(travel(("At", HOME)), constraints=PlanConstraints(skeletons=[[]])).plan == []
    loose = solve(travel(("Ticket",)), constraints=PlanConstraints(skeletons=[by_car], exact=False)).plan
    assert [a.name for a in loose].count("buy") == 1 and len(loose) == 3


def test_groups_variables_and_orders() -> None:
    trip = [("drive", ["cars", "?a", "?b"]), ("drive", ["cars", "?b", "?c"])]
    groups = {"cars": [4]}
    assert len(solve(travel(("At", OSLO)), constraints=PlanConstraints([trip], groups)).plan) == 2
    assert solve(travel(("At", OSLO)), constraints=PlanConstraints([trip], {"cars": [5.5]})).plan is None
    broken = [("drive", [WILD, "?a", "?b"]), ("drive", [WILD, "?c", "?b"])]
    assert solve(travel(("At", OSLO)), constraints=PlanConstraints([broken])).plan is None
    circle = [("drive", [WILD, "?a", "?a"])]
    assert solve(travel(("At", HOME)), constraints=PlanConstraints([circle])).plan is None
    steps = [("ride", [WILD, WILD, ROME]), ("buy", [])]
    assert solve(travel(("At", ROME)), constraints=PlanConstraints([steps])).plan is None
    unordered = OrderedSkeleton(steps, [])
    assert [a.name for a in solve(travel(("At", ROME)), constraints=PlanConstraints([unordered])).plan] == [
        "buy",
        "ride",
    ]
    with pytest.raises(InputError, match="unknown action `fly`"):
        solve(travel(("At", ROME)), constraints=PlanConstraints([[("fly", [])]]))
    with pytest.raises(InputError, match="3"):
        solve(travel(("At", ROME)), constraints=PlanConstraints([[("drive", [WILD])]]))


def test_skeletons_over_sampled_values_and_cost_bounds() -> None:
    rng = np.random.default_rng(0)
    spots = from_gen_fn(lambda i: iter(lambda: (float(rng.uniform(5, 9)),), None))
    goal = Exists(["?x"], ("On", "a", "?x"))
    skeleton = [("put", ["a", "?x"])]
    for algorithm in ALGORITHMS:
        limits = PlanConstraints([skeleton], max_cost=5.6)
        info = {"height": FunctionInfo(opt_fn=lambda x: 5.0)}
        result = solve(shelf(goal, spots), algorithm, limits, info, max_time=30)
        assert len(result.plan) == 1 and result.cost == result.plan[0].args[1] <= 5.6


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_cheaper_plans_are_looked_for_among_more_samples(algorithm: str) -> None:
    spots = from_gen_fn(lambda i: ((10 - n,) for n in itertools.count()) if i == "a" else iter(()))
    result = solve(shelf(Exists(["?x"], ("On", "a", "?x")), spots), algorithm, success_cost=6.5, max_time=30)
    assert result.cost == 6, str(result.report)


def test_optimistic_outputs_and_outcomes() -> None:
    """What `opt_gen_fn` gives stands for samples in bounds of costs and in optimistic tests."""
    spots = from_gen_fn(lambda i: iter([(6.5,), (5,), (7,)] if i == "a" else [(8,), (9,)]))
    goal = Or(*(Exists(["?x"], ("On", i, "?x")) for i in "ab"))
    bounded = {"height": FunctionInfo(opt_fn=lambda x: x / 2)}
    with pytest.raises(InputError, match=r"`height` failed .*Placeholder"):
        solve(shelf(goal, spots), stream_info=bounded)
    asked: list[object] = []

    def hoped(i: str) -> tuple[int]:
        asked.append(i)
        return (4 if i == "a" else 12,)

    bounded["spots"] = StreamInfo(opt_gen_fn=from_fn(hoped))
    result = solve(shelf(goal, spots), stream_info=bounded, planner="max-astar", max_time=30)
    assert [a.args[0] for a in result.plan] == ["a"] and sorted(asked) == ["a", "b"]
    refused = {**bounded, "stable": StreamInfo(opt_gen_fn=from_test(lambda i, x: i == "b"))}
    result = solve(shelf(goal, spots), stream_info=refused, planner="max-astar", max_time=30)
    assert [a.args[0] for a in result.plan] == ["b"]
    nothing = {"spots": StreamInfo(opt_gen_fn=from_fn(lambda i: (1,) if i == "b" else None))}
    assert [a.args[0] for a in solve(shelf(goal, spots), stream_info=nothing, max_time=30).plan] == ["b"]
    nothing = {"spots": StreamInfo(opt_gen_fn=PartialInputs("?i", unique=True))}
    assert solve(shelf(goal, spots), stream_info=nothing, max_time=30).plan


# --- fluent streams and contextual generators

DOOR = """(define (domain door)
  (:predicates (Conf ?q) (Path ?a ?t ?b) (At ?q) (Open ?d) (Door ?d))
  (:action open :parameters (?d) :precondition (Door ?d) :effect (Open ?d))
  (:action shut :parameters (?d) :precondition (Door ?d) :effect (not (Open ?d)))
  (:action go :parameters (?a ?t ?b) :precondition (and (At ?a) (Path ?a ?t ?b))
    :effect (and (At ?b) (not (At ?a)))))"""
DOOR_STREAMS = """(define (stream door)
  (:stream path :inputs (?a ?b) :domain (and (Conf ?a) (Conf ?b)) :fluents (Open) :outputs (?t)
    :certified (Path ?a ?t ?b)))"""


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_fluent_stream_is_called_in_the_state_where_it_is_used(algorithm: str) -> None:
    asked: list[tuple[object, ...]] = []

    def path(a: str, b: str, fluents: list) -> tuple | None:
        asked.append((a, b, tuple(sorted(fluents))))
        needed = {("in", "out"): [("open", "d1")], ("out", "in"): []}
        return ((a, b, len(asked)),) if fluents == needed.get((a, b)) else None

    init = [("Conf", "in"), ("Conf", "out"), ("Door", "d1"), ("Door", "d2"), ("At", "in"), ("Open", "d2")]
    task = PDDLProblem(DOOR, {}, DOOR_STREAMS, {"path": from_fn(path)}, init, ("At", "out"))
    result = solve(task, algorithm, max_time=30)
    assert result.status == "solved", str(result.report)
    opened = {"d2"}
    for name, args in result.plan:
        if name == "open":
            opened.add(args[0])
        elif name == "shut":
            opened.discard(args[0])
        else:
            assert args[1][:2] == (args[0], args[2]) and opened == {"d1"}
    assert any(("path" in fact) for fact in result.certificate.all_facts)


def test_a_contextual_generator_sees_what_stands() -> None:
    """Five blocks fill a shelf of width 5 exactly: found only by placing each beside what stands."""
    domain = """(define (domain d) (:predicates (Item ?i) (Spot ?i ?x) (Place ?x) (Free ?x ?y) (On ?i ?x) (Bad ?x))
      (:action put :parameters (?i ?x) :precondition (and (Spot ?i ?x) (not (Bad ?x))) :effect (On ?i ?x))
      (:derived (Bad ?x) (exists (?i ?j ?y) (and (Spot ?i ?x) (Spot ?j ?y) (On ?j ?y) (not (Free ?x ?y))))))"""
    text = """(define (stream s)
      (:stream spot :inputs (?i) :domain (Item ?i) :outputs (?x) :certified (and (Spot ?i ?x) (Place ?x)))
      (:stream free :inputs (?x ?y) :domain (and (Place ?x) (Place ?y)) :certified (Free ?x ?y)))"""
    rng = np.random.default_rng(0)

    def spot(_: str, context: list = ()) -> object:  # type: ignore[assignment]
        yield from ((round(x + d, 6),) for _, (x,) in context for d in (-1, 1) if 0 <= x + d <= 4)
        while True:
            yield (float(rng.choice([0.0, 4.0])) if context else 0.0,)

    items = list("abcde")
    functions = {"spot": from_gen_fn(spot), "free": from_test(lambda x, y: abs(x - y) >= 1)}
    goal = And(*(Exists(["?x"], ("On", i, "?x")) for i in items))
    task = PDDLProblem(domain, {}, text, functions, [("Item", i) for i in items], goal)
    result = solve(task, stream_info={"spot": StreamInfo(contextual=True)}, max_time=30)
    assert sorted(a.args[1] for a in result.plan) == [0, 1, 2, 3, 4]


DRIVES = """(define (domain drives)
  (:predicates (Town ?a) (At ?a) (Car ?c) (Left))
  (:functions (Toll ?a ?b))
  (:action drive :parameters (?c ?a ?b) :precondition (and (Car ?c) (At ?a) (Town ?b))
    :effect (and (At ?b) (not (At ?a)) (increase (total-cost) 2) (increase (total-cost) (Toll ?a ?b))
      (increase (total-cost) (Fuel ?c)) (increase (total-cost) (Fuel ?c)) (increase (total-cost) 0.5)))
  (:action stay :parameters (?c) :precondition (Car ?c) :effect (and (Left) (increase (total-cost) (Fuel ?c)))))"""
FUEL = """(define (stream drives)
  (:stream car :outputs (?c) :certified (Car ?c))
  (:function (Fuel ?c) (Car ?c)))"""


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_the_costs_of_an_action_are_added_up(algorithm: str) -> None:
    """One of them is a function that only the streams declare."""
    tolls = {("a", "b"): 1.0, ("b", "c"): 1.5, ("a", "c"): 20.0}
    init = [("Town", t) for t in "abc"] + [("At", "a")] + [Equal(("Toll", *way), toll) for way, toll in tolls.items()]
    functions = {"car": from_list_fn(lambda: [(n,) for n in (4, 2, 3)]), "fuel": lambda c: 0.25 * c}
    problem = PDDLProblem(DRIVES, {}, FUEL, functions, init, ("At", "c"))
    result = solve(problem, algorithm, max_cost=10, max_time=30)
    route = [(args[1], args[2]) for _, args in result.plan]
    assert route == [("a", "b"), ("b", "c")]
    assert result.cost == pytest.approx(sum(2.5 + tolls[args[1], args[2]] + 0.5 * args[0] for _, args in result.plan))
    best = solve(problem, algorithm, max_cost=9.5, max_time=30)
    assert best.cost == 9.5 and {args[0] for _, args in best.plan} == {2}
    both = solve(problem._replace(goal=And(("At", "b"), ("Left",))), algorithm, planner="max-astar", max_time=30)
    assert both.cost <= 2.5 + 1 + 3 * 0.25 * 4 and solve(problem, algorithm, unit_costs=True, max_time=30).cost == 1


# --- predicates that only streams know

PATCH = """(define (domain patch)
  (:predicates (Sheet ?s) (Pieces ?s ?c ?a ?b) (Have ?s))
  (:functions (Effort ?s ?c))
  (:action tear :parameters (?s ?c ?a ?b) :precondition (and (Pieces ?s ?c ?a ?b) (Have ?s))
    :effect (and (Have ?a) (Have ?b) (not (Have ?s)) (increase (total-cost) (Effort ?s ?c)))))"""
PATCH_STREAMS = """(define (stream patch)
  (:stream crease :outputs (?c) :certified (Crease ?c))
  (:stream tear :inputs (?s ?c) :domain (and (Sheet ?s) (Crease ?c)) :outputs (?a ?b)
    :certified (and (Sheet ?a) (Sheet ?b) (Pieces ?s ?c ?a ?b)))
  (:function (Effort ?s ?c) (and (Sheet ?s) (Crease ?c))))"""


def patch(streams: str = PATCH_STREAMS, more: tuple = ()) -> PDDLProblem:
    functions = {
        "crease": from_list_fn(lambda: [(0.5,), (0.25,)]),
        "tear": from_fn(lambda s, c: ((s[0], s[0] + c * (s[1] - s[0])), (s[0] + c * (s[1] - s[0]), s[1]))),
        "effort": lambda s, c: 1 / c,
    }
    three = ("?x", "?y", "?z")
    different = [Not(Equal(a, b)) for a, b in itertools.combinations(three, 2)]
    goal = Exists(three, And(*(("Have", v) for v in three), *different))
    init = [("Sheet", (0.0, 1.0)), ("Have", (0.0, 1.0)), *more]
    return PDDLProblem(PATCH, {}, streams, functions, init, goal)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_streams_may_use_predicates_that_the_domain_does_not_declare(algorithm: str) -> None:
    with warnings.catch_warnings(action="error"):
        result = solve(patch(), algorithm, max_time=30)
    assert [a.name for a in result.plan] == ["tear", "tear"] and ("crease", 0.5) in result.certificate.all_facts
    assert result.cost == sum(1 / action.args[1] for action in result.plan)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (":certified (Crease ?c)", ":certified (Creese ?c)", "stream.pddl:2: .*`Creese`"),
        ("(Pieces ?s ?c ?a ?b)))", "(Peices ?s ?c ?a ?b)))", "(?s)stream.pddl:4: .*`Peices`.*did you mean `Pieces`"),
        (":domain (and (Sheet ?s)", ":domain (and (Sheeet ?s)", "(?s)stream.pddl:3: .*did you mean `Sheet`"),
        (":certified (Crease ?c)", ":certified (Crease ?c ?c)", "stream.pddl:3: .*`Crease` takes 2"),
    ],
)
def test_spelling_mistakes_in_streams_are_errors_all_the_same(old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve(patch(PATCH_STREAMS.replace(old, new)), max_time=30)


def test_goals_may_use_predicates_that_the_domain_does_not_declare() -> None:
    text = PATCH_STREAMS.replace(
        "(:function", "(:rule :inputs (?c) :domain (Crease ?c) :certified (Line ?c)) (:function"
    )
    goal = Exists(["?c"], And(("Line", "?c"), Not(Equal("?c", 0.5))))
    with warnings.catch_warnings(action="error"):
        assert solve(patch(text)._replace(goal=goal), max_time=30).plan == []


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_sample_that_must_differ_from_a_known_object(algorithm: str) -> None:
    """The first twelve samples are what the goal excludes."""
    spots = from_gen_fn(lambda i: iter([*((n,) for n in range(5, 17)), (18,)]))
    excluded = [Not(Equal("?x", n)) for n in range(5, 17)]
    result = solve(shelf(Exists(["?x"], And(("On", "a", "?x"), *excluded)), spots), algorithm, max_time=30)
    assert [action.args for action in result.plan] == [("a", 18)], str(result.report)


def test_what_nothing_reads_is_warned_of() -> None:
    text = PATCH_STREAMS.replace(
        "(:function", "(:rule :inputs (?c) :domain (Crease ?c) :certified (Line ?c)) (:function"
    )
    with pytest.warns(UserWarning, match="stream.pddl:5: predicate `Line` .* nothing reads it"):
        assert solve(patch(text), max_time=30).plan
    with pytest.warns(UserWarning, match="initial facts: predicate `Red` .* nothing reads it"):
        assert solve(patch(more=[("Red", 1)]), max_time=30).plan
    with pytest.warns(UserWarning, match="function `Price` .* no action's cost reads it"):
        assert solve(patch(more=[Equal(("Price",), 1)]), max_time=30).plan


# --- mistakes and failures


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"domain_pddl": TRAVEL.replace("(At ?a) (Road", "(Att ?a) (Road")}, "domain.pddl:8: .*Att"),
        ({"domain_pddl": TRAVEL.replace("?v - train", "?v - tram")}, "domain.pddl:1[0-9]: .*unknown type `tram`"),
        ({"goal": ("At",)}, "takes 1"),
        ({"goal": ("Nowhere", 1)}, "unknown predicate"),
        ({"goal": "At"}, "not a tuple"),
        ({"goal": ("exists", ["x"], ("At", "x"))}, "begin with `\\?`"),
        ({"init": [("Road", 1)]}, "takes 2"),
        ({"init": ["Road"]}, "not a tuple"),
        ({"init": [Equal(("Distanse", 1, 2), 2)]}, "(?s)unknown function `Distanse`.*did you mean `Distance`"),
        ({"init": [*INIT, ("Rood", HOME, OSLO)]}, "(?s)unknown predicate `Rood`.*did you mean `Road`"),
        ({"init": [Equal(("Distance", 1, 2), -2)]}, "numbers from 0"),
        ({"stream_pddl": "(define (stream s) (:optimizer o))"}, "stream.pddl:1: .*optimizers"),
        ({"stream_pddl": "(define (stream s)\n (:stream t :inputs (?c - city) :certified (Visited ?c)))"},
         ":2: .*change"),
        ({"stream_pddl": "(define (stream s) (:stream t :inputs (?c - city ?d - city) :certified (Road ?c ?d)))"},
         "stream.pddl:1: .*no Python function"),
        ({"init": [("?x", 1)]}, "begins with no name of a predicate"),
        ({"stream_map": "bebug"}, "bebug"),
    ],
)  # fmt: skip
def test_mistakes_are_located(change: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        solve(travel(("At", OSLO))._replace(**change))


@pytest.mark.parametrize("name", ["?c", "define", ":domain", "17"])
def test_what_cannot_be_a_predicate_is_refused_without_a_warning(name: str) -> None:
    text = f"(define (stream s)\n (:stream t :inputs (?c - city) :certified ({name} ?c)))"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=f":2: error: unknown predicate `{re.escape(name)}`"):
            solve(travel(("At", OSLO))._replace(stream_pddl=text))


def test_several_stream_files() -> None:
    """Each has rules of its own, and mistakes name the file."""
    rule = "(define (stream r) (:rule :inputs (?c - city) :domain (Road ?c ?c) :certified (Loop ?c)))"
    back = "(define (stream r)\n (:rule :inputs (?c - city) :domain (Loop ?c) :certified (Road ?c home)))"
    test = "(define (stream s)\n (:stream free :inputs (?c - city) :domain (Loop ?c) :certified (Road ?c ?c)))"
    assert solve(travel(("At", OSLO))._replace(stream_pddl=[rule, back])).plan
    with pytest.raises(InputError, match=r"^stream.pddl\[2\]:2: error: stream `free` has no Python function"):
        solve(travel(("At", OSLO))._replace(stream_pddl=[rule, back, test]))


def test_unknown_arguments_and_algorithms() -> None:
    with pytest.raises(TypeError, match="algorithmus"):
        solve(travel(("At", OSLO)), algorithmus="adaptive")
    with pytest.raises(InputError, match="adaptive, incremental"):
        solve(travel(("At", OSLO)), "abstract")
    info = {"distance": FunctionInfo(verbose=False, p_success=1), "road": StreamInfo(verbose=False, overhead=1)}
    assert solve(travel(("At", OSLO)), stream_info=info, max_failures=3, visualize=False, effort_weight=1).plan


def test_the_names_of_the_algorithms() -> None:
    by_train = PlanConstraints([[("buy", []), ("ride", [WILD, WILD, OSLO])]])
    for function in (solve_incremental, solve_adaptive, solve_focused, solve_binding):
        assert [a.name for a in function(travel(("At", OSLO)), by_train, unit_costs=True).plan] == ["buy", "ride"]
    for name in ("focused", "binding"):
        assert solve(travel(("At", OSLO)), name).plan


def test_a_failure_says_what_is_out_of_reach(capsys: pytest.CaptureFixture[str]) -> None:
    result = solve(shelf(("On", "a", 8), from_list_fn(lambda i: [])), verbose=True)
    report = str(result.report)
    assert result.status == "no plan" and "`spots` never gave anything in" in report
    assert (
        "reaches the goal (on a" in report
        and "`put` never becomes applicable: nothing satisfies (spot ?i ?x)" in report
    )
    assert report in capsys.readouterr().out
    print_solution(result)
    shown = capsys.readouterr().out
    assert shown.startswith("Solved: False") and report in shown
    assert "`put` never becomes applicable" in result.reason and result.report.reason in result.reason
    print_solution((None, INF, result.certificate))  # a plain tuple, as others make them
    solved = solve(shelf(("On", "a", 5), from_list_fn(lambda i: [(5,)])))
    print_solution(solved)
    assert solved.reason == "" and "iterations" not in capsys.readouterr().out
    unused = solve(shelf(("Seen", 8), from_list_fn(lambda i: []))._replace(init=[]))
    assert "`spots` was never called: there are no facts of item" in str(unused.report)


def test_statistics_and_iteration_limits() -> None:
    result = solve(shelf(("On", "a", 5), from_list_fn(lambda i: [(5,)])))
    assert result.report.streams["spots"].successes in (1, 2) and result.report.iterations >= 1
    assert solve(shelf(("On", "a", 5), from_list_fn(lambda i: [(5,)])), max_iterations=0).status == "time limit"


def test_two_solves_at_once_do_not_meet() -> None:
    """Also one inside the other: a stream may solve a problem of its own."""
    answers: dict[int, object] = {}

    def inner(i: str, x: int) -> bool:
        return solve(travel(("At", OSLO))).plan is not None

    def work(number: int) -> None:
        spots = from_list_fn(lambda i: [(number + 5,), (number + 6,)])
        answers[number] = solve(shelf(Exists(["?x"], And(("On", "a", "?x"))), spots, stable=inner), seed=number).plan

    threads = [threading.Thread(target=work, args=(n,)) for n in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(answers[n][0].args[1] in (n + 5, n + 6) for n in range(3))  # type: ignore[index]


def test_the_same_seed_gives_the_same_plan() -> None:
    def run(seed: int) -> object:
        rng = np.random.default_rng(7)
        spots = from_gen_fn(lambda i: iter(lambda: (float(rng.uniform(5, 9)),), None))
        goal = And(*(Exists(["?x"], ("On", i, "?x")) for i in "ab"))
        return solve(shelf(goal, spots), seed=seed).plan

    assert run(3) == run(3)


def test_everything_exported_is_documented() -> None:
    assert all(getattr(streams, name) is not None for name in streams.__all__)
