"""`gentamp-lp features`: the pool for people, formulas of theirs, and what the documentation says about the paper's."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.commands import run

from gentamp_lp.errors import InputError
from gentamp_lp.features.listing import ListedFeature, Listing, formula_file, list_features
from gentamp_lp.tasks.task import Task

DOCS = Path(__file__).parents[2] / "docs"
TASKS = {"unstack": "unstack", "sort": "sort", "clutter": "clutter", "transport": "load", "load": "load"}


def documented() -> Iterator[tuple[str, str, str, str, str, str]]:
    for line in (DOCS / "pool.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        task, _, name = cells[0].partition(" ")
        if task.lower() in TASKS and re.match(r"[Ff]\d", name):
            yield (task.lower(), name, *cells[1:])


ROWS = list(documented())


def test_all_features_of_the_paper_are_documented() -> None:
    printed = {(task, name) for task, name, *_ in ROWS if " " not in name}
    counts = {"unstack": 2, "sort": 7, "clutter": 2, "transport": 5, "load": 4}
    assert {task: sum(t == task for t, _ in printed) for task in TASKS} == counts


@pytest.mark.parametrize("task", sorted(set(TASKS.values())))
def test_the_table_of_the_papers_features_is_true(task: str) -> None:
    appendices = [name for name, its_task in TASKS.items() if its_task == task]
    formulas = [f"{name} {line}" for name in appendices for line in formula_file(DOCS / "appendix" / f"{name}.txt")]
    listed = list_features(Task.load(task), complexity=4, formulas=formulas)
    for row in ROWS:
        if row[0] in appendices:
            check_row(row, listed)


def check_row(row: tuple[str, ...], listed: Listing) -> None:
    appendix, name, formula, cost, mark, pool = row
    [asked] = [f for f in listed.formulas if f.name == f"{appendix} {name}"]
    assert (asked.formula, str(asked.cost), "open" if asked.open else "closed") == (formula, cost, mark), row
    match = next((f for f in listed.features if f.id == asked.match), None)
    if match is None:
        assert {"constant": "the same value", "absent": "beyond the bound"}[asked.how] in pool, row
        assert asked.how == "constant" or asked.cost > listed.complexity, row
    elif match.formula == asked.formula:
        assert pool == "yes", row
    else:
        assert pool == f"{asked.how.replace('_', ' ')}, cost {match.cost}: {match.formula}", row
        assert match.cost <= asked.cost, row


def test_features_of_the_transport_base_are_read_too(tmp_path: Path) -> None:
    """Transport F6 needs predicates in the words of the paper."""
    from gentamp_lp.features.pool import PoolSession

    facts = """sort(q). predicate(atbconf, [q]). display(atbconf, "AtBConf"). predicate(atstove, [q]).
      display(atstove, "AtStove"). problem(0). entity(0, q, q0). entity(0, q, q1). state(0, 0). state(1, 0).
      static(0, atstove(q1)). fluent(0, atbconf(q0)). fluent(1, atbconf(q1)). transition(0, 0, 1)."""
    with PoolSession(facts) as session:
        pool = session.deepen(2)
        reading = session.read("AtBConf(y0) & AtStove(y0)")
        assert (reading.cost, reading.values, reading.satisfying) == (2, [0, 1], {0: [], 1: ["q1"]})
        assert reading.how == "same_values"
        assert reading.text == "AtBConf(x) ∧ AtStove(x)"
        assert pool.kinds[reading.match or 0][0] == 2


# ---- The command


def test_list_match_and_state() -> None:
    done = run("features", "load", "--match", "on ( x", "--state", "3")
    assert done.returncode == 0, done.stderr
    first, *rows = done.stdout.splitlines()
    assert first.startswith("state 3 (size 3-1, seed 0): AtBase(at_base), AtGrasp(tray")
    assert rows and all("On(x" in row for row in rows)
    assert any(re.search(r"cost 2  numeric  closed  \d\.\.\d  ∃y On\(x,y\) ∧ .*\[1: thing1\]", row) for row in rows)
    assert "pruned by laws" in done.stderr


def test_formulas_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("% two\nheld = Holding(x) & ~Tray(x)\n\n#p: ~exists o: Unsafe(o,p)\n")
    done = run("features", "load", "--state", "0", "--formula", f"@{tmp_path / 'mine.txt'}", "--formula", "HandEmpty")
    assert done.returncode == 0, done.stderr
    text = re.sub(r"#\d+", "#N", done.stdout)
    assert "held = Holding(x) ∧ ¬Tray(x)   [0: ]\n       cost 2  closed  0..1  #N, same values\n" in text
    assert "¬∃y Unsafe(y,x)   [" in text and "open" in text
    assert "HandEmpty\n       cost 1  closed  0..1  #N, complement\n       #N, cost 1: Holding(x)\n" in text


def test_json_has_values_for_all_states() -> None:
    done = run("features", "unstack", "--max-complexity", "2", "--state", "0", "--formula", "Holding(x)", "--json")
    report = json.loads(done.stdout)
    assert report["pool_size"] == len(report["features"])
    for row in report["features"]:
        assert len(row["values"]) == report["states"]
        assert (row["satisfying"] is None) == (row["why"] == "closed formula")
        assert row["satisfying"] is None or len(row["satisfying"]) == row["values"][0]
    holding = next(row for row in report["features"] if row["formula"] == "Holding(x)")
    assert (holding["kind"], holding["why"], holding["open"]) == ("boolean", "at most one, by the actions", False)
    assert report["formulas"][0]["match"] == holding["id"]
    assert {row["rule"] for row in report["pruning"]} >= {"views", "literal", "some", "features"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("load", "--formula", "On(x"), "expected `)` instead of the end (character 5)"),
        (("load", "--formula", "Flies(x)"), "there is no predicate `Flies`"),
        (("load", "--formula", "AtPose(x,y) & exists z: On(y,z)"), "at most one variable may be free"),
        (("load", "--formula", "exists y: AtPose(x,y) & On(y,x)"), "cannot be that argument of On"),
        (("load", "--state", "999"), "states are 0 to"),
        (("load", "--grammar", "papre"), "one of: paper"),
        (("load", "--formula", "@missing.txt"), "missing.txt"),
        (("load", "--size", "3-2-1"), "is not a size"),
    ],
)
def test_mistakes_are_explained(arguments: tuple[str, ...], message: str) -> None:
    done = run("features", *arguments, "-q")
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stdout == ""


def test_other_problems_than_the_training_problems() -> None:
    few = list_features(Task.load("unstack"), complexity=1, sizes=["3"])
    assert few.states < list_features(Task.load("unstack"), complexity=1).states
    with pytest.raises(InputError, match="not a size"):
        list_features(Task.load("unstack"), sizes=["3-3"])


# ---- The examples of the documentation


def documented_clauses(name: str) -> None:
    text = (DOCS / "pool.md").read_text(encoding="utf-8")
    clauses = [
        line for line in (DOCS / "examples" / "05-own-words" / name).read_text().splitlines() if line and line[0] != "%"
    ]
    assert "\n".join(clauses) in text


def test_the_example_above_adds_a_closure() -> None:
    documented_clauses("above.lp")
    grammars = [DOCS / "examples" / "05-own-words" / "above.lp"]
    text = "#y: exists x: {u,w | On(u,w)}+(x,y) & ~exists z: On(z,x)"
    listed = list_features(
        Task.load("unstack"), complexity=4, sizes=["4", "6"], grammars=grammars, formulas=[text], match="⁺"
    )
    assert listed.features
    assert listed.formulas[0].values[0] > 0


def test_the_example_home_adds_a_word() -> None:
    documented_clauses("home.lp")
    listed = list_features(
        Task.load("sort"),
        complexity=2,
        grammars=[DOCS / "examples" / "05-own-words" / "home.lp"],
        formulas=["Movable(x) & ~AtHome(x)"],
    )

    def with_word(feature: ListedFeature) -> bool:
        return "Red(y) ∧ Red(z)" in feature.formula or "Red(x) ∧ Red(y)" in feature.formula

    assert any(with_word(f) and f.cost == 1 for f in listed.features)
    [asked] = listed.formulas
    assert asked.how in ("same_values", "same_behaviour")
    match = next(f for f in listed.features if f.id == asked.match)
    assert match.cost == 2 < asked.cost
