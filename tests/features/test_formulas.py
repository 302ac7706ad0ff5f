"""Formulas as text: random ones against first-order semantics by brute force, the notation, and its mistakes."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from helpers.brute_force import State, pool_rows

from gentamp_lp.base.shipped import resource
from gentamp_lp.base.terms import parse_term
from gentamp_lp.errors import InputError
from gentamp_lp.features.pool import PoolSession, generate_pool

SORTS = ("o", "w", "g")


@dataclass
class Structure:
    """A few small problems over random predicates of up to four arguments."""

    predicates: dict[str, tuple[str, ...]]
    entities: list[dict[str, list[str]]] = field(default_factory=list)
    states: list[tuple[int, set[tuple[str, ...]]]] = field(default_factory=list)

    @classmethod
    def draw(cls, rng: random.Random, fewest: int = 0) -> Structure:
        arities = [0, 1, 1, 2, 2, 3, 4]
        result = cls({f"p{i}": tuple(rng.choice(SORTS) for _ in range(n)) for i, n in enumerate(arities)})
        result.predicates |= {f"is-{sort}": (sort,) for sort in SORTS}
        for problem in range(rng.choice((1, 2))):
            names = {s: [f"{s}{problem}x{i}" for i in range(rng.randint(fewest, 3))] for s in SORTS}
            result.entities.append(names)
            for _ in range(rng.choice((1, 2, 3))):
                density = rng.choice((0.2, 0.5, 0.8))
                atoms = {
                    (name, *args)
                    for name, sorts in result.predicates.items()
                    for args in result.tuples(problem, sorts)
                    if rng.random() < density
                }
                result.states.append((problem, atoms))
        return result

    def tuples(self, problem: int, sorts: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        if not sorts:
            yield ()
            return
        for entity in self.entities[problem][sorts[0]]:
            for rest in self.tuples(problem, sorts[1:]):
                yield (entity, *rest)

    def text(self) -> str:
        lines = [f"sort({s})." for s in SORTS]
        lines += [f"predicate('{name}', [{', '.join(sorts)}])." for name, sorts in self.predicates.items()]
        for problem, names in enumerate(self.entities):
            lines.append(f"problem({problem}).")
            lines += [f"entity({problem}, {s}, {e})." for s in SORTS for e in names[s]]
        for number, (problem, atoms) in enumerate(self.states):
            lines.append(f"state({number}, {problem}).")
            lines += [
                f"fluent({number}, '{a[0]}'({','.join(a[1:])}))." if a[1:] else f"fluent({number}, {a[0]})."
                for a in sorted(atoms)
            ]
        together = [i for i in range(len(self.states) - 1) if self.states[i][0] == self.states[i + 1][0]]
        lines += [f"transition({i}, {i}, {i + 1})." for i in together]
        return "\n".join(lines) + "\n"


class Writer:
    """Writes random well-sorted formulas in the ASCII or in the printed notation."""

    def __init__(self, rng: random.Random, predicates: dict[str, tuple[str, ...]]) -> None:
        self.rng = rng
        self.predicates = predicates
        fancy = rng.random() < 0.5
        self.conj, self.disj, self.implies = rng.choice((("&", "|", "=>"), ("and", "or", "implies")))
        self.neg, self.some, self.every = "~", "exists", "forall"
        if fancy:
            self.conj, self.disj, self.implies, self.neg, self.some, self.every = "∧∨⇒¬∃∀"

    def formula(self, scope: dict[str, str], depth: int) -> str:
        rng = self.rng
        choice = rng.random()
        if depth == 0 or choice < 0.2:
            return self.atom(scope)
        if choice < 0.35:
            return f"{self.neg} {self.nested(scope, depth)}"
        if choice < 0.65:
            connective = rng.choice((self.conj, self.conj, self.disj, self.implies))
            return f"{self.nested(scope, depth)} {connective} {self.nested(scope, depth)}"
        if choice < 0.95 and len(scope) < 4:
            variable, sort = f"x{len(scope)}", rng.choice(SORTS)
            body = self.mentioning(variable, sort, self.formula(scope | {variable: sort}, depth - 1))
            return f"{rng.choice((self.some, self.every))} {variable}{rng.choice((':', ' '))} {body}"
        sort = rng.choice(SORTS)
        ends = [v for v, s in scope.items() if s == sort]
        if not ends:
            return self.atom(scope)
        inner = {"u": sort, "w": sort}
        body = self.mentioning("u", sort, self.formula(inner, 1))
        return f"{{u,w | {body}}}⁺({rng.choice(ends)},{rng.choice(ends)})"

    def mentioning(self, variable: str, sort: str, body: str) -> str:
        """The body, with an atom that gives the variable a sort if none does."""
        if re.search(rf"\b{variable}\b", body):
            return body
        return f"({body}) {self.rng.choice((self.conj, self.disj, self.implies))} is-{sort}({variable})"

    def nested(self, scope: dict[str, str], depth: int) -> str:
        return f"({self.formula(scope, depth - 1)})"

    def atom(self, scope: dict[str, str]) -> str:
        rng = self.rng
        usable = []
        for name, sorts in self.predicates.items():
            args = [rng.choice([v for v, s in scope.items() if s == sort] + ["_"]) for sort in sorts]
            usable.append(f"{name}({','.join(args)})" if args else name)
        return rng.choice(usable)


@pytest.mark.parametrize("seed", range(50))
def test_values_are_those_of_first_order_semantics(seed: int) -> None:
    """50 structures with 50 formulas each: more than 2,400 in all."""
    rng = random.Random(seed)
    structure = Structure.draw(rng)
    checked = 0
    with PoolSession(structure.text()) as session:
        for _ in range(50):
            counted = rng.choice((None, "o", "w", "g"))
            writer = Writer(rng, structure.predicates)
            text = writer.formula({"x0": counted} if counted else {}, rng.choice((2, 3, 4)))
            text = f"#x0: {writer.mentioning('x0', counted, text)}" if counted else text
            try:
                reading = session.read(text)
            except InputError as error:  # a variable hidden by another of its name is left without a sort
                assert "no predicate says" in str(error), text
                continue
            checked += 1
            term = parse_term(reading.formula)
            _, (_, (variable, _), (sort, _), body) = term
            for number, (problem, atoms) in enumerate(structure.states):
                state = State(atoms, structure.entities[problem])
                assert reading.values[number] == state.value(term), (text, number)
                if variable != "none":
                    expected = {e for e in structure.entities[problem][sort] if state.holds(body, {variable: e})}
                    assert set(reading.satisfying[number]) == expected, (text, number)
            again = session.read(reading.text)
            assert (again.values, again.satisfying) == (reading.values, reading.satisfying)
    assert checked >= 48


@pytest.mark.parametrize("seed", range(12))
def test_what_the_pool_prints_is_found_in_it(seed: int) -> None:
    """Each feature's text is read back as itself, with the same values, and matches itself or something cheaper."""
    structure = Structure.draw(random.Random(seed))
    with PoolSession(structure.text()) as session:
        pool = session.deepen(3)
        values = session.values()
        for number, text in pool.texts.items():
            reading = session.read(text)
            assert reading.text == text
            assert reading.values == values[number]
            assert reading.match is not None
            assert pool.kinds[reading.match][0] <= pool.kinds[number][0]


# ---- Pruning

LAWS = re.findall(r"^law\((\w+)", resource("logic", "grammar.lp").read_text(encoding="utf-8"), re.MULTILINE)


def behaviours(text: str, cost: int, grammars: list) -> dict[tuple, int]:
    """The cheapest cost of each behaviour, Boolean features up to complement."""
    pool = generate_pool(text, max_cost=cost, grammars=grammars)
    states = frozenset(range(text.count("\nstate(")))
    rows = [pool_rows(pool, name) for name in ("pos", "inc", "dec")]
    result: dict[tuple, int] = {}
    for number, (level, kind) in pool.kinds.items():
        pos, inc, dec = (frozenset(row[number]) for row in rows)
        keys = [(kind, pos, inc, dec)]
        if kind == "boolean":
            keys.append((kind, states - pos, dec, inc))
        for key in keys:
            result[key] = min(level, result.get(key, level))
    return result


@pytest.mark.parametrize("seed", range(10))
def test_laws_remove_nothing_that_is_not_made_elsewhere(seed: int, tmp_path) -> None:
    text = Structure.draw(random.Random(seed)).text()
    without = tmp_path / "lawless.lp"
    without.write_text("".join(f"off({law}).\n" for law in LAWS))
    assert behaviours(text, 4, []) == behaviours(text, 4, [without])


@pytest.mark.parametrize("seed", range(10))
def test_uniqueness_keeps_the_cheapest_of_every_behaviour(seed: int, tmp_path) -> None:
    """What is always true or false is left out, though it counts entities: so no problem may lack a sort here."""
    text = Structure.draw(random.Random(seed), fewest=1).text()
    without = tmp_path / "all.lp"
    without.write_text("off(uniqueness).\n" + "".join(f"off({law}).\n" for law in LAWS))
    assert behaviours(text, 3, []) == behaviours(text, 3, [without])
