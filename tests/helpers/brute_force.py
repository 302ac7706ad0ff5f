"""An evaluator of formulas that shares nothing with the Prolog program."""

from __future__ import annotations

import re

from gentamp_lp.base.terms import Term
from gentamp_lp.features.pool import Pool


class State:
    def __init__(self, atoms: set[tuple[str, ...]], entities: dict[str, list[str]]) -> None:
        self.atoms = atoms
        self.entities = entities

    def holds(self, formula: Term, values: dict[str, str]) -> bool:
        name, arguments = formula
        match name:
            case "true":
                return True
            case "neg":
                return not self.holds(arguments[0], values)
            case "conj":
                return all(self.holds(a, values) for a in arguments)
            case "disj":
                return any(self.holds(a, values) for a in arguments)
            case "implies":
                return not self.holds(arguments[0], values) or self.holds(arguments[1], values)
            case "some" | "every":
                (variable, _), (sort, _), body = arguments
                test = any if name == "some" else all
                return test(self.holds(body, values | {variable: e}) for e in self.entities[sort])
            case "closure":
                (u, _), (w, _), (sort, _), body, (y, _), (x, _) = arguments
                seen: set[str] = set()
                todo = [values[y]]
                while todo:
                    here = todo.pop()
                    for e in self.entities[sort]:
                        if e not in seen and self.holds(body, values | {u: here, w: e}):
                            seen.add(e)
                            todo.append(e)
                return values[x] in seen
            case _:
                return (name, *(values[a[0]] for a in arguments)) in self.atoms

    def value(self, formula: Term) -> int:
        _, (_, (variable, _), (sort, _), body) = formula
        if variable == "none":
            return int(self.holds(body, {}))
        return sum(self.holds(body, {variable: e}) for e in self.entities[sort])


def pool_rows(pool: Pool, name: str) -> dict[int, set[int]]:
    """Feature -> the states (pos) or transitions (inc, dec) that a pool's facts name; pos(1,(2;4)) names two."""
    rows: dict[int, set[int]] = {number: set() for number in pool.formulas}
    for number, items in re.findall(rf"\b{name}\((\d+),\(?([\d;]+)\)", pool.facts):
        rows[int(number)] |= set(map(int, items.split(";")))
    return rows
