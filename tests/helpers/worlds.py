"""Symbolic worlds small enough to simulate by hand, demonstrations in them, and samples as facts.

A world has `start`, `goal(state)`, `moves(state)` -> {action text: state} and `demo(state)` -> action text, the
canonical demonstration. Features are functions of a state; entities carry an irrelevant attribute, Heavy.
"""

from typing import NamedTuple


class F(NamedTuple):
    text: str
    cost: int
    kind: str
    value: object


def heavy(name):
    """An attribute that has nothing to do with any task."""
    return sum(map(ord, name)) % 3 == 0


class Unstack:
    """Blocks in towers; goal: every block on the table. State: (held block or None, towers)."""

    def __init__(self, *towers):
        names = iter("abcdefghijklmnopqrstuvwxyz")
        self.start = (None, frozenset(tuple(next(names) for _ in range(n)) for n in towers))

    def goal(self, state):
        held, towers = state
        return held is None and all(len(tower) == 1 for tower in towers)

    def moves(self, state):
        held, towers = state
        if held is not None:
            out = {f"put {held} table": (None, towers | {(held,)})}
            for tower in towers:
                out[f"stack {held} {tower[-1]}"] = (None, towers - {tower} | {(*tower, held)})
            return out
        return {
            f"pick {tower[-1]}": (tower[-1], towers - {tower} | ({tower[:-1]} if tower[1:] else set()))
            for tower in towers
        }

    def demo(self, state):
        held, towers = state
        return f"put {held} table" if held else min(f"pick {tower[-1]}" for tower in towers if tower[1:])

    features = (
        F("holding", 1, "boolean", lambda s: s[0] is not None),
        F("blocks on blocks", 3, "numeric", lambda s: sum(len(t) - 1 for t in s[1])),
        F("blocks on the table", 3, "numeric", lambda s: len(s[1])),
        F("heavy held", 2, "boolean", lambda s: s[0] is not None and heavy(s[0])),
        F("heavy on blocks", 4, "numeric", lambda s: sum(heavy(b) for t in s[1] for b in t[1:])),
        F("heavy clear", 3, "numeric", lambda s: sum(heavy(t[-1]) for t in s[1])),
        F("clear blocks on blocks", 4, "numeric", lambda s: sum(len(t) > 1 for t in s[1])),
        F("light blocks", 2, "numeric", lambda s: sum(not heavy(b) for t in s[1] for b in t)),
        F("lonely blocks", 4, "numeric", lambda s: sum(len(t) == 1 for t in s[1])),
        F("blocks below others", 3, "numeric", lambda s: sum(len(t) - 1 for t in s[1]) + 0),
    )


class Load:
    """Put objects on a tray until it is full or the table is empty, then pick the tray up.

    State: (held, objects on the table, objects on the tray); held is None, an object or "tray".
    """

    def __init__(self, objects, capacity):
        self.capacity = capacity
        self.start = (None, frozenset("abcdefgh"[:objects]), frozenset())
        free = F("free tray places", 5, "numeric", lambda s: capacity - len(s[2]))
        self.features = (*self.common, free)

    def goal(self, state):
        held, table, tray = state
        return held == "tray" and (not table or len(tray) == self.capacity)

    def moves(self, state):
        held, table, tray = state
        if held == "tray":
            return {"puttray": (None, table, tray)}
        if held is not None:
            out = {f"put {held} table": (None, table | {held}, tray)}
            if len(tray) < self.capacity:
                out[f"load {held}"] = (None, table, tray | {held})
            return out
        out = {f"pick {o}": (o, table - {o}, tray - {o}) for o in table | tray}
        return {**out, "picktray": ("tray", table, tray)}

    def demo(self, state):
        held, table, tray = state
        if held is not None:
            return f"load {held}"
        return f"pick {min(table)}" if table and len(tray) < self.capacity else "picktray"

    common = (
        F("holding an object", 2, "boolean", lambda s: s[0] not in (None, "tray")),
        F("holding the tray", 2, "boolean", lambda s: s[0] == "tray"),
        F("objects on the table", 3, "numeric", lambda s: len(s[1])),
        F("objects on the tray", 4, "numeric", lambda s: len(s[2])),
        F("heavy on the table", 4, "numeric", lambda s: sum(map(heavy, s[1]))),
        F("heavy on the tray", 4, "numeric", lambda s: sum(map(heavy, s[2]))),
        F("heavy held", 3, "boolean", lambda s: s[0] not in (None, "tray") and heavy(s[0])),
        F("light on the table", 4, "numeric", lambda s: sum(not heavy(o) for o in s[1])),
        F("things standing with the tray", 4, "numeric", lambda s: len(s[1]) * (s[0] != "tray")),
        F("objects not on the tray", 4, "numeric", lambda s: len(s[1]) + (s[0] not in (None, "tray"))),
        F("hand or tray used", 4, "numeric", lambda s: (s[0] is not None) + len(s[2])),
    )


LOAD_SIZES = ((1, 3), (4, 2), (3, 3), (2, 1))
UNSTACK_SIZES = ((3,), (2, 2), (1, 3, 2))


class Gathered(NamedTuple):
    facts: str
    states: list
    texts: dict
    schemas: dict


def gather(worlds, features=None):
    """Facts of canonical demonstrations, and of all other successors as seen, unexpanded states."""
    lines, states, seen_schemas = [], [], {}
    number = {}

    def state_id(problem, state):
        key = (problem, state)
        if key not in number:
            number[key] = len(number) + 1
            states.append(key)
            lines.append(f"state({number[key]},{problem}).")
            if worlds[problem - 1].goal(state):
                lines.append(f"goal({number[key]}).")
            for f, feature in enumerate(pool(problem), 1):
                if feature.value(state):
                    lines.append(f"pos({f},{number[key]}).")
        return number[key]

    def pool(problem):
        return features or worlds[problem - 1].features

    for f, feature in enumerate(pool(1), 1):
        lines.append(f"feature({f},{feature.cost},{feature.kind}).")
    count = 0
    for problem, world in enumerate(worlds, 1):
        state = world.start
        lines.append(f"initial({state_id(problem, state)}).")
        while not world.goal(state):
            demo = world.demo(state)
            for action, after in sorted(world.moves(state).items()):
                count += 1
                ends = f"{state_id(problem, state)},{state_id(problem, after)}"
                lines.append(f"transition({count},{ends}).")
                seen_schemas[count] = action.split()[0]
                lines.append(f"action({count},{seen_schemas[count]}).")
                if action == demo:
                    lines.append(f"candidate({count}).")
                for f, feature in enumerate(pool(problem), 1):
                    rise = feature.value(after) - feature.value(state)
                    if rise:
                        lines.append(f"{'inc' if rise > 0 else 'dec'}({f},{count}).")
            state = world.moves(state)[demo]
    texts = {f: feature.text for f, feature in enumerate(pool(1), 1)}
    return Gathered("\n".join(lines), states, texts, seen_schemas)
