"""Which features a state decides, and which depend on how much was sampled.

Test streams decide their facts on demand, so both truth values are known. Streams that make entities never end: a
feature that counts such entities, or says that there is one, or that all are so, is an estimate that gets better with
samples (paper, "Abstraction Learning"). It is decided all the same where the entities in question stand in the facts
of the state: there are finitely many places taken, but no end of free places.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gentamp_lp.features.axioms import to_formula
from gentamp_lp.streams.facts import sort_predicate
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Formula, Not, Or, normalize, restricts
from gentamp_lp.streams.pddl import Axiom, Domain
from gentamp_lp.streams.stream_file import Stream


class Openness:
    """Tells open features from closed (decided) ones, for one domain. `sorts` are those of its predicates."""

    def __init__(self, domain: Domain, streams: Iterable[Stream], sorts: Mapping[str, tuple[str, ...]]) -> None:
        self._sorts = sorts
        self._axioms: dict[str, list[Axiom]] = {}
        for axiom in domain.axioms:
            self._axioms.setdefault(axiom.head.predicate, []).append(axiom)
        self._certified: set[str] = set()
        self._sampled: set[str] = set()
        for stream in streams:
            for atom in stream.certified:
                self._certified.add(atom.predicate)
                pairs = zip(sorts.get(atom.predicate, ()), atom.args, strict=False)
                self._sampled.update(sort for sort, arg in pairs if arg in stream.outputs)
        self._known: dict[tuple[str, int], bool] = {}
        self._decided: dict[str, bool] = {}

    def is_open(self, formula: str, variable: str | None, sort: str | None) -> bool:
        """Whether the value of a feature (see `to_formula`) may change when more is sampled."""
        body, closures = to_formula(formula, f"closed{len(self._axioms)}")
        for axiom in closures:
            self._axioms[axiom.head.predicate] = [axiom]
        counted = f"?{variable}"
        if sort in self._sampled and not restricts(body, counted, self._names_known):
            return True
        return not self._decides(body)

    def _decides(self, formula: Formula) -> bool:
        """Whether a state decides the formula for given entities: all that it quantifies over is known."""
        match normalize(formula):
            case Atom(predicate, _):
                return self._decides_derived(predicate)
            case Not(body):
                return self._decides(body)
            case And(parts) | Or(parts):
                return all(self._decides(part) for part in parts)
            case Exists(variables, body):
                bounded = all(
                    self._sort(v, body) not in self._sampled or restricts(body, v, self._names_known) for v in variables
                )
                return bounded and self._decides(body)
            case Forall():
                raise AssertionError("normalize leaves no universal quantifier")

    def _decides_derived(self, predicate: str) -> bool:
        if predicate not in self._decided:
            self._decided[predicate] = True  # of a recursive axiom, only the other conditions matter
            self._decided[predicate] = all(self._decides(axiom.body) for axiom in self._axioms.get(predicate, ()))
        return self._decided[predicate]

    def _names_known(self, atom: Atom, variable: str) -> bool:
        """Whether the atom is true of finitely many entities in the variable's place, all of them in the state."""
        return any(self._position_known(atom.predicate, i) for i, arg in enumerate(atom.args) if arg == variable)

    def _position_known(self, predicate: str, position: int) -> bool:
        key = predicate, position
        if key not in self._known:
            if predicate in self._axioms:
                self._known[key] = True  # while a recursive axiom is looked at
                self._known[key] = all(
                    restricts(axiom.body, axiom.head.args[position], self._names_known)
                    for axiom in self._axioms[predicate]
                )
            else:
                self._known[key] = predicate not in self._certified and not predicate.startswith(sort_predicate(""))
        return self._known[key]

    def _sort(self, variable: str, formula: Formula) -> str | None:
        match formula:
            case Atom(predicate, args):
                if predicate.startswith(sort_predicate("")):
                    return predicate.removeprefix(sort_predicate("")) if variable in args else None
                return next(
                    (s for s, a in zip(self._sorts.get(predicate, ()), args, strict=False) if a == variable), None
                )
            case Not(body) | Exists(_, body) | Forall(_, body):
                return self._sort(variable, body)
            case And(parts) | Or(parts):
                return next((s for part in parts if (s := self._sort(variable, part))), None)
