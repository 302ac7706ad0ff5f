"""Random tiny problems, and everything about them by enumeration.

Nothing is shared with the package: problems are made as plain structures and written as text; a policy ends
unless some set of states can be visited for ever, and all sets are tried.
"""

from dataclasses import dataclass, field
from itertools import product


@dataclass
class Tiny:
    """choices: state -> {action: outcomes}; may, unless: action -> constraints."""

    initial: list
    goals: set
    choices: dict
    may: dict
    unless: dict
    text: str
    size: int = field(default=0)

    def __post_init__(self):
        seen, todo = set(self.initial), list(self.initial)
        while todo:
            state = todo.pop()
            if state not in self.goals:
                for outcomes in self.choices.get(state, {}).values():
                    todo += set(outcomes) - seen
                    seen |= set(outcomes)
        self.acting = sorted(seen - self.goals)
        self.size = len(self.acting)

    def policies(self):
        """Yield all closed policies, each once, without states they do not visit."""

        def extend(policy, todo):
            todo = [state for state in todo if state not in policy and state not in self.goals]
            if not todo:
                yield dict(policy)
                return
            state = todo[0]
            for action in sorted(self.choices.get(state, {})):
                yield from extend({**policy, state: action}, [*todo[1:], *sorted(self.choices[state][action])])

        yield from extend({}, list(self.initial))

    def levels(self, policy):
        """Return the levels of fairness at which a closed policy reaches the goal."""
        states = sorted(policy)
        bit = {state: 1 << i for i, state in enumerate(states)}
        after = [_union(bit.get(o, 0) for o in self.choices[s][policy[s]]) for s in states]
        leaves = [any(o not in bit for o in self.choices[s][policy[s]]) for s in states]
        may = [self.may.get(policy[s], set()) for s in states]
        unless = [self.unless.get(policy[s], set()) for s in states]
        found = {"strong", "qnp", "strong-cyclic"}
        for subset in range(1, 1 << len(states)):
            members = [i for i in range(len(states)) if subset >> i & 1]
            if any(not after[i] & subset for i in members) or not connected(members, after, subset):
                continue
            found.discard("strong")
            closed = [not leaves[i] and not after[i] & ~subset for i in members]
            if all(closed):
                found.discard("strong-cyclic")
            blocked = set().union(*(unless[i] for i in members))
            if all(c or may[i] <= blocked for c, i in zip(closed, members, strict=True)):
                found.discard("qnp")
        return found

    def best(self):
        """Return the smallest number of policy states for each level."""
        best = {}
        for policy in self.policies():
            for level in self.levels(policy):
                best[level] = min(best.get(level, len(policy)), len(policy))
        return best

    def few(self, states, policies):
        """Tell whether enumeration is quick."""
        if self.size > states:
            return False
        return all(count < policies for count, _ in enumerate(self.policies(), 1))


def connected(members, after, subset):
    def closure(step):
        found = 1 << members[0]
        while (more := found | step(found) & subset) != found:
            found = more
        return found == subset

    def forward(mask):
        return _union(after[i] for i in members if mask >> i & 1)

    def backward(mask):
        return _union(1 << i for i in members if after[i] & mask)

    return closure(forward) and closure(backward)


def _union(masks):
    found = 0
    for mask in masks:
        found |= mask
    return found


def random_fond(rng):
    """Explicit graph facts with conditional fairness."""
    states = [f"s({i})" for i in range(rng.randint(2, 7))]
    actions = [f"a{i}" for i in range(rng.randint(1, 4))]
    goals = set(rng.sample(states, rng.randint(1, max(1, len(states) // 3))))
    initial = rng.sample(states, rng.choice([1, 1, 1, 2]))
    choices = {}
    for state in states:
        for action in actions:
            if rng.random() < 0.6:
                choices.setdefault(state, {})[action] = rng.sample(
                    states, min(rng.choice([1, 1, 2, 2, 3]), len(states))
                )
    may = {a: {i for i in range(4) if rng.random() < 0.3} for a in actions}
    unless = {a: {i for i in range(4) if rng.random() < 0.2} for a in actions}
    lines = [f"state({s})." for s in states] + [f"action({a})." for a in actions]
    lines += [f"initialState({s})." for s in initial] + [f"goal({s})." for s in sorted(goals)]
    lines += [f"transition({s},{a},{o})." for s, row in choices.items() for a, after in row.items() for o in after]
    lines += [f"con_A({a},c({i}))." for a in actions for i in may[a]]
    lines += [f"con_B({a},c({i}))." for a in actions for i in unless[a]]
    rng.shuffle(lines)
    return Tiny(initial, goals, choices, may, unless, "\n".join(lines))


def random_qnp(rng):
    """Variable and effect facts, expanded here by another way than by the rules: tuples of truth values."""
    kinds = [rng.choice(["numeric", "numeric", "boolean"]) for _ in range(rng.randint(1, 4))]
    word = {"numeric": ("zero", "positive"), "boolean": ("false", "true")}
    everywhere = range(len(kinds))
    init = {v: rng.choice([0, 1, 1]) for v in everywhere if rng.random() < 0.9}
    goal = {v: rng.choice([0, 0, 1]) for v in rng.sample(everywhere, rng.randint(1, min(2, len(kinds))))}
    lines = [f"{kind}(v{v})." for v, kind in enumerate(kinds)]
    lines += [f"init(v{v},{word[kinds[v]][x]})." for v, x in init.items()]
    lines += [f"goal(v{v},{word[kinds[v]][x]})." for v, x in goal.items()]
    actions = {}
    for a in range(rng.randint(1, 5)):
        pre = {v: rng.choice([0, 1]) for v in everywhere if rng.random() < 0.35}
        eff = {}
        if len(kinds) > 1 and rng.random() < 0.5:  # the stuff of endless loops: one falls, one rises
            down, up = rng.sample(everywhere, 2)
            pre.pop(down, None)
            eff = {v: e for v, e in ((down, "decrease"), (up, "increase")) if kinds[v] == "numeric"}
        for v in rng.sample(everywhere, min(rng.choice([1, 1, 2, 2, 3]), len(kinds))):
            if v in eff:
                continue
            options = ["increase", "decrease", "decrease"] if kinds[v] == "numeric" else ["true", "false"]
            eff[v] = rng.choice(options)
            if eff[v] == "decrease" and pre.get(v) == 0:
                eff[v] = "increase"
        actions[f"a{a}"] = (pre, eff)
        lines.append(f"action(a{a}).")
        lines += [f"pre(a{a},v{v},{word[kinds[v]][x]})." for v, x in pre.items()]
        lines += [f"eff(a{a},v{v},{e})." for v, e in eff.items()]
    choices = {}
    for state in product((0, 1), repeat=len(kinds)):
        for name, (pre, eff) in actions.items():
            if any(state[v] != x for v, x in pre.items()) or any(
                e == "decrease" and not state[v] for v, e in eff.items()
            ):
                continue
            result = {"increase": (1,), "decrease": (0, 1), "true": (1,), "false": (0,)}
            values = [result[eff[v]] if v in eff else (state[v],) for v in everywhere]
            choices.setdefault(state, {})[name] = list(product(*values))
    valuations = list(product((0, 1), repeat=len(kinds)))
    initial = [s for s in valuations if all(s[v] == x for v, x in init.items())]
    goals = {s for s in valuations if all(s[v] == x for v, x in goal.items())}
    may = {name: {v for v, e in eff.items() if e == "decrease"} for name, (_, eff) in actions.items()}
    unless = {name: {v for v, e in eff.items() if e == "increase"} for name, (_, eff) in actions.items()}
    rng.shuffle(lines)
    return Tiny(initial, goals, choices, may, unless, "\n".join(lines))


def random_pddl(rng):
    """Propositional PDDL with oneof and when; an action is a list of outcomes, each a list of (if, atom, value)."""
    atoms = [f"p{i}" for i in range(rng.randint(1, 4))]

    def literal(atom, value):
        return f"({atom})" if value else f"(not ({atom}))"

    def some(share):
        return {atom: rng.random() < 0.5 for atom in atoms if rng.random() < share}

    actions, lines = {}, []
    for a in range(rng.randint(1, 4)):
        pre = some(0.3)
        outcomes = [
            [(some(0.2), atom, value) for atom, value in some(0.5).items()] for _ in range(rng.choice([1, 2, 2, 3]))
        ]
        always = [(some(0.2), atom, value) for atom, value in some(0.15).items()]
        actions[f"a{a}"] = (pre, [always + outcome for outcome in outcomes])

        def effect(changes):
            parts = []
            for condition, atom, value in changes:
                when = " ".join(literal(*row) for row in condition.items())
                parts.append(f"(when (and {when}) {literal(atom, value)})" if condition else literal(atom, value))
            return f"(and {' '.join(parts)})"

        lines.append(
            f"(:action a{a} :parameters () :precondition (and {' '.join(literal(*row) for row in pre.items())})\n"
            f"  :effect (and {effect(always)} (oneof {' '.join(map(effect, outcomes))})))"
        )
    start = {atom: rng.random() < 0.5 for atom in atoms}
    goal = {atom: rng.random() < 0.5 for atom in rng.sample(atoms, min(2, len(atoms)))}
    choices = {}
    for values in product((False, True), repeat=len(atoms)):
        state = dict(zip(atoms, values, strict=True))
        for name, (pre, outcomes) in actions.items():
            if all(state[atom] == value for atom, value in pre.items()):
                after = []
                for outcome in outcomes:
                    now = [
                        (atom, value) for cond, atom, value in outcome if all(state[a] == v for a, v in cond.items())
                    ]
                    result = {**state, **{a: False for a, v in now if not v}, **{a: True for a, v in now if v}}
                    after.append(tuple(result.values()))
                choices.setdefault(values, {})[name] = after
    valuations = product((False, True), repeat=len(atoms))
    goals = {values for values in valuations if all(values[atoms.index(a)] == v for a, v in goal.items())}
    predicates = " ".join(f"({atom})" for atom in atoms)
    init = " ".join(f"({atom})" for atom, value in start.items() if value)
    text = (
        f"(define (domain d) (:predicates {predicates})\n" + "\n".join(lines) + ")\n"
        f"(define (problem p) (:domain d) (:init {init})\n"
        f"(:goal (and {' '.join(literal(*row) for row in goal.items())})))"
    )
    return Tiny([tuple(start.values())], goals, choices, {}, {}, text)
