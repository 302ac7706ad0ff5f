"""The policy as constrained PDDL domains.

The encoding `check` keeps everything the problem needs from streams and replaces its actions:

* each feature `f` becomes a derived predicate `(f ?x)`, and `(some-f)` says that it is positive;
* `(applies-a)` says that the policy chooses abstract action `a` in the current abstract state;
* each concrete action seen with `a` gets a copy `action--a` that requires `(applies-a)` and leaves `(pending-a)`;
* only `check--a` can follow. It tests the qualitative effect: with `(was-f ?x)`, what satisfied `f` before the step,
  a decrease means that something left and nothing entered the set, an increase the opposite.

Invariant: whenever `(ready)` holds, `was-f` is the extension of `f`. So every plan, `check` steps removed, is a
trajectory of the policy. A step where entities enter and leave at once is refused although its count may agree.

The encoding `local` tells by regression (module `regression`) what a step does to a feature, and requires it in the
copy's precondition: there is nothing to check, and no extra step. Only features that regression leaves undecided for
some copy are watched and checked as above, after the copies that may change them.

The encoding `order` is the paper's Algorithm 2 as it stands, for comparison: a fact `order-i` for each abstract state
of the policy's graph, and a copy of every action for each of its edges. The abstract state that an edge leads to is
tested by what can follow; that a count falls but not to zero is not, so these plans may stand still where the policy
may not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from gentamp_lp.constrained import Encoding
from gentamp_lp.constrained.local_encoding import PREFIX, Conditions
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.feature import Feature
from gentamp_lp.policy.model import Valuation
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.facts import sort_predicate
from gentamp_lp.streams.formula import FALSE, TRUE, And, Atom, Exists, Formula, Not, Or, atoms, conjuncts, to_pddl
from gentamp_lp.streams.pddl import ActionSchema, Axiom, Domain, Effect, Predicate
from gentamp_lp.streams.semantics import Program, State, Step, reads
from gentamp_lp.tasks.domain_folder import DomainFolder
from gentamp_lp.tasks.invariants import exclusive

ENCODINGS = ("check", "local", "order")
SEPARATOR = "--"
_READY, _STARTED = Atom("ready", ()), Atom("started", ())


def constrained_domain(
    policy: Policy,
    folder: DomainFolder,
    sorts: Mapping[str, tuple[str, ...]],
    encoding: Encoding = "check",
    initial: Iterable[State] = (),
) -> Domain:
    """The constrained domain as a syntax tree; `sorts` gives the sort of every predicate's arguments.

    Plans are to reach the task's goal and `(ready)`. The encoding `local` supposes the `invariants` of the `initial`
    states; without any it holds for all, and tests more. Raises InputError when the domain uses names of the encoding.
    """
    original = folder.domain
    _require_free_names(policy, original)
    heads, axioms = _definitions(policy, original, sorts)
    if encoding == "order":
        actions, more = _ordering(policy, original, heads)
    elif encoding == "local":
        conditions = _conditions(policy, original, heads, axioms, initial)
        actions, more = _checking(policy, original, heads, conditions.decided)
        more += conditions.axioms
    else:
        actions, more = _checking(policy, original, heads, {})
    domain = replace(
        original,
        name=f"{original.name}-{policy.task}",
        actions=tuple(actions),
        axioms=(*axioms, *more),
        text="",
        path=None,
    )
    return replace(domain, predicates={**original.predicates, **_declare(domain, original)})


def left_to_checks(
    policy: Policy, folder: DomainFolder, sorts: Mapping[str, tuple[str, ...]], initial: Iterable[State]
) -> dict[str, dict[str, str]]:
    """For copies of actions in the encoding `local`, the features that a check has to look at, each with the reason."""
    conditions = _conditions(policy, folder.domain, *_definitions(policy, folder.domain, sorts), initial)
    return {f"{name}{SEPARATOR}{a}": reasons for (a, name), reasons in conditions.undecided.items() if reasons}


def invariants(domain: Domain, initial: Iterable[State]) -> list[str]:
    """What the encoding `local` supposes of initial states, in words: what is true of the given ones and stays so."""
    found = []
    for group in exclusive(domain, initial):
        keyed = None not in group.values()
        atoms_ = []
        for name, key in group.items():
            arity = domain.predicates[name].arity
            atoms_.append(to_pddl(Atom(name, tuple("?x" if i == key else f"?y{i}" for i in range(arity)))))
        found.append(f"at most one of {' '.join(atoms_)}{' for each ?x' if keyed else ''}")
    return found


def _definitions(
    policy: Policy, original: Domain, sorts: Mapping[str, tuple[str, ...]]
) -> tuple[dict[str, Atom], list[Axiom]]:
    """The features' heads, and the domain's axioms with those that define features."""
    features = Features.of(policy.features)
    heads = {axiom.head.predicate: axiom.head for axiom in features.axioms}
    axioms = [*original.axioms, *features.axioms, *_sort_axioms(features.axioms, original, sorts)]
    return heads, [*axioms, *(Axiom(_flag("some", f), _exists(heads[f.name])) for f in policy.features)]


def _conditions(
    policy: Policy, original: Domain, heads: Mapping[str, Atom], axioms: Sequence[Axiom], initial: Iterable[State]
) -> Conditions:
    program = Program.of(replace(original, axioms=tuple(axioms)))
    return Conditions(policy, program, exclusive(original, initial), heads)


def _checking(
    policy: Policy,
    original: Domain,
    heads: Mapping[str, Atom],
    decided: Mapping[tuple[str, str], Mapping[str, Formula]],
) -> tuple[list[ActionSchema], list[Axiom]]:
    """Actions and axioms of the encodings `check` and `local`: features that are not `decided` are watched."""
    local = {(a.name, name): decided.get((a.name, name), {}) for a in policy.actions for name in a.schemas}
    watched = [f for f in policy.features if any(f.name not in conditions for conditions in local.values())]
    axioms = []
    for feature in watched:
        head = heads[feature.name]
        was = Atom(f"was-{feature.name}", head.args)
        axioms.append(Axiom(_flag("had", feature), _exists(was)))
        axioms.append(Axiom(_flag("lost", feature), _exists(And((was, Not(head))))))
        axioms.append(Axiom(_flag("gained", feature), _exists(And((head, Not(was))))))
    for action in policy.actions:
        cases = tuple(_looks(policy, rule.valuation) for rule in policy.rules if rule.action == action.name)
        axioms.append(Axiom(Atom(f"applies-{action.name}", ()), Or(cases)))
    actions = []
    if watched:
        actions.append(_check("start", And((Not(_STARTED),)), watched, heads, (Effect(_STARTED, True),)))
    else:
        axioms.append(Axiom(_READY, TRUE))
    for action in policy.actions:
        pending = Atom(f"pending-{action.name}", ())
        unsure = False
        for name in action.schemas:
            conditions = local[action.name, name]
            if FALSE in conditions.values():
                continue
            moved = any(f.name not in conditions or f.name in action.effects for f in watched)
            actions.append(_copy(original.action(name), action.name, conditions, pending if moved else None))
            unsure |= moved
        if unsure:
            tested = [f for f in watched if any(f.name not in local[action.name, name] for name in action.schemas)]
            changes = tuple(_change(f, action.effects.get(f.name)) for f in tested)
            effects = (Effect(pending, False),)
            actions.append(_check(action.name, And((pending, *changes)), watched, heads, effects))
    return actions, axioms


def _ordering(policy: Policy, original: Domain, heads: Mapping[str, Atom]) -> tuple[list[ActionSchema], list[Axiom]]:
    """Actions and axioms of the encoding `order`."""
    nodes = dict.fromkeys([*policy.initial, *policy.goals, *(look for r in policy.rules for look in r.outcomes)])
    nodes |= dict.fromkeys(rule.valuation for rule in policy.rules)
    here = {look: Atom(f"order-{number}", ()) for number, look in enumerate(nodes)}
    actions = []
    for look in nodes:
        condition = And((Not(_STARTED), _looks(policy, look)))
        begin = (Effect(_STARTED, True), Effect(here[look], True))
        actions.append(ActionSchema(f"check{SEPARATOR}{here[look].predicate}", (), condition, begin))
    for rule in policy.rules:
        for after in rule.outcomes:
            move = {here[rule.valuation]: False} | {here[after]: True}  # an edge may lead back to where it starts
            for schema in original.actions:
                name = f"{schema.name}{SEPARATOR}{here[rule.valuation].predicate}-{here[after].predicate}"
                condition = And((here[rule.valuation], _looks(policy, rule.valuation), *conjuncts(schema.precondition)))
                effects = (*schema.effects, *(Effect(atom, positive) for atom, positive in move.items()))
                actions.append(replace(schema, name=name, precondition=condition, effects=effects))
    arrived = Or(tuple(And((here[look], _looks(policy, look))) for look in policy.goals))
    return actions, [Axiom(_READY, arrived)]


def _looks(policy: Policy, look: Valuation) -> Formula:
    """That the state is in an abstract state."""
    return And(tuple(_literal(_flag("some", f), p) for f, p in zip(policy.features, look, strict=True)))


def doubtful(policy: Policy, folder: DomainFolder) -> dict[str, list[str]]:
    """Features that read predicates of test streams, with these predicates.

    The optimistic algorithms of PDDLStream (adaptive, binding, focused) assume that tests succeed, and evaluate again
    only those that a plan's actions name: below an axiom's negation they return wrong plans, or none.
    """
    features = Features.of(policy.features)
    program = Program.of(folder.domain, features.axioms)
    tests = {atom.predicate for stream in folder.streams if stream.is_test for atom in stream.certified}
    found = {f.name: sorted(reads(program.axioms[f.name][0].body, program) & tests) for f in policy.features}
    return {name: predicates for name, predicates in found.items() if predicates}


def _require_free_names(policy: Policy, domain: Domain) -> None:
    """Refuse a domain whose own names are those of the bookkeeping. Raises InputError."""
    features = [f.name for f in policy.features]
    taken = {"ready", "started", *features}
    taken |= {f"{kind}-{f}" for kind in ("some", "had", "was", "lost", "gained") for f in features}
    taken |= {f"{kind}-{a.name}" for kind in ("applies", "pending") for a in policy.actions}
    clashes = sorted(name for name in domain.predicates if name in taken or name.startswith(("order-", PREFIX)))
    clashes += [a.name for a in domain.actions if a.name == "check" or SEPARATOR in a.name]
    if clashes:
        hint = "rename it: constrained domains use this name themselves"
        raise InputError(Diagnostic(f"`{clashes[0]}` cannot be a name of the domain", domain.path, hint=hint))


def to_text(
    domain: Domain,
    policy: Policy,
    marks: Mapping[str, Sequence[str]] | None = None,
    supposed: Sequence[str] = (),
) -> str:
    """The constrained domain as PDDL, with comments: the features, `marks` of doubtful ones, what is `supposed`."""
    lines = [f"; Constrained domain of the policy for `{policy.task}`, generated by gentamp-lp."]
    lines += ["; Plan to the task's goal and (ready); drop the check steps and what follows `--` in the others."]
    lines += [f"; Initial states have {invariant}." for invariant in supposed]
    for feature in policy.features:
        lines.append(f"; {feature.name} ({feature.kind}): {feature.text}")
        if marks and feature.name in marks:
            tests = ", ".join(domain.predicates[name].spelling for name in marks[feature.name])
            lines.append(f";   reads tests ({tests}): use an incremental algorithm; optimistic ones treat it unsoundly")
    lines.append(f"(define (domain {domain.name})")
    lines.append("  (:requirements :adl :derived-predicates)")
    if domain.constants:
        lines.append(f"  (:constants {' '.join(domain.constants)})")
    lines.append("  (:predicates")
    for predicate in domain.predicates.values():
        lines.append(f"    ({predicate.spelling}{''.join(f' ?x{i}' for i in range(predicate.arity))})")
    lines.append("  )")
    for schema in domain.actions:
        lines += [
            f"  (:action {schema.name}",
            f"    :parameters ({' '.join(schema.parameters)})",
            f"    :precondition {to_pddl(schema.precondition)}",
            f"    :effect (and {' '.join(map(_effect_text, schema.effects))}))",
        ]
    lines += [f"  (:derived {to_pddl(axiom.head)} {to_pddl(axiom.body)})" for axiom in domain.axioms]
    return "\n".join([*lines, ")", ""])


def original_step(step: Step) -> Step | None:
    """The step of the original domain that a constrained step stands for; None for bookkeeping."""
    name = step.schema.split(SEPARATOR)[0]
    return None if name == "check" else Step(name, step.args)


def _flag(kind: str, feature: Feature) -> Atom:
    """`some-f`: f is positive; `had-f`: it was before the step; `lost-f`, `gained-f`: something left, entered."""
    return Atom(f"{kind}-{feature.name}", ())


def _exists(body: Formula) -> Formula:
    variables = tuple(dict.fromkeys(a for atom in atoms(body) for a in atom.args))
    return Exists(variables, body) if variables else body


def _literal(atom: Atom, positive: bool) -> Formula:
    return atom if positive else Not(atom)


def _copy(schema: ActionSchema, name: str, conditions: Mapping[str, Formula], pending: Atom | None) -> ActionSchema:
    """The copy of an action for an abstract action; where a check is to follow, it is `pending`."""
    parts = dict.fromkeys(part for formula in conditions.values() for part in conjuncts(formula))
    precondition = And((_READY, Atom(f"applies-{name}", ()), *conjuncts(schema.precondition), *parts))
    effects = (*schema.effects, *((Effect(_READY, False), Effect(pending, True)) if pending else ()))
    return replace(schema, name=f"{schema.name}{SEPARATOR}{name}", precondition=precondition, effects=effects)


def _check(
    name: str, condition: Formula, watched: Sequence[Feature], heads: Mapping[str, Atom], effects: tuple[Effect, ...]
) -> ActionSchema:
    """The action that records the features' extensions after `name` and makes the next step possible."""
    record = [Effect(_READY, True), *effects]
    for feature in watched:
        head = heads[feature.name]
        was = Atom(f"was-{feature.name}", head.args)
        record.append(Effect(was, True, head.args, head))
        record.append(Effect(was, False, head.args, Not(head)))
    return ActionSchema(f"check{SEPARATOR}{name}", (), condition, tuple(record))


def _change(feature: Feature, effect: str | None) -> Formula:
    now, before = _flag("some", feature), _flag("had", feature)
    lost, gained = _flag("lost", feature), _flag("gained", feature)
    if feature.kind == "boolean":
        same = Or((And((now, before)), And((Not(now), Not(before)))))
        return {"true": And((now, Not(before))), "false": And((before, Not(now)))}.get(effect or "", same)
    changes = {"increase": And((gained, Not(lost))), "decrease": And((lost, Not(gained)))}
    return changes.get(effect or "", And((Not(lost), Not(gained))))


def _sort_axioms(axioms: tuple[Axiom, ...], domain: Domain, sorts: Mapping[str, tuple[str, ...]]) -> Iterator[Axiom]:
    """Definitions of the sort predicates that features use: in a position of that sort of an unchanging predicate."""
    used = frozenset().union(*(axiom.body.predicates for axiom in axioms))
    for sort in sorted({s for row in sorts.values() for s in row if sort_predicate(s) in used}):
        cases = []
        for predicate, row in sorts.items():
            if predicate in domain.fluents or predicate in domain.derived:
                continue
            for position, found in enumerate(row):
                if found == sort:
                    others = tuple(f"?y{i}" for i in range(len(row)) if i != position)
                    args = tuple("?x" if i == position else f"?y{i}" for i in range(len(row)))
                    cases.append(Exists(others, Atom(predicate, args)) if others else Atom(predicate, args))
        yield Axiom(Atom(sort_predicate(sort), ("?x",)), Or(tuple(cases)))


def _declare(domain: Domain, original: Domain) -> dict[str, Predicate]:
    mentioned = [a for axiom in domain.axioms for a in (axiom.head, *atoms(axiom.body))]
    mentioned += [a for s in domain.actions for a in (*atoms(s.precondition), *(e.atom for e in s.effects))]
    return {
        a.predicate: Predicate(a.predicate, a.predicate, len(a.args))
        for a in mentioned
        if a.predicate not in original.predicates and a.predicate != "="
    }


def _effect_text(effect: Effect) -> str:
    text = to_pddl(effect.atom if effect.positive else Not(effect.atom))
    if conjuncts(effect.condition):
        text = f"(when {to_pddl(effect.condition)} {text})"
    return f"(forall ({' '.join(effect.variables)}) {text})" if effect.variables else text
