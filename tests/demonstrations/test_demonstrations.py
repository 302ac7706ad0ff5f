"""Demonstrations: canonical plans, recorded data, the cache, and the facts that learning gets."""

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from gentamp_lp.abstraction.observations import parse_observations
from gentamp_lp.demonstrations import demonstrate as demonstrations
from gentamp_lp.demonstrations.canonical import canonical
from gentamp_lp.demonstrations.dataset import Dataset, SeenState, TrainingProblem, Transition
from gentamp_lp.demonstrations.demonstrate import cache_path, demonstrate, short_plan
from gentamp_lp.demonstrations.recorder import Recorder
from gentamp_lp.features.axioms import to_formula
from gentamp_lp.features.pool import generate_pool, split_formula
from gentamp_lp.learning.learn import Learned
from gentamp_lp.solvers.asp import GroundProgram
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import atoms
from gentamp_lp.streams.incremental import simulate
from gentamp_lp.streams.pddl import parse_domain, parse_formula
from gentamp_lp.streams.semantics import Program, State, Step, View, apply
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.tasks.invariants import at_most_one
from gentamp_lp.tasks.task import Task

ROOMS = """(define (domain rooms)
  (:predicates (Link ?x ?y) (In ?x) (Lit ?x) (Clean ?x) (Full))
  (:action clean :parameters (?x) :precondition (In ?x) :effect (Clean ?x))
  (:action light :parameters (?x) :precondition (In ?x) :effect (Lit ?x))
  (:action move :parameters (?x ?y) :precondition (and (In ?x) (Link ?x ?y)) :effect (and (In ?y) (not (In ?x)))))"""


def rooms() -> tuple[Program, FactBase, State]:
    domain = parse_domain(ROOMS)
    base = FactBase(domain, (), {}, dict.fromkeys("abc"))
    for link in ("ab", "ba", "bc", "cb"):
        base.add(("link", *link))
    return Program.of(domain), base, frozenset([("in", "a")])


def steps(text: str) -> list[Step]:
    return [Step(word[0], tuple(word[1:])) for word in (part.split() for part in text.split(","))]


@pytest.mark.parametrize(
    ("goal", "plan", "expected"),
    [
        ("(In c)", "move a b,move b a,move a b,move b c", "move a b,move b c"),
        ("(In c)", "move a b,light b,move b c,clean c", "move a b,move b c"),
        ("(In a)", "move a b,move b a", ""),
        ("(and (Lit a) (Clean a))", "light a,clean a", "clean a,light a"),
        ("(and (Lit a) (Clean b))", "move a b,clean b,move b a,light a", "light a,move a b,clean b"),
        ("(and (Lit a) (Clean a) (Lit b))", "light a,clean a,move a b,light b", "clean a,light a,move a b,light b"),
        ("(and (Clean b) (Lit b) (In c))", "move a b,light b,clean b,move b c", "move a b,clean b,light b,move b c"),
    ],
)  # fmt: skip
def test_canonical(goal: str, plan: str, expected: str) -> None:
    program, base, state = rooms()
    formula = parse_formula(goal, program.domain, "abc")
    found = canonical(program, base, state, formula, steps(plan))
    states = simulate(program, base, state, found)
    assert states is not None and View(program, base, states[-1]).holds(formula)
    assert found == (steps(expected) if expected else [])
    assert canonical(program, base, state, formula, found) == found


def test_demonstrations_are_canonical_plans(learned: Learned) -> None:
    """The demonstrated transitions of each problem form a path from the initial state to a goal."""
    data = learned.dataset
    for number in range(len(data.problems)):
        own = [i for i, state in enumerate(data.states) if state.problem == number]
        (here,) = [i for i in own if data.states[i].initial]
        after = {t.source: t.target for t in data.transitions if t.demonstrated and t.source in own}
        length = 0
        while not data.states[here].goal:
            here, length = after[here], length + 1
        assert length == len(after)


def test_recorded_states_follow_from_recorded_steps(learned: Learned) -> None:
    """Effects only, on names: no geometry is needed to see that a transition is what it says."""
    data, domain = learned.dataset, learned.task.folder.domain
    program = Program.of(domain)
    empty = FactBase(domain, (), {}, {})
    for t in data.transitions:
        source, target = data.states[t.source], data.states[t.target]
        assert source.problem == target.problem
        before = frozenset(f for f in source.facts if f[0] in domain.fluents)
        after = frozenset(f for f in target.facts if f[0] in domain.fluents)
        assert apply(View(program, empty, before), Step(t.action, t.args)) == after


def test_the_states_around_a_plan_are_left_out_on_request(unstack: Learned) -> None:
    alone = demonstrate(unstack.task, around=False, cache=False)
    assert all(t.demonstrated for t in alone.transitions)
    assert len(alone.states) == len(alone.transitions) + 1 < len(unstack.dataset.states)


def test_json_round_trip(learned: Learned) -> None:
    data = learned.dataset
    again = Dataset.from_json(data.to_json())
    assert again == data
    assert again.to_json() == data.to_json()
    assert (again.pool_facts(), again.policy_facts()) == (data.pool_facts(), data.policy_facts())
    assert isinstance(json.loads(data.to_json()), dict)


def test_the_same_seed_gives_the_same_data_and_another_one_does_not(unstack: Learned) -> None:
    assert demonstrate(unstack.task, cache=False).to_json() == unstack.dataset.to_json()
    assert demonstrate(unstack.task, seed=1, cache=False).to_json() != unstack.dataset.to_json()


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_: str(tmp_path / "cache"))
    return tmp_path / "cache"


def fail(*_: object, **__: object) -> Sequence[Step]:
    raise AssertionError("nothing is planned when the answer is in the cache")


def test_the_cache_is_used(unstack: Learned, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = demonstrate(unstack.task)
    assert len(list(cache.rglob("*"))) == 2  # a folder and a file: nothing half-written
    told: list[str] = []
    monkeypatch.setattr(demonstrations, "solve_incremental", fail)
    assert demonstrate(unstack.task, progress=told.append) == first == unstack.dataset
    assert "from the cache" in told[0]
    for other in ({"seed": 1}, {"around": False}, {"robot": "gripper"}, {"cache": False}):
        with pytest.raises(AssertionError, match="nothing is planned"):
            demonstrate(unstack.task, **other)  # type: ignore[arg-type]


@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:99] + b"xyz" + b[102:]])
def test_a_damaged_cache_is_named_and_rebuilt(unstack: Learned, cache: Path, damage: Callable[[bytes], bytes]) -> None:
    path = cache_path(unstack.task, 0, None, True, unstack.task.file.train)
    right = demonstrate(unstack.task).to_json()
    path.write_bytes(damage(path.read_bytes()))
    told: list[str] = []
    assert demonstrate(unstack.task, progress=told.append).to_json() == right
    assert "damaged" in told[0] and path.name in told[0]
    assert demonstrate(unstack.task, progress=told.append).to_json() == right
    assert "from the cache" in told[-1]


def test_a_cache_that_cannot_be_written_does_no_harm(
    unstack: Learned, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.write_text("a file where the folder should be")
    monkeypatch.setattr(demonstrations, "solve_incremental", lambda *_, **__: [])
    monkeypatch.setattr(demonstrations, "canonical", lambda *_: [])
    assert len(demonstrate(unstack.task).states) == 1


def test_the_name_in_the_cache_depends_on_the_task(unstack: Learned, load: Learned, tmp_path: Path) -> None:
    names = {cache_path(t.task, s, r, a, [3]) for t in (unstack, load) for s in (0, 1) for r in (None, "gripper")
             for a in (True, False)}  # fmt: skip
    assert len(names) == 16
    changed = tmp_path / "unstack.yaml"
    changed.write_text(unstack.task.path.read_text().replace("train: [8]", "train: [7]"))
    assert cache_path(Task.load(changed), 0, None, True, [3]) not in names


# ---- Invariants


def test_at_most_one(learned: Learned) -> None:
    found = learned.dataset.at_most_one
    assert {"atgrasp", "holding"} <= set(found)
    assert not {"atpose", "on", "standsat", "unsafe", "blocked"} & set(found)
    for state in learned.dataset.states:
        for name in found:
            assert sum(fact[0] == name for fact in state.facts) <= 1


def two_hands(effect: str, precondition: str = "(and (Free) (At ?x))") -> list[str]:
    domain = parse_domain(
        f"""(define (domain d) (:predicates (Free) (At ?x) (Held ?x) (Some) (Linked ?x ?y))
        (:action take :parameters (?x) :precondition {precondition} :effect {effect})
        (:derived (Some) (exists (?x) (Held ?x)))
        (:derived (Linked ?x ?y) (and (Held ?x) (At ?y))))"""
    )
    return at_most_one(domain, [frozenset([("free",), ("at", "a"), ("at", "b")])])


def test_what_breaks_an_invariant() -> None:
    assert two_hands("(and (Held ?x) (not (Free)) (not (At ?x)))") == ["free", "held", "some"]
    assert "held" not in two_hands("(and (Held ?x) (not (At ?x)))")
    assert "held" not in two_hands("(and (Held ?x) (not (Free)))", "(At ?x)")  # never required
    assert "held" not in two_hands("(and (Held ?x) (when (At ?x) (not (Free))))")
    assert "held" not in two_hands("(and (forall (?y) (when (At ?y) (Held ?y))) (not (Free)))")
    assert "held" not in two_hands("(and (Held ?x) (Free) (not (Free)))")


def test_the_initial_state_matters() -> None:
    domain = parse_domain(
        """(define (domain d) (:predicates (Free) (Held ?x))
        (:action drop :parameters (?x) :precondition (Held ?x) :effect (and (Free) (not (Held ?x)))))"""
    )
    assert at_most_one(domain, [frozenset([("held", "a")])]) == ["held"]
    assert at_most_one(domain, [frozenset([("held", "a"), ("held", "b")])]) == []


# ---- Facts for Prolog and ASP


def test_facts_are_read_by_both_languages(learned: Learned) -> None:
    data = learned.dataset
    pool = generate_pool(data.pool_facts(), max_cost=1)
    assert pool.size > 3
    observations = parse_observations(data.policy_facts() + pool.facts)
    assert len(observations.states) == len(data.states) and len(observations.transitions) == len(data.transitions)
    assert set(observations.schemas.values()) == {"pick", "place"}
    assert set(observations.goals) == {i for i, s in enumerate(data.states) if s.goal}
    assert GroundProgram([], data.policy_facts() + pool.facts).messages == []


def test_names_with_hyphens_and_capitals_are_quoted() -> None:
    """PDDL names are not always atoms of Prolog."""
    data = Dataset(
        {"on-top": ["thing", "thing"], "arm-empty": [], "2nd": ["thing"]},
        {"on-top": "On-Top", "arm-empty": "arm-empty", "2nd": "2nd"},
        [],
        ["arm-empty"],
        [TrainingProblem("1", 0, [("2nd", "b-1"), ("2nd", "B2")], {"thing": ["b-1", "B2", "1c"]})],
        [SeenState(0, [("on-top", "b-1", "B2"), ("arm-empty",)], initial=True), SeenState(0, [], goal=True)],
        [Transition(0, 1, "pick-up", ("b-1",), True)],
    )
    pool = generate_pool(data.pool_facts(), max_cost=3)
    used = set()
    for text in pool.formulas.values():
        variable, sort, body = split_formula(text)
        assert (variable, sort) in ((None, None), ("v0", "thing"))
        used |= {atom.predicate for atom in atoms(to_formula(body)[0])}
    assert {"on-top", "arm-empty"} <= used <= {*data.predicates, "sort-thing"}
    assert parse_observations(data.policy_facts() + pool.facts).schemas == {0: "pick-up"}
    assert GroundProgram([], data.policy_facts() + pool.facts).messages == []


def test_sorts_get_names_that_need_no_quotes() -> None:
    domain = parse_domain(
        """(define (domain d) (:predicates (P ?the-thing) (Q ?2nd) (R-s ?x))
        (:action a :parameters (?the-thing ?2nd) :precondition (and (P ?the-thing) (Q ?2nd)) :effect (P ?the-thing)))"""
    )
    sorts = infer_sorts(domain, ())
    assert sorts["p"] == ("the_thing",)
    assert all(re.fullmatch(r"[a-z]\w*", sort) for row in sorts.values() for sort in row)


def test_a_recorder_may_start_in_the_middle(unstack: Learned) -> None:
    """As after a failed roll-out: the given state is the initial one of its problem."""
    instance = unstack.task.instance(3, 2, robot="gripper")
    recorder = Recorder.start(unstack.task, [instance], around=False)
    state = frozenset([("handempty",)])
    recorder.record(instance, [], state)
    assert [s.initial for s in recorder.data.states] == [True]
    assert set(recorder.data.states[0].facts) >= state


@pytest.mark.parametrize("shares", [{}, {"_SHORT": 0.0}, {"_SHORT": 0.0, "_HALF": 0.0}])
def test_hard_problems_are_planned_with_fewer_samples_or_another_search(
    unstack: Learned, shares: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is left to do by lack of time, the plan holds for all samples."""
    for name, share in shares.items():
        monkeypatch.setattr(f"gentamp_lp.demonstrations.demonstrate.{name}", share)
    task = unstack.task
    instance = task.instance(3, 2, robot="gripper")
    plan = short_plan(task, instance.base, instance.state, time_limit=60, seed=2)
    states = simulate(task.program, instance.base, instance.state, plan)
    assert states is not None and View(task.program, instance.base, states[-1]).holds(task.goal)
    assert len(plan) <= 5  # the two other blocks are moved, at most, then the goal's block is held
