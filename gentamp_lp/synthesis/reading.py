"""Which format a problem has, and how graph facts and QNP facts become a `Problem`.

Graph facts (names are terms; transitions out of goals are ignored):

    state(S). initialState(S). goal(S). action(A). transition(S, A, S2).
    con_A(A, I). con_B(A, I).       conditional fairness, see problem.py; optional

QNP facts:

    numeric(V). boolean(V). action(A).
    init(V, Value). goal(V, Value). pre(A, V, Value).   Value: positive, zero for a numeric variable,
                                                        true, false for a Boolean
    eff(A, V, Effect).              Effect: increase, decrease (which needs V positive, said or not),
                                    true, false

A variable without init/2 may start with either value. The states are made by the rules of `asp/qnp.lp`.

PDDL (files named .pddl) is read by fond.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from gentamp_lp.base.reading import read_text
from gentamp_lp.base.shipped import resource
from gentamp_lp.base.terms import Fact, read_facts
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.solvers.asp import consequences
from gentamp_lp.synthesis.fond import parse_fond
from gentamp_lp.synthesis.problem import Choice, Problem, reachable

Source = tuple[str, str]  # name and text of a file

_GRAPH = {"state": 1, "initialState": 1, "goal": 1, "action": 1, "transition": 3, "con_A": 2, "con_B": 2}
_QNP = {"numeric": 1, "boolean": 1, "action": 1, "init": 2, "goal": 2, "pre": 3, "eff": 3}
_VALUES = {"numeric": ("positive", "zero"), "boolean": ("true", "false")}
_EFFECTS = {"numeric": ("increase", "decrease"), "boolean": ("true", "false")}
_MOST_VARIABLES = 24  # a state is a number of that many bits


def read_problem(files: Sequence[Path | str]) -> Problem:
    """Read a problem from its file or files; an InputError names file and line."""
    return parse_problem(read_sources(files))


def read_sources(files: Sequence[Path | str]) -> list[Source]:
    """Return the names and texts of files."""
    sources = []
    for file in files:
        sources.append((str(file), read_text(Path(file))))
    return sources


def parse_problem(sources: Sequence[Source]) -> Problem:
    """Read a problem from texts; the ending of the names tells the format."""
    endings = {Path(name).suffix for name, _ in sources}
    if endings == {".pddl"}:
        return parse_fond(sources)
    if endings != {".lp"}:
        name = next((name for name, _ in sources if Path(name).suffix != ".lp"), None)
        hint = "name files of facts .lp, domain and problem .pddl, and do not mix them"
        raise InputError(Diagnostic("cannot tell the format", name, hint=hint))
    facts = [fact for name, text in sources for fact in read_facts(text, name)]
    first = next((fact for fact in facts if (fact.name in _QNP) != (fact.name in _GRAPH)), None)
    qnp = first is not None and first.name in _QNP
    _check_vocabulary(facts, _QNP if qnp else _GRAPH)
    return _Qnp(facts, sources[0][0]).problem() if qnp else _graph(facts, sources[0][0])


def _check_vocabulary(facts: Iterable[Fact], known: dict[str, int]) -> None:
    hint = "known: " + ", ".join(f"{name}/{arity}" for name, arity in known.items())
    for fact in facts:
        if fact.name not in known:
            raise fact.error(f"unknown predicate {fact.name}/{len(fact.args)}", hint)
        if len(fact.args) != known[fact.name]:
            raise fact.error(f"{fact.name} takes {known[fact.name]} argument(s), not {len(fact.args)}", hint)


def _graph(facts: list[Fact], path: str) -> Problem:
    state = _numbers(facts, "state")
    _require(facts, path, "initialState", "goal")
    constraint: dict[str, int] = {}
    sides: dict[str, dict[str, set[int]]] = {"con_A": {}, "con_B": {}}
    actions = {fact.args[0] for fact in facts if fact.name == "action"}
    outcomes: dict[tuple[int, str], list[int]] = {}
    for fact in facts:
        if fact.name in ("initialState", "goal"):
            _known(fact, 0, state, "state")
        elif fact.name in sides:
            _known(fact, 0, actions, "action")
            number = constraint.setdefault(fact.args[1], len(constraint))
            sides[fact.name].setdefault(fact.args[0], set()).add(number)
        elif fact.name == "transition":
            _known(fact, 0, state, "state")
            _known(fact, 1, actions, "action")
            _known(fact, 2, state, "state")
            outcomes.setdefault((state[fact.args[0]], fact.args[1]), []).append(state[fact.args[2]])
    choices = tuple(
        Choice(s, a, tuple(after), frozenset(sides["con_A"].get(a, ())), frozenset(sides["con_B"].get(a, ())))
        for (s, a), after in outcomes.items()
    )
    initial = sorted({state[fact.args[0]] for fact in facts if fact.name == "initialState"})
    goals = frozenset(state[fact.args[0]] for fact in facts if fact.name == "goal")
    return reachable(Problem(tuple(state), tuple(initial), goals, choices, tuple(constraint)))


def _numbers(facts: Iterable[Fact], *names: str) -> dict[str, int]:
    """Number the first arguments of some predicates in order."""
    found = dict.fromkeys(fact.args[0] for fact in facts if fact.name in names)
    return {name: i for i, name in enumerate(found)}


def _require(facts: Iterable[Fact], path: str, *names: str) -> None:
    given = {fact.name for fact in facts}
    for name in names:
        if name not in given:
            raise InputError(Diagnostic(f"there is no {name} fact", path))


def _known(fact: Fact, position: int, names: Iterable[str], what: str) -> None:
    name = fact.args[position]
    if name not in names:
        raise fact.error(f"{fact}: no such {what} `{name}`", f"add {what}({name}).")


class _Qnp:
    def __init__(self, facts: list[Fact], path: str) -> None:
        self.facts = facts
        self.number = _numbers(facts, "numeric", "boolean")
        self.action = _numbers(facts, "action")
        self.kind = {fact.args[0]: fact.name for fact in reversed(facts) if fact.name in _VALUES}
        _require(facts, path, "goal", "action")
        if len(self.number) > _MOST_VARIABLES:
            raise InputError(Diagnostic(f"{len(self.number)} variables; at most {_MOST_VARIABLES} are supported", path))
        self.check()

    def check(self) -> None:
        said: dict[tuple[str, ...], Fact] = {}
        for fact in self.facts:
            if fact.name in _VALUES:
                if self.kind[fact.args[0]] != fact.name:
                    raise fact.error(f"{fact.args[0]} is both numeric and boolean")
            elif fact.name != "action":
                *where, variable, value = fact.args
                for _ in where:
                    _known(fact, 0, self.action, "action")
                if variable not in self.kind:
                    raise fact.error(f"{fact}: no such variable `{variable}`", f"add numeric({variable}) or boolean")
                allowed = (_EFFECTS if fact.name == "eff" else _VALUES)[self.kind[variable]]
                if value not in allowed:
                    kind = self.kind[variable]
                    raise fact.error(f"{fact}: `{value}` does not fit", f"{kind}: {' or '.join(allowed)}")
                other = said.setdefault((fact.name, *where, variable), fact)
                if other.args != fact.args:
                    raise fact.error(f"{fact} contradicts {other} in line {other.line}")
        for fact in self.facts:
            if fact.name == "eff" and fact.args[2] == "decrease":
                other = said.get(("pre", *fact.args[:2]), fact)
                if other.args[2] == "zero":
                    raise fact.error(f"{fact} contradicts {other} in line {other.line}")

    def encoded(self) -> str:
        """Return the input of `asp/qnp.lp`: variables, actions and their effects are numbers."""
        lines = [f"variable({number},{1 << number})." for number in self.number.values()]
        position = dict.fromkeys(self.action, 0)
        look: dict[str, Callable[[str], object]] = {"a": self.action.__getitem__, "v": self.number.__getitem__}
        for fact in dict.fromkeys((fact.name, fact.args) for fact in self.facts):
            name, args = fact
            if name in ("init", "goal"):
                lines.append(f"{name}({look['v'](args[0])},{args[1]}).")
            elif name == "pre":
                lines.append(f"pre({look['a'](args[0])},{look['v'](args[1])},{args[2]}).")
            elif name == "eff":
                lines.append(f"eff({look['a'](args[0])},{position[args[0]]},{look['v'](args[1])},{args[2]}).")
                position[args[0]] += 1
        lines += [f"effects({self.action[name]},{count})." for name, count in position.items()]
        return "\n".join([*lines, f"variables({len(self.number)})."])

    def problem(self) -> Problem:
        wanted = {"initial": 1, "done": 1, "transition": 3, "con_A": 2, "con_B": 2}
        found = consequences([resource("asp", "qnp.lp")], self.encoded(), wanted)
        names = list(self.action)
        codes = sorted({row[0] for row in found["initial"]} | {row[2] for row in found["transition"]}, reverse=True)
        state = {code: i for i, code in enumerate(codes)}
        outcomes: dict[tuple[int, int], list[int]] = {}
        for before, action, after in found["transition"]:
            outcomes.setdefault((before, action), []).append(state[after])
        sides: dict[str, dict[int, set[int]]] = {"con_A": {}, "con_B": {}}
        for side, actions in sides.items():
            for action, variable in found[side]:
                actions.setdefault(action, set()).add(variable)
        choices = tuple(
            Choice(
                state[before], names[action], tuple(sorted(after)),
                frozenset(sides["con_A"].get(action, ())), frozenset(sides["con_B"].get(action, ())),
            )
            for (before, action), after in sorted(outcomes.items(), key=lambda row: (-row[0][0], row[0][1]))
        )  # fmt: skip
        return reachable(
            Problem(
                tuple(self.show(code) for code in codes),
                tuple(sorted(state[row[0]] for row in found["initial"])),
                frozenset(state[row[0]] for row in found["done"]),
                choices,
                tuple(self.number),
                numeric=True,
            )
        )

    def show(self, code: int) -> str:
        """Return a state as its conditions, e.g. `holding, n=0` or `-holding, n>0`."""
        return ", ".join(
            (f"{name}>0" if code >> i & 1 else f"{name}=0")
            if self.kind[name] == "numeric"
            else (name if code >> i & 1 else f"-{name}")
            for name, i in self.number.items()
        )
