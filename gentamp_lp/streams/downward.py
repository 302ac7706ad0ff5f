"""Fast Downward as a subprocess: search a sampled problem, read the plan.

The translator runs with binary variables (`--invariant-generation-max-candidates 0`): the negation of a
disjunction over a many-valued variable is otherwise expanded exponentially by the heuristics.
"""

from __future__ import annotations

import math
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from gentamp_lp.errors import Diagnostic, InputError, LimitReached, MemoryLimitReached, SolverError
from gentamp_lp.solvers.processes import start
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.problem_text import COST_SCALE, write_problem
from gentamp_lp.streams.semantics import Program, State, Step

MEMORY_LIMIT = 4 * 1024**3  # bytes, as each run of the paper had
#: Tried in turn, shortly at first, then each with a share of the remaining time; the last one gets all of it.
SEARCHES = (
    "eager(alt([tiebreaking([sum([g(),ff()]),ff()]),tiebreaking([sum([g(),ff()]),ff()],pref_only=true)]),"
    "reopen_closed=true,preferred=[ff()])",
    "lazy_greedy([ff(),goalcount()],preferred=[ff()])",
    "lazy_greedy([goalcount()])",
)
_SHARES = (0.5, 0.7, 1.0)
_FIRST = (0.5, 2.0, 8.0)  # seconds that each of several searches gets at most, in rounds, before any gets its share
#: The planner names of PDDLStream. `lmcut` cannot handle derived predicates, so hmax takes its place.
PLANNERS = {
    "dijkstra": "astar(blind())",
    "max-astar": "astar(hmax())",
    "lmcut-astar": "astar(hmax())",
    "ff-astar": "astar(ff())",
    "ff-eager": "eager_greedy([ff()])",
    "ff-eager-pref": "eager_greedy([ff()],preferred=[ff()])",
    "ff-lazy": "lazy_greedy([ff()],preferred=[ff()])",
    "goal-lazy": "lazy_greedy([goalcount()])",
    "add-random-lazy": "lazy_greedy([add()],preferred=[add()],randomize_successors=true)",
    "ff-eager-tiebreak": "eager(tiebreaking([ff(),g()]),reopen_closed=false)",
    "ff-lazy-tiebreak": "lazy(tiebreaking([ff(),g()]),reopen_closed=false)",
    "ff-ehc": "ehc(ff(),preferred=[ff()])",
    **{f"ff-wastar{w}": f"lazy_wastar([ff()],preferred=[ff()],w={w})" for w in range(1, 6)},
    **{f"cea-wastar{w}": f"lazy_wastar([cea()],preferred=[cea()],w={w})" for w in range(1, 6)},
    **{f"ff-astar{w}": f"eager_wastar([ff()],w={w})" for w in range(1, 6)},
}
_SOLVED, _UNSOLVABLE, _OUT_OF_MEMORY, _OUT_OF_TIME = {0, 1, 2, 3}, {10, 11, 12, 13}, {20, 22}, {21, 23, 24}
_NO_MEMORY = re.compile(r"MemoryError|emergency_memory|failed to map segment|bad_alloc")  # died before it could say so
_INCOMPLETE = 12  # the search space is exhausted, but the search prunes unsafely


def binary() -> Path:
    """The search program. Raises InputError when the package is missing."""
    spec = find_spec("up_fast_downward")
    if spec is not None and spec.submodule_search_locations:
        path = Path(spec.submodule_search_locations[0], "downward", "builds", "release", "bin", "downward")
        if path.exists():
            return path
    raise InputError(Diagnostic("Fast Downward is missing", hint="pip install up-fast-downward"))


def search(
    program: Program,
    base: FactBase,
    state: State,
    goal: Formula,
    *,
    time_limit: float,
    searches: tuple[str, ...] = SEARCHES,
    seed: int | None = None,
    memory_limit: int = MEMORY_LIMIT,
    max_cost: float = math.inf,
    unit_costs: bool = False,
    exact: bool = False,
) -> list[Step] | None:
    """Plan over the facts known so far; None when these do not admit a plan of at most `max_cost`.

    See `translated` for the arguments. Raises LimitReached when every search hit the time or memory limit, SolverError
    when Fast Downward fails.
    """
    deadline = time.monotonic() + time_limit
    with translated(
        program, base, state, goal,
        time_limit=time_limit, seed=seed, memory_limit=memory_limit, unit_costs=unit_costs, exact=exact,
    ) as planner:  # fmt: skip
        return planner(searches, deadline - time.monotonic(), max_cost)


#: What `translated` gives: called with searches, seconds and the maximal cost, it returns a plan or None.
Planner = Callable[[tuple[str, ...], float, float], list[Step] | None]


@contextmanager
def translated(
    program: Program,
    base: FactBase,
    state: State,
    goal: Formula,
    *,
    time_limit: float,
    seed: int | None = None,
    memory_limit: int = MEMORY_LIMIT,
    unit_costs: bool = False,
    exact: bool = False,
) -> Iterator[Planner]:
    """A problem translated for Fast Downward once, to be searched as often as wanted.

    Fast Downward breaks ties by name. With a `seed`, entities get other names at random, so that which of several like
    things comes first says nothing. See `write_problem` for `exact`. `memory_limit` is in bytes.

    Raises LimitReached when the translation hits the time or memory limit, SolverError when it fails.
    """
    with tempfile.TemporaryDirectory(prefix="gentamp-fd-") as folder:
        here = Path(folder)
        names = _disguises(base, seed)
        domain_text, problem_text = write_problem(program, base, state, goal, unit_costs=unit_costs, exact=exact)
        (here / "domain.pddl").write_text(_rename(domain_text, names))
        (here / "problem.pddl").write_text(_rename(problem_text, names))
        translate = [
            sys.executable, "-m", "fast_downward.translate", "--invariant-generation-max-candidates", "0",
            "domain.pddl", "problem.pddl",
        ]  # fmt: skip
        code, output = _run(translate, here, time_limit, memory_limit)
        if code in _OUT_OF_MEMORY:
            raise MemoryLimitReached("translating the sampled problem for Fast Downward ran out of memory")
        if code in _OUT_OF_TIME:
            raise LimitReached("translating the sampled problem for Fast Downward reached its time limit")
        if code != 0 and code not in _UNSOLVABLE:
            raise SolverError(f"Fast Downward's translator failed with code {code}:\n{output[-2000:]}")
        old_names = {new: old for old, new in names.items()}

        def planner(searches: tuple[str, ...], seconds: float, max_cost: float) -> list[Step] | None:
            if code in _UNSOLVABLE or not _search(here, searches, seconds, memory_limit, max_cost, unit_costs):
                return None
            return _read_plan(_rename((here / "sas_plan").read_text(), old_names))

        yield planner


def _search(
    here: Path, searches: tuple[str, ...], seconds: float, memory_limit: int, max_cost: float, unit_costs: bool
) -> bool:
    """Try each search with its share of the time; True when one has written a plan, False when there is none."""
    deadline = time.monotonic() + seconds
    shares = tuple(zip(searches, _SHARES[-len(searches) :], strict=True))
    turns = [(*turn, most) for most in (*(_FIRST if len(searches) > 1 else ()), math.inf) for turn in shares]
    given_up: set[str] = set()
    for string, share, most in turns:
        left = min(most, share * (deadline - time.monotonic()))
        if string in given_up:
            continue
        command = [str(binary()), "--search", _bounded(string, max_cost, unit_costs)]
        with (here / "output.sas").open("rb") as task:
            code, output = _run(command, here, left, memory_limit, task)
        if code in _SOLVED:
            return True
        if code == _INCOMPLETE and not string.startswith("ehc"):
            return False
        if code in _UNSOLVABLE - {_INCOMPLETE}:
            return False
        if code not in _OUT_OF_TIME | _OUT_OF_MEMORY | {_INCOMPLETE}:
            raise SolverError(f"Fast Downward failed with code {code}:\n{output[-2000:]}")
        if code not in _OUT_OF_TIME:
            given_up.add(string)
    allowed = f"{seconds:.0f} s and {memory_limit / 1024**3:.1f} GiB"
    if code in _OUT_OF_MEMORY:
        raise MemoryLimitReached(f"Fast Downward found no plan within {allowed}: out of memory")
    raise LimitReached(f"Fast Downward found no plan within {allowed}")


def _bounded(string: str, max_cost: float, unit_costs: bool) -> str:
    """The search restricted to plans of at most this cost (Fast Downward's bound excludes its value)."""
    if max_cost == math.inf:
        return string
    bound = max(0, math.floor(max_cost + 1e-9) + 1 if unit_costs else math.floor(COST_SCALE * max_cost + 1e-6) + 1)
    return f"{string[:-1]},bound={min(bound, 10**9)})"


def _disguises(base: FactBase, seed: int | None) -> dict[str, str]:
    """Other names for all entities, in random order; none without a seed."""
    if seed is None:
        return {}
    names = sorted(base.values)
    random.Random(seed).shuffle(names)
    return {name: f"e{number:06}" for number, name in enumerate(names)}


def _rename(text: str, names: Mapping[str, str]) -> str:
    """Replace entities in PDDL text: whatever does not follow a parenthesis, where predicates stand."""
    if not names:
        return text
    return re.sub(r"(?<=\s)[^\s()]+", lambda found: names.get(found[0], found[0]), text)


def _read_plan(text: str) -> list[Step]:
    lines = (line.strip("() ").split() for line in text.splitlines() if line.startswith("("))
    return [Step(name, tuple(args)) for name, *args in lines]


def _limits(seconds: float, memory: int) -> Callable[[], None]:
    def prepare() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        whole = max(1, int(seconds) + 1)
        resource.setrlimit(resource.RLIMIT_CPU, (whole, whole + 1))

    return prepare


def _run(
    command: list[str],
    folder: Path,
    seconds: float,
    memory: int = MEMORY_LIMIT,
    stdin: IO[bytes] | int = subprocess.DEVNULL,
) -> tuple[int, str]:
    if seconds <= 0:
        return 23, ""
    seconds = min(seconds, 10**6)  # the operating system knows no infinite limit
    process = start(
        command,
        _limits(seconds, memory),
        cwd=folder,
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONHASHSEED": "0"},
    )
    try:
        output, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        return 23, ""
    finally:
        process.kill()
        process.communicate()
    if process.returncode == -signal.SIGXCPU:
        return 23, output
    if process.returncode != 0 and _NO_MEMORY.search(output):
        return 22, output
    return process.returncode, output
