"""Domain and stream files at random: a diagnosis or a result, never a traceback or a hang."""

import re
import time

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings
from test_negation import problem
from test_solve import DOOR, DOOR_STREAMS, SHELF, SHELF_STREAMS, TRAVEL

from gentamp_lp.errors import InputError, SolverError
from gentamp_lp.streams import PDDLProblem, from_fn, from_test, solve
from gentamp_lp.streams.pddl import parse_domain
from gentamp_lp.streams.stream_file import parse_streams

WORDS = sorted({
    *re.findall(r"\(|\)|[^\s()]+", TRAVEL + SHELF + SHELF_STREAMS + DOOR + DOOR_STREAMS),
    "either", "imply", "or", ":fluents", ":optimizer", ":durative-action", "0", "-1", "nan", "?", "-", "=", "object",
})  # fmt: skip
PAIRS = ((TRAVEL, ""), (SHELF, SHELF_STREAMS), (DOOR, DOOR_STREAMS))


@st.composite
def broken(draw: st.DrawFn) -> tuple[str, str]:
    """A pair of files with some words deleted, replaced, doubled or swapped."""
    texts = list(draw(st.sampled_from(PAIRS)))
    for _ in range(draw(st.integers(1, 4))):
        which = draw(st.integers(0, 1 if texts[1] else 0))
        words = re.findall(r"\(|\)|[^\s()]+", texts[which])
        here = draw(st.integers(0, len(words) - 1))
        other = draw(st.one_of(st.sampled_from(WORDS), st.just(words[draw(st.integers(0, len(words) - 1))])))
        match draw(st.integers(0, 3)):
            case 0:
                del words[here]
            case 1:
                words[here] = other
            case 2:
                words.insert(here, other)
            case _:
                there = draw(st.integers(0, len(words) - 1))
                words[here], words[there] = words[there], words[here]
        texts[which] = " ".join(words)
    return texts[0], texts[1]


def parse(files: tuple[str, str]) -> None:
    try:
        domain = parse_domain(files[0], "domain.pddl")
        if files[1]:
            parse_streams(files[1], domain, "stream.pddl")
    except InputError as error:
        assert all(d.line and str(d.path).endswith(".pddl") for d in error.diagnostics)


def run(files: tuple[str, str]) -> None:
    """Solve whatever can be read with streams that give something."""
    names = re.findall(r"[^\s()]+", files[1])
    functions = {name.lower(): from_fn(lambda *_, **__: ("v",)) for name in names}
    functions |= dict.fromkeys(("t-near", "good"), from_test(lambda *_: True))
    functions |= dict.fromkeys(("height", "unused", "stable"), lambda *_: 1)  # type: ignore[arg-type]
    init = [("Item", "a"), ("Conf", "a"), ("Conf", "b"), ("At", "a"), ("Door", "d")]
    goals = {TRAVEL: ("Ticket",), SHELF: ("Seen", "v"), DOOR: ("At", "b")}
    start = time.monotonic()
    try:
        domain = parse_domain(files[0])
        known = [f for f in init if f[0].lower() in domain.predicates]
        known = [f for f in known if domain.predicates[f[0].lower()].arity == 1]
        goal = next(g for text, g in goals.items() if text[:25] == files[0][:25] or g[0].lower() in domain.predicates)
        result = solve(PDDLProblem(files[0], {}, files[1] or None, functions, known, goal), max_time=5)
        assert result.plan is not None or result.report.reason
    except InputError as error:
        assert str(error)
    except StopIteration:
        pass
    assert time.monotonic() - start < 60, "hung beyond the time limit"


@settings(max_examples=400, deadline=None, suppress_health_check=list(HealthCheck))
@given(broken())
def test_broken_files_are_diagnosed(files: tuple[str, str]) -> None:
    parse(files)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(broken())
def test_what_can_be_read_can_be_solved_or_refused(files: tuple[str, str]) -> None:
    run(files)


@pytest.mark.slow
@settings(max_examples=5000, deadline=None, suppress_health_check=list(HealthCheck))
@given(broken())
def test_thousands_of_broken_files(files: tuple[str, str]) -> None:
    parse(files)


@pytest.mark.slow
@settings(max_examples=600, deadline=None, suppress_health_check=list(HealthCheck))
@given(broken())
def test_hundreds_of_broken_problems(files: tuple[str, str]) -> None:
    run(files)


@pytest.mark.filterwarnings("ignore:.*is not declared in the domain")
@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.recursive(st.one_of(st.text(max_size=3), st.integers(), st.none()),
                    lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=6))  # fmt: skip
def test_goals_at_random(goal: object) -> None:
    with pytest.raises((InputError, SolverError)):
        solve(problem("A", 0)._replace(goal=("and", ("Red", 1, 2, 3), goal)), max_time=5)
    with pytest.raises(InputError):
        solve(problem("A", 0)._replace(goal=goal, init=[goal]), max_time=5)
