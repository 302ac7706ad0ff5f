"""Brute force over all selections and choices of a tiny sample, with an acceptance check of its own."""

from itertools import combinations, product


def subsets(items):
    items = sorted(items)
    return [set(c) for n in range(len(items) + 1) for c in combinations(items, n)]


class Sample:
    """Plain sets; nothing is shared with the package."""

    def __init__(self, rng, features=(3, 6)):
        nf, ns = rng.randint(*features), rng.randint(4, 7)
        self.states = list(range(1, ns + 1))
        self.features = list(range(1, nf + 1))
        self.cost = {f: rng.randint(1, 4) for f in self.features}
        self.sizes = {f: 7 * f % 5 for f in self.features}
        self.kind = {f: rng.choice(["boolean", "numeric", "numeric"]) for f in self.features}
        self.value = {
            (f, s): rng.choice([0, 1] if self.kind[f] == "boolean" else [0, 1, 2, 3])
            for f in self.features
            for s in self.states
        }
        order = self.states[:]
        rng.shuffle(order)
        self.goals = set(order[: rng.choice([1, 1, 2])])
        self.trans = []
        several = rng.random() < 0.5
        unexpanded = {s for s in self.states if rng.random() < 0.2}
        toward = rng.random() < 0.7
        for i, s in enumerate(order):
            if s in self.goals or s in unexpanded:
                continue
            for _ in range(rng.choice([1, 1, 2]) if several else 1):
                pool = order[:i] if toward and rng.random() < 0.8 else order
                self.trans.append((len(self.trans) + 1, s, rng.choice(pool)))
        self.candidates = {}
        for t, s, _ in self.trans:
            self.candidates.setdefault(s, []).append(t)

    def size(self, f):
        """The length of a feature's formula: anything that is neither its cost nor its number."""
        return self.sizes[f]

    def change(self, f, t):
        _, s, s2 = self.trans[t - 1]
        d = self.value[f, s2] - self.value[f, s]
        return (d > 0) - (d < 0)

    def facts(self):
        out = [f"state({s},1)." for s in self.states] + [f"goal({s})." for s in sorted(self.goals)]
        out += [f"initial({self.states[0]})."]
        out += [f"transition({t},{s},{u}). candidate({t}). action({t},move)." for t, s, u in self.trans]
        for f in self.features:
            out.append(f"feature({f},{self.cost[f]},{self.kind[f]}). size({f},{self.size(f)}).")
            out += [f"pos({f},{s})." for s in self.states if self.value[f, s] > 0]
            for t, _, _ in self.trans:
                out += {1: [f"inc({f},{t})."], -1: [f"dec({f},{t})."], 0: []}[self.change(f, t)]
        return "\n".join(out)

    def look(self, phi, s):
        return tuple(self.value[f, s] > 0 for f in phi)

    def accepts(self, phi, choice, fairness, unseen="drop"):
        phi = sorted(phi)
        looks = {s: self.look(phi, s) for s in self.states}
        goals = {looks[s] for s in self.goals}
        if any(looks[s] in goals for s in self.states if s not in self.goals):
            return False
        rule = {}
        for s, t in choice.items():
            effect = tuple(self.change(f, t) for f in phi)
            if not any(effect) or rule.setdefault(looks[s], effect) != effect:
                return False
        edges = []
        for look, effect in rule.items():
            options = []
            for f, before, e in zip(phi, look, effect, strict=True):
                if e == 1:
                    options.append([True])
                elif e == -1:
                    options.append([False] if self.kind[f] == "boolean" else [True, False])
                else:
                    options.append([before])
            for after in product(*options):
                if after not in looks.values():
                    if unseen == "refuse":
                        return False
                    continue
                if after not in goals and after not in rule:
                    return False
                edges.append((look, after))
        good = set(goals)
        for _ in rule:
            good |= {a for a, b in edges if b in good}
        if not set(rule) <= good:
            return False
        inner = [e for e in edges if e[1] in rule]
        numeric = [i for i, f in enumerate(phi) if self.kind[f] == "numeric"]
        if fairness == "strong-cyclic":
            return True
        return not any(self.endless(loop, rule, numeric, fairness) for loop in closed_walks(inner))

    def endless(self, loop, rule, numeric, fairness):
        """May a run repeat exactly these edges for ever? Not if a count is lowered and never raised."""
        if fairness == "strong":
            return True
        effects = [rule[a] for a, _ in loop]
        return not any(any(e[i] == -1 for e in effects) and not any(e[i] == 1 for e in effects) for i in numeric)

    def least(self, fairness):
        """The least (cost, size, number) that some choice makes right, or None: `optima` without what is dearer."""
        sources = sorted(self.candidates)
        choices = [dict(zip(sources, m, strict=True)) for m in product(*(self.candidates[s] for s in sources))]
        weighed = sorted(
            (sum(self.cost[f] for f in phi), sum(self.size(f) for f in phi), len(phi), sorted(phi))
            for phi in subsets(self.features)
        )
        for *weight, phi in weighed:
            if any(self.accepts(phi, choice, fairness) for choice in choices):
                return tuple(weight)
        return None

    def optima(self, fairness, unseen="drop"):
        """All (cost, size, number, rules, features) that some choice makes right, best first, with the first choice."""
        found = []
        sources = sorted(self.candidates)
        for phi in subsets(self.features):
            for moves in product(*(self.candidates[s] for s in sources)):
                if self.accepts(phi, dict(zip(sources, moves, strict=True)), fairness, unseen):
                    rules = len({self.look(sorted(phi), s) for s in sources})
                    weight = sum(self.cost[f] for f in phi), sum(self.size(f) for f in phi), len(phi)
                    found.append((*weight, rules, tuple(sorted(phi)), moves))
        return sorted(found)


def closed_walks(edges):
    """Every set of edges that is strongly connected: what a run can repeat for ever."""
    edges = sorted(set(edges))
    for mask in range(1, 1 << len(edges)):
        part = [e for i, e in enumerate(edges) if mask >> i & 1]
        nodes = {n for e in part for n in e}
        start = part[0][0]
        if reach(start, part) >= nodes and reach(start, [(b, a) for a, b in part]) >= nodes:
            yield part


def reach(start, edges):
    seen = {start}
    while True:
        more = {b for a, b in edges if a in seen} - seen
        if not more:
            return seen
        seen |= more
