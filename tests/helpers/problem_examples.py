"""Generators of problems."""


def nested(depth: int, everywhere: bool = False) -> str:
    """Loops in loops: a0 lowers x0 and raises x1, a1 lowers x1 and raises x2, ... (2^(depth + 1) states).

    Three quarters of the states can be reached; with `everywhere` all are initial.
    """
    lines = [f"% Nested loops of depth {depth}: x0 falls once for each time that x1 runs out, and so on.", ""]
    for i in range(depth + 1):
        start = f" init(x{i}, {'zero' if i else 'positive'})."
        lines.append(f"numeric(x{i}).{'' if everywhere else start}")
    lines += ["goal(x0, zero).", ""]
    for i in range(depth + 1):
        lines.append(f"action(a{i}). pre(a{i}, x{i}, positive). eff(a{i}, x{i}, decrease).")
        if i < depth:
            lines.append(f"pre(a{i}, x{i + 1}, zero). eff(a{i}, x{i + 1}, increase).")
    return "\n".join(lines) + "\n"


def detours(length: int) -> str:
    """No policy ends, and there are 2^length reasons: each way around the circle is another loop.

    From each node of the circle one of two detours leads to the next; the last step may reach the goal, and is fair
    unless `start` is taken for ever, which every round does.
    """
    lines = [
        f"% A circle of {length} steps with two detours each: every one of the 2^{length} ways around is endless.",
        "",
    ]
    lines.append(" ".join(f"state(r({i}))." for i in range(length + 1)))
    lines += ["state(home). initialState(home). state(end). goal(end)."]
    lines += ["action(start). action(left). action(right). action(on). action(leave)."]
    lines += ["transition(home, start, r(0))."]
    for i in range(length):
        for side in ("left", "right"):
            lines.append(f"state({side}({i})). transition(r({i}), {side}, {side}({i})).")
            lines.append(f"transition({side}({i}), on, r({i + 1})).")
    lines += [f"transition(r({length}), leave, home). transition(r({length}), leave, end)."]
    lines += ["", "con_A(leave, luck). con_B(start, luck)."]
    return "\n".join(lines) + "\n"
