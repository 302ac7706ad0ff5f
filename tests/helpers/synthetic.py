"""Synthetic training data that resembles the tabletop domain: no geometry, random collisions."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

SORTS = ("object", "pose", "grasp", "traj")
OBJECT, POSE, GRASP, TRAJ = SORTS
PREDICATES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("movable", "table", "tray", "region", "red", "green", "blue", "holding"), (OBJECT,)),
    **{"stackable": (OBJECT, OBJECT), "on": (OBJECT, OBJECT), "fixed": (OBJECT, POSE), "standsat": (OBJECT, POSE)},
    **{"grasp": (OBJECT, GRASP), "pose": (OBJECT, POSE, OBJECT), "reach": (OBJECT, POSE, POSE, GRASP, TRAJ)},
    **{"cfree": (OBJECT, POSE, OBJECT, POSE), "reachcfree": (TRAJ, OBJECT, POSE), "blocked": (TRAJ,)},
    **{"handempty": (), "atpose": (OBJECT, POSE), "atgrasp": (OBJECT, GRASP), "unsafe": (OBJECT, POSE)},
}
OWNERS = (("pose", POSE, 2), ("grasp", GRASP, 2), ("reach", TRAJ, 5))
AT_MOST_ONE = ("holding", "atgrasp", "handempty")

Atom = tuple[str, ...]
Placement = tuple[str, str] | None  # (pose, support), None when held


@dataclass
class Data:
    """Training data under construction; `text()` is what the pool reads."""

    entities: list[dict[str, list[str]]] = field(default_factory=list)  # by problem
    static: list[set[Atom]] = field(default_factory=list)
    states: list[tuple[int, set[Atom]]] = field(default_factory=list)
    transitions: list[tuple[int, int]] = field(default_factory=list)

    def text(self) -> str:
        lines = [f"sort({s})." for s in SORTS]
        lines += [f"predicate({p}, [{', '.join(a)}])." for p, a in PREDICATES.items()]
        lines += [f"owner({p}, {s}, {i})." for p, s, i in OWNERS]
        lines += [f"at_most_one({p})." for p in AT_MOST_ONE]
        for n, entities in enumerate(self.entities):
            lines.append(f"problem({n}).")
            lines += [f"entity({n}, {s}, {e})." for s in SORTS for e in entities[s]]
            lines += [f"static({n}, {write(a)})." for a in sorted(self.static[n])]
        for s, (n, atoms) in enumerate(self.states):
            lines.append(f"state({s}, {n}).")
            lines += [f"fluent({s}, {write(a)})." for a in sorted(atoms)]
        lines += [f"transition({t}, {s}, {s2})." for t, (s, s2) in enumerate(self.transitions)]
        return "\n".join(lines) + "\n"


def write(atom: Atom) -> str:
    name, *arguments = atom
    return f"{name}({','.join(arguments)})" if arguments else name


class World:
    """One problem: blocks on a table (and on each other or on a tray), sampled poses, grasps, trajectories."""

    def __init__(
        self, rng: random.Random, blocks: int, poses: int, tray: bool, per_grasp: int = 1, colours: bool = False
    ) -> None:
        self.rng = rng
        self.blocks = [f"b{i}" for i in range(blocks)]
        self.supports = ["table"] + (["tray"] if tray else [])
        self.entities: dict[str, list[str]] = {s: [] for s in SORTS}
        self.entities[OBJECT] = [*self.supports, *self.blocks]
        self.static: set[Atom] = {("table", "table"), ("region", "table")} | {("movable", b) for b in self.blocks}
        if colours:
            self.static |= {(("red", "green", "blue")[i % 3], b) for i, b in enumerate(self.blocks)}
        self.static |= {("stackable", b, s) for b in self.blocks for s in self.supports + self.blocks if b != s}
        self.owner: dict[str, tuple[str, str]] = {}
        self.grasps: dict[str, str] = {}
        self.bad: set[frozenset[str]] = set()
        world = self._new(POSE, "w")
        self.static |= {("fixed", "table", world)}
        self.at: dict[str, Placement] = {}
        if tray:
            self.static |= {("tray", "tray"), ("movable", "tray"), ("stackable", "tray", "table")}
            self.at["tray"] = (self.pose("tray", "table"), "table")
        self.world = world
        for b in self.blocks + (["tray"] if tray else []):
            for _ in range(rng.choice((1, 2))):
                g = self._new(GRASP, "g")
                self.grasps[g] = b
                self.static.add(("grasp", b, g))
        self.extra_poses = poses
        self.per_grasp = per_grasp

    def _new(self, sort: str, prefix: str) -> str:
        name = f"{prefix}{len(self.entities[sort])}"
        self.entities[sort].append(name)
        return name

    def pose(self, obj: str, support: str) -> str:
        p = self._new(POSE, "p")
        self.owner[p] = (obj, support)
        self.static.add(("pose", obj, p, support))
        return p

    def certify(self) -> None:
        """Sample more poses, then decide collisions and trajectories at random."""
        for _ in range(self.extra_poses):
            b = self.rng.choice(self.blocks)
            self.pose(b, self.rng.choice([s for s in self.supports + self.blocks if s != b]))
        ps = list(self.owner)
        for i, p in enumerate(ps):
            for q in ps[i:]:
                (o, s), (o2, s2) = self.owner[p], self.owner[q]
                if o != o2 and s == s2 and self.rng.random() < 0.3:
                    self.bad.add(frozenset((p, q)))
                else:
                    self.static |= {("cfree", o, p, o2, q), ("cfree", o2, q, o, p)}
        self.blocked_by: dict[str, set[str]] = {}
        for p in ps:
            o, s = self.owner[p]
            for g in [g for g, b in self.grasps.items() if b == o]:
                for _ in range(self.per_grasp):
                    t = self._new(TRAJ, "t")
                    stands = self.at["tray"][0] if s == "tray" and self.at.get("tray") else self.world
                    self.static.add(("reach", o, p, stands, g, t))
                    others = [q for q in ps if self.owner[q][0] != o]
                    self.blocked_by[t] = {q for q in others if self.rng.random() < 0.1}
                    for q in others:
                        if q not in self.blocked_by[t]:
                            self.static.add(("reachcfree", t, self.owner[q][0], q))

    def atoms(self, at: dict[str, Placement], grasp: str | None) -> set[Atom]:
        held = [o for o, place in at.items() if place is None]
        placed = {o: place for o, place in at.items() if place is not None}
        result: set[Atom] = {("holding", o) for o in held} | ({("handempty",)} if not held else set())
        result |= {("atgrasp", self.grasps[grasp], grasp)} if grasp else set()
        standing = {place[0] for place in placed.values()}
        for o, (p, s) in placed.items():
            result |= {("atpose", o, p), ("on", o, s)}
        for p, (o, _) in self.owner.items():
            if any(q != p and frozenset((p, q)) in self.bad for q in standing):
                result.add(("unsafe", o, p))
        for t, blockers in self.blocked_by.items():
            if blockers & standing:
                result.add(("blocked", t))
        result.add(("standsat", "table", self.world))
        if "tray" in placed:
            result.add(("standsat", "tray", placed["tray"][0]))
        return result

    def moves(self, at: dict[str, Placement], grasp: str | None) -> list[tuple[dict[str, Placement], str | None]]:
        """All picks and places, without regard to reachability."""
        held = next((o for o, place in at.items() if place is None), None)
        if held is None:
            covered = {place[1] for place in at.values() if place is not None}
            return [
                (at | {o: None}, g) for g, o in self.grasps.items() if o in at and (o not in covered or o == "tray")
            ]
        standing = {place[0] for place in at.values() if place is not None}
        supports = {*self.supports, *(o for o in self.blocks if at[o] is not None)}
        return [
            (at | {held: (p, s)}, None)
            for p, (o, s) in self.owner.items()
            if o == held and s in supports and not any(frozenset((p, q)) in self.bad for q in standing)
        ]


def unstack(blocks: int = 8, poses: int = 24, seed: int = 0, around: bool = True, per_grasp: int = 1) -> Data:
    """One tower taken down block by block."""
    rng = random.Random(seed)
    world = World(rng, blocks, poses, tray=False, per_grasp=per_grasp)
    below = "table"
    for b in world.blocks:
        world.at[b] = (world.pose(b, below), below)
        below = b
    for b in world.blocks[1:]:
        world.pose(b, "table")
    world.certify()

    def prefer(at: dict[str, Placement]) -> float:
        on_block = sum(1 for place in at.values() if place and place[1] != "table")
        return on_block + rng.random() / 2

    data = Data()
    record(data, world, prefer, steps=2 * (blocks - 1), around=around)
    return data


def load(
    sizes: tuple[int, ...] = (3, 4, 5), poses: int = 20, seed: int = 0, around: bool = True, colours: bool = False
) -> Data:
    """Blocks moved from the table to a tray."""
    rng = random.Random(seed)
    data = Data()
    for blocks in sizes:
        world = World(rng, blocks, poses, tray=True, colours=colours)
        for b in world.blocks:
            world.at[b] = (world.pose(b, "table"), "table")
        for b in world.blocks:
            world.pose(b, "tray")
        world.certify()

        def prefer(at: dict[str, Placement]) -> float:
            return sum(1 for place in at.values() if place and place[1] != "tray") + rng.random() / 2

        record(data, world, prefer, steps=2 * blocks, around=around)
    return data


def record(data: Data, world: World, prefer: Callable[[dict[str, Placement]], float], steps: int, around: bool) -> None:
    """Follow the preferred move; with `around`, keep up to four other successors of each state too."""
    problem = len(data.entities)
    data.entities.append(world.entities)
    data.static.append(world.static)

    def add(at: dict[str, Placement], grasp: str | None) -> int:
        data.states.append((problem, world.atoms(at, grasp)))
        return len(data.states) - 1

    at, grasp = dict(world.at), None
    here = add(at, grasp)
    for _ in range(steps):
        moves = world.moves(at, grasp)
        if not moves:
            break
        best = min(range(len(moves)), key=lambda i: prefer(moves[i][0]))
        there = add(*moves[best])
        data.transitions.append((here, there))
        others = [m for i, m in enumerate(moves) if i != best]
        for move in world.rng.sample(others, min(4, len(others))) if around else []:
            data.transitions.append((here, add(*move)))
        (at, grasp), here = moves[best], there
