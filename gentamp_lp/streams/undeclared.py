"""Predicates that a domain does not declare: streams and initial facts may use some that no action reads.

They pass what one stream certifies on to the `:domain` of another. A name that is only made or only read is good for
nothing and may be a spelling mistake: that is an error if a similar name is known, else a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.naming import may_be_predicate
from gentamp_lp.streams.pddl import Domain, Predicate
from gentamp_lp.streams.sexpr import Group, Symbol

#: How alike two names have to be (`difflib` ratio) for one to count as a misspelling of the other, unless one contains
#: the other: `Pose` is no misspelling of `AtPose`.
_ALIKE = 0.75
_READ, _MADE = ":domain", ":certified"

StreamFile = tuple[list[Group], str]  # the lists at the top of a stream file, and its path


@dataclass
class _Uses:
    """Where an undeclared predicate stands first, and whether something makes it and something reads it."""

    first: Predicate
    path: str
    line: int
    made: bool
    read: bool


def declare_undeclared(domain: Domain, files: Iterable[StreamFile], init: Iterable[Any], goal: Any) -> Domain:
    """The domain with the predicates that only stream files use.

    Raises InputError for one that nothing makes or nothing reads and whose name is like that of another.
    """
    given = {str(fact[0]).lower() for fact in init if isinstance(fact, tuple | list) and fact}
    asked = set(_heads(goal))
    found: dict[str, _Uses] = {}
    for groups, path in files:
        for key, head, arity in _atoms(groups):
            if head.name not in domain.predicates and may_be_predicate(head.name):
                predicate = Predicate(head.name, head.spelling, arity)
                uses = found.setdefault(
                    head.name, _Uses(predicate, path, head.line, head.name in given, head.name in asked)
                )
                uses.made |= key == _MADE
                uses.read |= key == _READ
    for uses in found.values():
        if not (uses.made and uses.read):
            what = "no stream or initial fact makes it true" if uses.read else "nothing reads it"
            others = [o.first.spelling for o in found.values() if (o.made, o.read) != (uses.made, uses.read)]
            known = [*(p.spelling for p in domain.predicates.values()), *others]
            suspect("predicate", uses.first.spelling, known, what, uses.path, uses.line)
    return replace(domain, predicates={**domain.predicates, **{name: uses.first for name, uses in found.items()}})


def stream_functions(files: Iterable[StreamFile]) -> dict[str, Predicate]:
    """The functions that stream files declare."""
    found: dict[str, Predicate] = {}
    for groups, _ in files:
        for section in (item for group in groups for item in group.items if isinstance(item, Group)):
            if section.head == ":function" and len(section.items) > 1:
                for head, arity in _conjuncts(section.items[1]):
                    found[head.name] = Predicate(head.name, head.spelling, arity)
    return found


def suspect(
    kind: str, spelling: str, known: Iterable[str], why: str, path: str | None = None, line: int | None = None
) -> None:
    """Complain about an undeclared name that is good for nothing (`why`).

    Raises InputError if it is like a known one, else warns.
    """
    wrong, names = spelling.lower(), {name.lower(): name for name in known}
    alike = get_close_matches(wrong, [n for n in names if n not in wrong and wrong not in n], 1, _ALIKE)
    if alike:
        hint = f"did you mean `{names[alike[0]]}`? If not, declare `{spelling}` in the domain"
        raise InputError(Diagnostic(f"unknown {kind} `{spelling}`", path, line, hint=hint))
    where = f"{path}:{line}: " if path else "initial facts: "
    warnings.warn(f"{where}{kind} `{spelling}` is not declared in the domain, and {why}", stacklevel=2)


def _atoms(groups: Iterable[Group]) -> Iterator[tuple[str, Symbol, int]]:
    """The atoms of a stream file: the keyword, the predicate and the arity; mistakes are left to the parser."""
    for section in (item for group in groups for item in group.items if isinstance(item, Group)):
        match section.head:
            case ":stream" | ":rule":
                for key, value in zip(section.items, section.items[1:], strict=False):
                    if isinstance(key, Symbol) and key.name in (_READ, _MADE):
                        yield from ((key.name, *atom) for atom in _conjuncts(value))
            case ":function" | ":predicate" if len(section.items) == 3:
                yield from ((_READ, *atom) for atom in _conjuncts(section.items[2]))


def _heads(formula: Any) -> Iterator[str]:
    """Whatever may be a predicate in a formula that is written as tuples."""
    if isinstance(formula, tuple | list) and formula:
        yield str(formula[0]).lower()
        for part in formula[1:]:
            yield from _heads(part)


def _conjuncts(item: Symbol | Group) -> Iterator[tuple[Symbol, int]]:
    if isinstance(item, Group) and item.head == "and":
        for part in item.items[1:]:
            yield from _conjuncts(part)
    elif isinstance(item, Group) and item.items and isinstance(item.items[0], Symbol):
        yield item.items[0], len(item.items) - 1
