"""The feature pool: every printed formula against an independent evaluator, and the user's ways to fail."""

from __future__ import annotations

import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import pytest
from helpers import synthetic
from helpers.brute_force import State, pool_rows
from helpers.pace import at_most

from gentamp_lp.base.terms import parse_term, quote_atom
from gentamp_lp.errors import InputError, LimitReached, SolverError
from gentamp_lp.features.pool import Pool, PoolSession, check_grammars, deepen, generate_pool
from gentamp_lp.solvers.prolog import Prolog, PrologProcess
from gentamp_lp.tasks.grammars import find_grammar

LOGIC = Path(__file__).parents[1] / "logic"


def behaviour(data: synthetic.Data, formula: str) -> tuple[set[int], set[int], set[int], int]:
    term = parse_term(formula)
    values = [State(atoms | data.static[p], data.entities[p]).value(term) for p, atoms in data.states]
    changes = list(enumerate(data.transitions))
    return (
        {s for s, v in enumerate(values) if v},
        {t for t, (s, s2) in changes if values[s2] > values[s]},
        {t for t, (s, s2) in changes if values[s2] < values[s]},
        max(values),
    )


def features(pool: Pool) -> dict[int, tuple[int, str]]:
    found = re.findall(r"feature\((\d+),(\d+),(\w+)\)", pool.facts)
    return {int(i): (int(cost), kind) for i, cost, kind in found}


def assert_exact(data: synthetic.Data, pool: Pool, only: Iterable[int] | None = None) -> None:
    pos, inc, dec, kinds = pool_rows(pool, "pos"), pool_rows(pool, "inc"), pool_rows(pool, "dec"), features(pool)
    for i in pool.formulas if only is None else only:
        expected = behaviour(data, pool.formulas[i])
        assert (pos[i], inc[i], dec[i]) == expected[:3], pool.formulas[i]
        if kinds[i][1] == "boolean":
            assert expected[3] <= 1, pool.formulas[i]


TINY = synthetic.load((1, 2), poses=2, seed=7)


@pytest.mark.parametrize(
    "data",
    [
        synthetic.unstack(3, poses=3, seed=1),
        synthetic.load((1, 2), poses=1, seed=2),
        synthetic.load((2, 1), poses=2, seed=3, around=False),
        synthetic.unstack(4, poses=1, seed=4, around=False, per_grasp=2),
    ],
    ids=["unstack", "load", "load-plan", "unstack-plan"],
)
def test_formulas_mean_what_the_pool_says(data: synthetic.Data) -> None:
    assert_exact(data, generate_pool(data.text(), max_cost=3))


def test_a_sample_of_costly_formulas_means_what_the_pool_says() -> None:
    pool = generate_pool(TINY.text(), max_cost=5)
    costly = [i for i, (cost, _) in features(pool).items() if cost > 3]
    assert_exact(TINY, pool, random.Random(0).sample(costly, min(100, len(costly))))


def test_predicates_that_do_not_collapse_are_exact_too() -> None:
    """Without owners, Pose/3 stays ternary, and CFree/4 and Reach/5 are seen through their pairs."""
    data = synthetic.load((1, 2), poses=1, seed=5)
    text = re.sub(r"owner\(.*\)\.\n", "", data.text())
    pool = generate_pool(text, max_cost=3)
    assert any("pose(" in f for f in pool.formulas.values())
    only = random.Random(0).sample(list(pool.formulas), min(200, pool.size))
    assert_exact(data, pool, only)


def test_wrong_owner_is_not_believed() -> None:
    """A pose that belongs to two objects determines neither; the values stay exact."""
    data = synthetic.load((2,), poses=2, seed=6)
    data.static[0] |= {("pose", "b0", a[2], "tray") for a in data.static[0] if a[0] == "pose"}
    assert_exact(data, generate_pool(data.text(), max_cost=2))


# ---- What a pool promises


@pytest.fixture(scope="module")
def pool() -> Pool:
    return generate_pool(synthetic.load((2, 3), poses=5).text(), max_cost=3)


def test_no_two_features_behave_alike(pool: Pool) -> None:
    pos, inc, dec = pool_rows(pool, "pos"), pool_rows(pool, "inc"), pool_rows(pool, "dec")
    states = set().union(*pos.values())
    seen = set()
    for i, (_, kind) in features(pool).items():
        this = (kind, frozenset(pos[i]), frozenset(inc[i]), frozenset(dec[i]))
        assert this not in seen
        seen.add(this)
        if kind == "boolean":
            seen.add((kind, frozenset(states - pos[i]), this[3], this[2]))


def test_features_are_ordered_by_cost_and_numbered_from_one(pool: Pool) -> None:
    costs = [cost for cost, _ in features(pool).values()]
    assert list(features(pool)) == list(range(1, pool.size + 1)) == list(pool.formulas)
    assert costs == sorted(costs)


def test_holding_is_boolean_and_the_rest_is_not_taken_for_one(pool: Pool) -> None:
    kinds = {pool.formulas[i].split(",", 1)[1]: kind for i, (_, kind) in features(pool).items()}
    counted = [f for f, kind in kinds.items() if kind == "boolean" and not f.startswith("none")]
    assert counted
    assert all(re.search("holding|atgrasp", f) for f in counted)


def test_same_input_gives_the_same_bytes(pool: Pool) -> None:
    again = generate_pool(synthetic.load((2, 3), poses=5).text(), max_cost=3)
    assert (again.facts, again.formulas) == (pool.facts, pool.formulas)


def test_renaming_and_reordering_entities_changes_nothing(pool: Pool) -> None:
    text = synthetic.load((2, 3), poses=5).text()
    entities = [line for line in text.splitlines() if line.startswith("entity(")]
    others = [line for line in text.splitlines() if not line.startswith("entity(")]
    shuffled = random.Random(1).sample(entities, len(entities))
    renamed = re.sub(r"\b([bpgt])(\d+)\b", r"\1x\2", "\n".join(others + shuffled) + "\n")
    again = generate_pool(renamed, max_cost=3)
    assert (again.facts, again.formulas) == (pool.facts, pool.formulas)


def test_a_deeper_pool_starts_with_the_shallower_one() -> None:
    shallow, deep = deepen(TINY.text(), costs=[2, 4])
    assert deep.facts.startswith(shallow.facts)
    assert shallow.size < deep.size
    assert deep.formulas.items() >= shallow.formulas.items()
    alone = generate_pool(TINY.text(), max_cost=2)
    assert (shallow.facts, shallow.formulas) == (alone.facts, alone.formulas)


def test_features_of_the_paper_are_in_the_pool() -> None:
    """Each formula behaves like some feature of the pool up to its cost."""
    data = synthetic.load((2, 3), poses=6, seed=1)
    pool = generate_pool(data.text(), max_cost=4)
    columns = [map(frozenset, pool_rows(pool, name).values()) for name in ("pos", "inc", "dec")]
    behaviours = set(zip(*columns, strict=True))
    for formula in (
        "formula(0,v0,object,conj(holding(v0),neg(tray(v0))))",
        "formula(0,v0,object,conj(holding(v0),tray(v0)))",
        "formula(0,v0,object,some(v1,object,conj(on(v0,v1),neg(tray(v1)))))",
        # a pose on the tray that is free of everything placed
        "formula(0,v0,pose,some(v1,object,some(v2,object,conj(pose(v1,v0,v2),conj(tray(v2),"
        "every(v3,object,every(v4,pose,implies(atpose(v3,v4),cfree(v1,v0,v3,v4)))))))))",
    ):
        pos, inc, dec, _ = behaviour(data, formula)
        assert (frozenset(pos), frozenset(inc), frozenset(dec)) in behaviours, formula


@pytest.mark.parametrize(
    "text",
    [
        "",
        "sort(object). predicate(p, [object]). problem(0). state(0, 0).",
        "sort(object). sort(pose). predicate(p, [object,pose]). problem(0). problem(1). entity(0, object, a).",
    ],
    ids=["nothing", "no-entities", "empty-problem"],
)
def test_data_without_features_give_an_empty_pool(text: str) -> None:
    assert generate_pool(text, max_cost=3).size == 0


def test_data_without_transitions() -> None:
    text = "sort(o). predicate(p, [o]). problem(0). entity(0, o, a). state(0, 0). state(1, 0). fluent(0, p(a))."
    pool = generate_pool(text, max_cost=2)
    assert pool_rows(pool, "pos")[1] in ({0}, {1})
    assert not re.search("inc|dec", pool.facts)


def test_size_and_time_stay_small() -> None:
    with at_most(0.0, starts=500):  # a tenth of it when it was written
        pool = generate_pool(synthetic.unstack(8).text(), max_cost=4)
    assert 100 < pool.size < 1500


# ---- The user's grammar

CLOSURE = (Path(__file__).parents[2] / "docs" / "examples" / "05-own-words" / "above.lp").read_text()


def test_a_user_rule_adds_transitive_closure(tmp_path: Path) -> None:
    (tmp_path / "plus.lp").write_text(CLOSURE)
    data = synthetic.unstack(4, poses=4)
    pool = generate_pool(data.text(), max_cost=4, grammars=[tmp_path / "plus.lp"])
    with_closure = [i for i, f in pool.formulas.items() if "closure(" in f]
    assert with_closure
    assert_exact(data, pool, with_closure)


def test_a_rule_can_be_switched_off(tmp_path: Path) -> None:
    (tmp_path / "mine.lp").write_text("off(only). off(none). off(clears). off(all).\n")
    pool = generate_pool(TINY.text(), max_cost=3, grammars=[tmp_path / "mine.lp"])
    assert not any("every(" in f for f in pool.formulas.values())


def test_the_cost_of_a_rule_can_be_replaced(tmp_path: Path) -> None:
    (tmp_path / "mine.lp").write_text("cost(negated, 2).\n")
    cheap = generate_pool(TINY.text(), max_cost=2)
    dear = generate_pool(TINY.text(), max_cost=2, grammars=[tmp_path / "mine.lp"])
    negated = {i for i, f in cheap.formulas.items() if re.search(r"neg\(\w+\(v0\)\)", f)}
    assert any(cheap.kinds[i][0] == 1 for i in negated)
    negated = {i for i, f in dear.formulas.items() if re.search(r"neg\(\w+\(v0\)\)", f)}
    assert all(dear.kinds[i][0] == 2 for i in negated)


CONCEPT = """\
% A place on a tray where nothing stands in the way.
concept("OnTray(p)", "exists r: Pose(_,p,r) & Tray(r)", 1).
concept("FreeCell(p)", "OnTray(p) & ~Unsafe(_,p)", 1).
"""


def test_a_concept_is_one_literal_and_prints_as_its_formula(tmp_path: Path) -> None:
    (tmp_path / "cells.lp").write_text(CONCEPT)
    data = synthetic.load((2, 3), poses=6, seed=1)
    meaning = "conj(some(v1,object,conj(some(v2,object,pose(v2,v0,v1)),tray(v1))),neg(some(v3,object,unsafe(v3,v0))))"
    plain = generate_pool(data.text(), max_cost=1)
    assert not any(meaning in f for f in plain.formulas.values())
    pool = generate_pool(data.text(), max_cost=2, grammars=[tmp_path / "cells.lp"])
    [number] = [i for i, f in pool.formulas.items() if f.endswith(f"pose,{meaning})")]
    assert pool.kinds[number] == (1, "numeric")
    assert_exact(data, pool, [number, *random.Random(0).sample(list(pool.formulas), 20)])
    with PoolSession(data.text(), grammars=[tmp_path / "cells.lp"]) as session:
        session.deepen(1)
        reading = session.read("FreeCell(p)")
        assert meaning in reading.formula
        assert (reading.match, reading.how) == (number, "same_values")


def test_a_concept_of_two_arguments_is_a_relation(tmp_path: Path) -> None:
    (tmp_path / "twin.lp").write_text('concept("Twin(x,y)", "exists s: On(x,s) & On(y,s)", 1).\n')
    data = synthetic.load((1, 2), poses=1)
    pool = generate_pool(data.text(), max_cost=3, grammars=[tmp_path / "twin.lp"])
    twins = [i for i, f in pool.formulas.items() if f.count("on(") > 1]
    assert twins
    assert_exact(data, pool, random.Random(0).sample(twins, min(80, len(twins))))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('concept("A(x)", "Nowhere(x)", 1).', "no predicate `Nowhere`"),
        ('concept("A(x)", "On(x,y)", 1).', "`y` is not bound"),
        ('concept("A(x)", "B(x)", 1).\nconcept("B(x)", "Tray(x)", 1).', "no predicate `B`"),
        ("rule(a, [con(X)], con(X), 1).\nsem(a, [con(pose)], _, [A], A).\nsays(a, _, [A], Xs, A@Xs).", "no meaning"),
    ],
)
def test_what_only_the_data_show_to_be_wrong_is_reported_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.lp"
    path.write_text(text)
    check_grammars([path])
    with pytest.raises(InputError) as caught:
        generate_pool(TINY.text(), max_cost=2, grammars=[path])
    [diagnostic] = caught.value.diagnostics
    assert message in diagnostic.message
    assert (str(diagnostic.path), diagnostic.line) == (str(path), 1)


def test_the_whole_table_adds_features_and_loses_none(tmp_path: Path) -> None:
    """`--grammar paper`: every literal in both polarities."""
    data = synthetic.load((1, 2), poses=1, seed=2)
    pool = generate_pool(data.text(), max_cost=3)
    whole = generate_pool(data.text(), max_cost=3, grammars=[find_grammar("paper")])
    assert whole.size > pool.size
    assert_exact(data, whole)
    with PoolSession(data.text(), grammars=[find_grammar("paper")]) as session:
        session.deepen(3)
        lost = [f for f in pool.texts.values() if session.read(f).how in ("absent", "constant")]
    assert lost == []


def test_grammars_are_found_by_path_and_by_name(tmp_path: Path) -> None:
    (tmp_path / "paper").write_text("")
    assert find_grammar("paper").name == "paper.lp"
    assert find_grammar("paper", tmp_path) == tmp_path / "paper"
    assert find_grammar("mine.lp", tmp_path) == tmp_path / "mine.lp"
    with pytest.raises(InputError, match="paper"):
        find_grammar("papers")


def test_what_was_pruned_adds_up(pool: Pool) -> None:
    rules = {row.rule for row in pool.pruned}
    assert {"views", "literal", "conj", "some", "features"} <= rules
    kept = sum(row.counts.get("new", 0) for row in pool.pruned if row.rule != "features")
    assert kept == pool.statistics["formulas"]
    features = [row for row in pool.pruned if row.rule == "features"]
    assert sum(row.counts.get("new", 0) for row in features) >= pool.size
    assert any(row.counts.get("equivalent") for row in pool.pruned)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("rule(a, [con(X)], con(X), 1)\nrule(b).\n", 1, "Syntax error"),
        ("\n:- shell(ls).\n", 2, "directive"),
        ("sem(conj, _, _, [A], A) :- shell(ls).\n", 1, "not a primitive"),
        ("sem(conj, _, _, [A], D) :- meet(A, E, D), meet(A, A, E).\n", 1, "not computed before"),
        ("sem(conj, _, _, [A,B], A) :- meet(A, B, A).\n", 1, "last argument"),
        ("sem(conj, _, _, [A], D) :- meet(A, D, D).\n", 1, "not computed before"),
        ("sem(conj, _, _, [A,B], _D) :- meet(A, B, _E).\n", 1, "never computed"),
        ("sem(conj, _, _, _, _D).\n", 1, "list of variables"),
        ("says(conj, _, [A], Xs, both(A@Xs)).\n", 1, "no part of a formula"),
        ("says(conj, _, [_A], _Xs, neg(_)).\n", 1, "is a variable"),
        ("cost(conj, -1).\n", 1, "natural number"),
        ("\ncost(fooo, 1).\n", 2, "does not exist"),
        ("cost(plain, 0).\ncost(negated, 0).\nrule(a, [con(X)], con(X), 1).\ncost(a, 0).\n", 4, "at least 1"),
        ("law(a, conj(A, fooo(A)), A).\n", 1, "fooo/1, which is no rule"),
        ("law(a, conj(A, A), B).\n", 1, "left side lacks"),
        ("law(a, A, A).\n", 1, "left side"),
        ('concept("A(x)", "Red(x", 1).\n', 1, "at character 6"),
        ('concept("A(x,y,z)", "Red(x)", 1).\n', 1, "at most two arguments"),
        ('concept("A(x)", "Red(x)", 0).\n', 1, "positive"),
        ("concept(a(X), red(X), 1).\n", 1, "a concept is"),
        ('concept("A(x)", "Red(x)", 1).\nconcept("A(y)", "Red(y)", 1).\n', 2, "exists already"),
        ("sem(conj, _, _, [A], A) :- call(A).\n", 1, "not a primitive"),
        ("sem(conj, _, _, [A], A) :- A.\n", 1, "calls a variable"),
        ("sem(conj, _, _, [A], A) :- other:meet(A, A, A).\n", 1, "not a primitive"),
        ("term_expansion(A, A).\n", 1, "cannot contain"),
        ("rule(a, [con(X)], cone(X), 1).\n", 1, "unknown class"),
        ("rule(a, [con(X)], con(X), 0).\n", 1, "at least 1"),
        ("rule(a, [con(X)], con(X), many).\n", 1, "natural number"),
        ("rule(conj, [con(X)], con(X), 1).\n", 1, "exists already"),
        ("rule(a, [con(X)], con(X), 1).\n", 1, "has no sem/5"),
        ("rule(a, [con(X)], con(Y), 1).\n", 1, "occurs only once"),
        ("\noff(fooo).\n", 2, "does not exist"),
    ],
)
def test_bad_grammars_are_refused_with_their_line(tmp_path: Path, text: str, line: int, message: str) -> None:
    path = tmp_path / "bad.lp"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        check_grammars([path])
    assert (line, str(path)) in [(d.line, str(d.path)) for d in caught.value.diagnostics if message in d.message]


def test_missing_grammar_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        check_grammars([tmp_path / "none.lp"])


# ---- Limits, errors, text


def test_time_limit() -> None:
    with pytest.raises(LimitReached, match="time limit"):
        generate_pool(synthetic.load((4, 5)).text(), max_cost=9, time_limit=1)


def test_memory_limit() -> None:
    with PrologProcess(memory_mb=600) as prolog, pytest.raises(LimitReached, match="memory"):
        prolog.text("numlist(1, 100000000, L), length(L, N), write(N)")


def test_interrupt_ends_the_child_too(tmp_path: Path) -> None:
    (tmp_path / "facts.pl").write_text(synthetic.load((4, 5)).text())
    program = (
        "from pathlib import Path; from gentamp_lp.features.pool import generate_pool\n"
        "generate_pool(Path('facts.pl').read_text(), max_cost=9)"
    )
    child = subprocess.Popen([sys.executable, "-c", program], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    time.sleep(1)
    child.send_signal(signal.SIGINT)
    _, messages = child.communicate(timeout=60)  # returns only when the pipe is closed by grandchildren too
    assert "KeyboardInterrupt" in messages


def test_unknown_facts_are_refused() -> None:
    with pytest.raises(SolverError, match="training_fact"):
        generate_pool("sort(object). colour(b).", max_cost=1)


def test_a_broken_promise_of_at_most_one_is_refused() -> None:
    text = TINY.text() + "at_most_one(movable).\n"
    with pytest.raises(SolverError, match="at_most_one"):
        generate_pool(text, max_cost=1)


def test_missing_prolog_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyswip", None)
    with pytest.raises(InputError, match="swi-prolog-nox"):
        Prolog()


def test_load_reports_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "bad.pl"
    path.write_text("good(1).\nbad(.\ngood(X).\n")
    with PrologProcess() as prolog:
        found = prolog.load(path)
    assert [(d.line, "yntax" in d.message) for d in found if d.line == 2] == [(2, True)]
    assert all(str(d.path) == str(path) for d in found)


def test_goals_in_this_process() -> None:
    prolog = Prolog()
    assert prolog.rows("member(X-Y, [a-1, 'it''s'-2])", "X", "Y") == [("a", "1"), ("it's", "2")]
    assert prolog.holds("true") and not prolog.holds("fail")
    assert prolog.text(f"write({quote_atom(chr(39) + 'a' + chr(92))})") == "'a\\"
    with pytest.raises(SolverError, match="no_such_goal"):
        prolog.holds("no_such_goal")


@pytest.mark.parametrize("path", sorted(LOGIC.glob("*.plt")), ids=lambda path: path.stem)
def test_prolog_units(path: Path) -> None:
    command = ["swipl", "--on-error=status", "--on-warning=status", "-g", "run_tests", "-t", "halt", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
