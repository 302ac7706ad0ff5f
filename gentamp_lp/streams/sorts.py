"""Sorts: which arguments of predicates are of one kind, inferred from a domain and its streams."""

from __future__ import annotations

import re
from collections.abc import Iterable

from gentamp_lp.streams.formula import Atom, atoms
from gentamp_lp.streams.pddl import Domain
from gentamp_lp.streams.stream_file import Stream


def infer_sorts(
    domain: Domain, streams: Iterable[Stream], facts: Iterable[tuple[str, ...]] = ()
) -> dict[str, tuple[str, ...]]:
    """Group argument positions into sorts: positions filled by one variable, or one entity, have one sort.

    Union-find over the predicates' argument positions; a variable that occurs in two positions of one action,
    axiom or stream joins them, and so does an entity in two positions of `facts`. Returns for every predicate the
    sort of each argument, named after a variable that fills it (`?p` gives the sort `p`).
    """
    parent: dict[tuple[str, int], tuple[str, int]] = {}
    label: dict[tuple[str, int], str] = {}

    def find(position: tuple[str, int]) -> tuple[str, int]:
        while parent.setdefault(position, position) != position:
            parent[position] = parent[parent[position]]
            position = parent[position]
        return position

    def join(together: Iterable[Atom]) -> None:
        first: dict[str, tuple[str, int]] = {}
        for atom in together:
            for index, arg in enumerate(atom.args):
                if atom.predicate == "=" or not arg.startswith("?"):
                    continue
                here = (atom.predicate, index)
                label.setdefault(here, arg[1:])
                if arg in first:
                    parent[find(first[arg])] = find(here)
                first[arg] = here

    for schema in domain.actions:
        join([*atoms(schema.precondition), *(effect.atom for effect in schema.effects)])
    for axiom in domain.axioms:
        join([axiom.head, *atoms(axiom.body)])
    for stream in streams:
        join([*stream.domain, *stream.certified])
    seen: dict[str, tuple[str, int]] = {}
    for name, *args in facts:
        for index, entity in enumerate(args):
            parent[find((name, index))] = find(seen.setdefault(entity, (name, index)))
    names: dict[tuple[str, int], str] = {}
    sorts: dict[str, tuple[str, ...]] = {}
    for predicate in domain.predicates.values():
        row = []
        for index in range(predicate.arity):
            root = find((predicate.name, index))
            if root not in names:
                base = re.sub(r"\W", "_", label.get((predicate.name, index), predicate.name))
                base = base if base[:1].islower() else f"s{base}"  # an atom of Prolog and ASP
                taken = set(names.values())
                names[root] = next(n for n in (base, *(f"{base}{i}" for i in range(2, 999))) if n not in taken)
            row.append(names[root])
        sorts[predicate.name] = tuple(row)
    return sorts
