"""The policy bundle on disk: a folder that is written whole or not at all and can be edited by hand."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gentamp_lp.base.fairness import LEVELS
from gentamp_lp.base.reading import read_text
from gentamp_lp.base.terms import quote_string, read_facts, unquote
from gentamp_lp.base.writing import writing
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.features.axioms import to_formula
from gentamp_lp.features.feature import Feature
from gentamp_lp.policy.drawing import draw
from gentamp_lp.policy.model import AbstractAction, CertificateStep, PolicyGraph, Rule, Valuation
from gentamp_lp.streams.facts import sort_predicate
from gentamp_lp.streams.formula import atoms

_HEADER = """\
% A generalized policy, as ASP facts. Edit it, then check it: gentamp-lp validate <this folder>
%
%   feature(F, Kind, Cost, Text)  formula in features.pl
%   action(A)                     abstract action: schema(A, Name) made it, precondition(A, F, Value),
%                                 effect(A, F, increase|decrease|true|false)
%   value(S, F, Value)            abstract state S; Value is true|false (boolean), positive|zero (numeric)
%   initial(S), goal(S)           seen in training
%   rule(S, A), outcome(S, S2)    in S do A, which may lead to each S2
%   cut(N, F), within(N, S)       certificate, in order: among these states F falls and never rises
"""
_FEATURES = """\
% The selected features: feature(Name, Kind, Cost, Variable, Sort, Formula).
% A numeric feature counts the values of Variable for which Formula holds; a boolean one is never above 1.
"""
_WORDS = {"boolean": ("false", "true"), "numeric": ("zero", "positive")}
_EFFECTS = {"boolean": ("true", "false"), "numeric": ("increase", "decrease")}


def save(policy: PolicyGraph, folder: Path, *, domain_pddl: str, stream_pddl: str, report: dict[str, Any]) -> None:
    """Write the files beside the folder, then put them in its place."""
    require_place(folder)
    files = {
        "policy.lp": policy_facts(policy),
        "features.pl": feature_clauses(policy),
        "domain.pddl": domain_pddl,
        "stream.pddl": stream_pddl,
        "policy.svg": draw(policy),
        "report.json": json.dumps(report, indent=2, ensure_ascii=False) + "\n",
    }
    folder = folder.absolute()
    with writing(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name[:50]}-", dir=folder.parent) as beside:
            new, old = Path(beside, "new"), Path(beside, "old")
            new.mkdir()
            for name, content in files.items():
                (new / name).write_text(content, encoding="utf-8", newline="\n")
            if folder.exists():
                folder.rename(old)
            try:
                new.rename(folder)
            except OSError:
                if old.exists():
                    old.rename(folder)
                raise
            shutil.rmtree(old, ignore_errors=True)


def require_place(folder: Path) -> None:
    """Raise InputError if the folder cannot be written, holds something else than a policy, or is a link to nothing."""
    hint = "choose another place, or remove what is there"
    with writing(folder):
        if folder.is_symlink() and not os.path.exists(folder):
            raise InputError(Diagnostic("a symbolic link that leads nowhere: not replaced", folder, hint=hint))
        nearest = next(parent for parent in folder.absolute().parents if os.path.exists(parent))
        if not os.access(os.path.join(nearest, ""), os.W_OK):
            raise InputError(Diagnostic(f"cannot write the policy: no place in `{nearest}`", folder, hint=hint))
        if folder.exists() and not (folder / "policy.lp").is_file() and (folder.is_file() or any(folder.iterdir())):
            raise InputError(Diagnostic("not a policy bundle, and not empty: not replaced", folder, hint=hint))


def named_states(policy: PolicyGraph) -> list[tuple[str, Valuation, Rule | None]]:
    """Return the abstract states of policy.lp, each with its rule: s1, s2, ... as the rules meet them.

    No state should have a second rule; if one has, that rule is written under a second name of the state.
    """
    rules: dict[Valuation, Rule] = {}
    more = []
    for rule in policy.rules:
        if rule.valuation in rules:
            more.append((rule.valuation, rule))
        else:
            rules[rule.valuation] = rule
    valuations = dict.fromkeys(
        [
            *rules,
            *(after for rule in policy.rules for after in rule.outcomes),
            *policy.goals,
            *policy.initial,
            *(valuation for step in policy.certificate for valuation in step.states),
        ]
    )
    rows = [*((valuation, rules.get(valuation)) for valuation in valuations), *more]
    return [(f"s{i}", *row) for i, row in enumerate(rows, 1)]


def policy_facts(policy: PolicyGraph) -> str:
    """Return policy.lp."""
    states = named_states(policy)
    name = {valuation: state for state, valuation, _ in reversed(states)}
    kind = {feature.name: feature.kind for feature in policy.features}
    lines = [_HEADER, f"task({quote_string(policy.task)}).", f"fairness({quote_string(policy.fairness)})."]
    lines += [f"cost({policy.cost}).  bound({policy.bound}).  optimal({'yes' if policy.optimal else 'no'})."]
    extra = {name: json.dumps(value, ensure_ascii=False) for name, value in policy.extra.items()}
    lines += [f"extra({quote_string(name)}, {quote_string(value)})." for name, value in extra.items()]
    lines.append("")
    lines += [f"feature({f.name}, {f.kind}, {f.cost}, {quote_string(f.text)})." for f in policy.features]
    for action in policy.actions:
        lines += ["", f"action({action.name})."]
        lines += [f"schema({action.name}, {quote_string(schema)})." for schema in action.schemas]
        for feature, positive in action.preconditions.items():
            lines.append(f"precondition({action.name}, {feature}, {_WORDS[kind[feature]][positive]}).")
        lines += [f"effect({action.name}, {feature}, {word})." for feature, word in action.effects.items()]
    for state, valuation, rule in states:
        lines += ["", f"% {policy.show(valuation)}"]
        for feature_, positive in zip(policy.features, valuation, strict=True):
            lines.append(f"value({state}, {feature_.name}, {_WORDS[feature_.kind][positive]}).")
        lines += [f"initial({state})."] * (valuation in policy.initial) + [f"goal({state})."] * (
            valuation in policy.goals
        )
        if rule is not None:
            lines.append(f"rule({state}, {rule.action}).")
            lines += [f"outcome({state}, {name[after]})." for after in rule.outcomes]
    if policy.certificate:
        lines.append("")
    for number, step in enumerate(policy.certificate, 1):
        within = "  ".join(f"within({number}, {name[valuation]})." for valuation in step.states)
        lines.append(f"cut({number}, {step.feature}).  {within}")
    return "\n".join(lines) + "\n"


def feature_clauses(policy: PolicyGraph) -> str:
    """Return features.pl."""
    clauses = (
        f"feature({f.name}, {f.kind}, {f.cost}, {f.variable or 'none'}, {f.sort or 'none'}, {f.formula}).\n"
        for f in policy.features
    )
    return _FEATURES + "\n" + "".join(clauses)


def load(folder: Path) -> PolicyGraph:
    """Read policy.lp and features.pl."""
    if not (folder / "policy.lp").exists():
        hint = "give a folder that `gentamp-lp learn` wrote"
        raise InputError(Diagnostic("there is no policy.lp in it", folder, hint=hint))
    reader = _Reader(folder / "policy.lp")
    formulas = _Reader(folder / "features.pl").table("feature", 6)
    features = tuple(_feature(row, formulas, folder) for row in reader.rows("feature", 4))
    if not features:
        raise reader.error("no feature/4 fact")
    for row in formulas.values():
        if row.arguments[0] not in {feature.name for feature in features}:
            raise row.error(f"feature {row.arguments[0]} is not in policy.lp")
    extra = {row.arguments[0]: row.json(1) for row in reader.rows("extra", 2)}
    for row in formulas.values():
        _check_formula(row, extra.get("sorts"))
    kinds = {feature.name: feature.kind for feature in features}
    actions = tuple(_action(reader, row, kinds) for row in reader.rows("action", 1))
    states = _states(reader, kinds)
    after: dict[str, list[Valuation]] = {}
    for row in reader.rows("outcome", 2):
        after.setdefault(row.known(0, states), []).append(states[row.known(1, states)])
    names = {action.name for action in actions}
    rules = tuple(
        Rule(states[row.known(0, states)], row.known(1, names), tuple(after.pop(row.arguments[0], ())))
        for row in reader.rows("rule", 2)
    )
    if after:
        raise reader.error(f"outcome of {next(iter(after))}, which has no rule")
    return PolicyGraph(
        reader.one("task"),
        features,
        actions,
        rules,
        tuple(states[row.known(0, states)] for row in reader.rows("goal", 1)),
        tuple(states[row.known(0, states)] for row in reader.rows("initial", 1)),
        reader.one("fairness", LEVELS),
        tuple(_step(reader, row, kinds, states) for row in reader.rows("cut", 2)),
        reader.one("optimal", {"yes", "no"}) == "yes",
        int(reader.one("cost", digits=True)),
        int(reader.one("bound", digits=True)),
        extra,
    )


@dataclass(frozen=True)
class _Row:
    path: Path
    line: int
    arguments: tuple[str, ...]

    def error(self, message: str) -> InputError:
        return InputError(Diagnostic(message, path=self.path, line=self.line))

    def known(self, position: int, names: Iterable[str]) -> str:
        """Return an argument that must be one of the names."""
        value, names = self.arguments[position], list(names)
        if value not in names:
            raise self.error(f"unknown name {value}: one of {', '.join(names)}")
        return value

    def json(self, position: int) -> Any:
        try:
            return json.loads(self.arguments[position])
        except ValueError as error:
            raise self.error(f"not JSON: {error}") from error

    def number(self, position: int) -> int:
        if not self.arguments[position].isdigit():
            raise self.error(f"not a number: {self.arguments[position]}")
        return int(self.arguments[position])


class _Reader:
    """The facts of a file, by predicate, with their lines."""

    def __init__(self, path: Path) -> None:
        self.path = path
        text = read_text(path)
        self._facts: dict[str, list[_Row]] = {}
        for fact in read_facts(text, path):
            arguments = tuple(unquote(text) if text.startswith('"') else text for text in fact.args)
            self._facts.setdefault(fact.name, []).append(_Row(path, fact.line, arguments))

    def error(self, message: str) -> InputError:
        return InputError(Diagnostic(message, path=self.path))

    def rows(self, name: str, arity: int) -> list[_Row]:
        rows = self._facts.get(name, [])
        for row in rows:
            if len(row.arguments) != arity:
                raise row.error(f"{name} has {arity} arguments")
        return rows

    def table(self, name: str, arity: int) -> dict[str, _Row]:
        return {row.arguments[0]: row for row in self.rows(name, arity)}

    def one(self, name: str, allowed: Iterable[str] = (), digits: bool = False) -> str:
        rows = self.rows(name, 1)
        if len(rows) != 1:
            raise self.error(f"want one {name}/1 fact, found {len(rows)}")
        if digits:
            rows[0].number(0)
        return rows[0].known(0, sorted(allowed)) if allowed else rows[0].arguments[0]


def _feature(row: _Row, formulas: dict[str, _Row], folder: Path) -> Feature:
    name, kind = row.arguments[0], row.known(1, _WORDS)
    if name not in formulas:
        raise row.error(f"feature {name} has no clause in {folder / 'features.pl'}")
    other = formulas[name]
    if other.known(1, _WORDS) != kind or other.number(2) != row.number(2):
        raise other.error(f"kind or cost of {name} is not that of policy.lp")
    variable, sort, formula = other.arguments[3:]
    return Feature(name, kind, row.number(2), formula, _some(variable), _some(sort), row.arguments[3])


def _check_formula(row: _Row, sorts: dict[str, list[str]] | None) -> None:
    """Refuse what is no formula, and predicates that the domain (`sorts`: of each argument) does not have."""
    try:
        formula, closures = to_formula(row.arguments[5])
    except ValueError as error:
        raise row.error(str(error)) from error
    if sorts is None:
        return
    own = {axiom.head.predicate for axiom in closures} | {sort_predicate(s) for args in sorts.values() for s in args}
    for atom in (atom for part in (formula, *(axiom.body for axiom in closures)) for atom in atoms(part)):
        if atom.predicate not in own and len(sorts.get(atom.predicate, ())) != len(atom.args):
            known = "of other arity" if atom.predicate in sorts else f"known: {', '.join(sorted(sorts))}"
            raise row.error(f"feature {row.arguments[0]}: no predicate {atom.predicate}/{len(atom.args)} ({known})")


def _some(name: str) -> str | None:
    return None if name == "none" else name


def _action(reader: _Reader, row: _Row, kinds: dict[str, str]) -> AbstractAction:
    name = row.arguments[0]
    preconditions, effects = {}, {}
    for condition in reader.rows("precondition", 3):
        if condition.arguments[0] == name:
            feature = condition.known(1, kinds)
            words = _WORDS[kinds[feature]]
            preconditions[feature] = condition.known(2, words) == words[1]
    for effect in reader.rows("effect", 3):
        if effect.arguments[0] == name:
            feature = effect.known(1, kinds)
            effects[feature] = effect.known(2, _EFFECTS[kinds[feature]])
    schemas = tuple(s.arguments[1] for s in reader.rows("schema", 2) if s.arguments[0] == name)
    return AbstractAction(name, preconditions, effects, schemas)


def _states(reader: _Reader, kinds: dict[str, str]) -> dict[str, Valuation]:
    values: dict[str, dict[str, bool]] = {}
    first: dict[str, _Row] = {}
    for row in reader.rows("value", 3):
        feature = row.known(1, kinds)
        words = _WORDS[kinds[feature]]
        values.setdefault(row.arguments[0], {})[feature] = row.known(2, words) == words[1]
        first.setdefault(row.arguments[0], row)
    for state, known in values.items():
        for feature in kinds:
            if feature not in known:
                raise first[state].error(f"state {state} has no value of {feature}")
    return {state: tuple(known[feature] for feature in kinds) for state, known in values.items()}


def _step(reader: _Reader, row: _Row, kinds: dict[str, str], states: dict[str, Valuation]) -> CertificateStep:
    inside = [w for w in reader.rows("within", 2) if w.arguments[0] == row.arguments[0]]
    return CertificateStep(row.known(1, kinds), tuple(states[w.known(1, states)] for w in inside))
