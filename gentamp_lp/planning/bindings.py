"""The parameters of an action's schema, bound for one abstract action: cheapest conditions first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, cached_property, partial

from gentamp_lp.features.axioms import Features
from gentamp_lp.planning.feature_changes import Watches
from gentamp_lp.planning.repair import Wishes
from gentamp_lp.policy.model import AbstractAction
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import And, Atom, Formula, Not, Or, atoms, conjuncts, normalize, substitute
from gentamp_lp.streams.pddl import ActionSchema
from gentamp_lp.streams.queries import Query, Situation
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import reads


class Bindings:
    """A schema's precondition in two parts: what decides the effects, and what is looked at when these are right.

    Conditions come late on parameters that no effect mentions and that only a stream can supply, and, unless features
    run tests themselves (`tests_late`), conditions that run tests. `needed` is what the wanted effects ask of the
    parameters; `known` are those that are bound early.
    """

    def __init__(self, schema: ActionSchema, needed: Sequence[Atom], situation: Situation, tests_late: bool) -> None:
        program, base = situation.program, situation.base
        precondition = program.preconditions[schema.name]
        postponed = _made(precondition, base) - _decisive(schema)
        parts = conjuncts(precondition)
        late = tuple(
            part for part in parts if part.free & postponed or (tests_late and reads(part, program) & base.tests.keys())
        )
        early = And((*needed, *(part for part in parts if part not in late)))
        self.schema = schema
        self.known = tuple(p for p in schema.parameters if p in early.free)
        self.allows: Query = situation.query(early, self.known)
        self.narrowed = cache(lambda more: situation.query(And((more, *early.parts)), (), self.known, lazy=True))
        self.late: Query = situation.query(And(late), self.known, schema.parameters, lazy=True)
        self.failed: set[Args] = set()  # values of `known` that were no use in some state
        self._early: Query = situation.query(early, (), self.known, lazy=True)
        self._wishes = partial(Wishes, schema.name, early.parts, late, self.known, schema.parameters, situation)
        self._situation = situation

    @cached_property
    def wishes(self) -> Wishes:
        """Made at the first dead end: most plans have none to repair."""
        return self._wishes()

    def in_order(self) -> Iterator[Args]:
        """Values of the known parameters; those that failed in any state before come last."""
        later = []
        for known in self._early.solutions():
            if known in self.failed:
                later.append(known)
            else:
                yield known
        yield from later

    def changes(self, known: Args) -> tuple[list[Fact], list[Fact]]:
        """The facts that a step adds and deletes in the present state."""
        values = dict(zip(self.known, known, strict=True))
        return self._situation.effects(self.schema, tuple(values.get(p, "") for p in self.schema.parameters))


def _decisive(schema: ActionSchema) -> set[str]:
    """Parameters that the effects depend on."""
    named = {a for e in schema.effects for a in e.atom.args}
    return named | {v for e in schema.effects for v in e.condition.free}


def _made(formula: Formula, base: FactBase) -> set[str]:
    """Variables of a formula that stand where a stream puts new entities."""
    return {
        arg
        for atom in atoms(formula)
        for stream in base.makers.get(atom.predicate, ())
        for certified in stream.certified
        if certified.predicate == atom.predicate
        for arg, name in zip(atom.args, certified.args, strict=True)
        if name in stream.outputs
    }


def needed(schema: ActionSchema, action: AbstractAction, features: Features, values: Watches) -> Iterator[Atom]:
    """What the effects of an abstract action ask of a schema's parameters: that what they make leave a feature's
    extension is in it, and that what they make enter is not, but fulfils what no action changes.
    """
    situation = values.situation
    program, tests = situation.program, situation.base.tests.keys()
    for axiom in features.axioms:
        effect = action.effects.get(axiom.head.predicate)
        enters = effect in ("increase", "true")
        if effect is None or (enters and reads(axiom.body, program) & tests):
            continue
        rows = values.moved_by(axiom.head.predicate, schema, enters)
        if not rows or not axiom.head.args:
            continue
        body = normalize(axiom.body)
        if enters:
            lasting = (part for part in conjuncts(body) if reads(part, program).isdisjoint(program.domain.fluents))
            body = And((*lasting, Not(body)))
        options = [substitute(body, dict(zip(axiom.head.args, row, strict=True))) for row in sorted(rows)]
        names = tuple(dict.fromkeys(name for row in sorted(rows) for name in row if name.startswith("?")))
        yield situation.condition(Or(tuple(options)), names)
