"""SWI-Prolog: in this process, or in a child that can be stopped and cannot eat all memory.

The only module that imports pyswip. Data go in and come out as text, because moving terms one by one
through pyswip is slow; goals are written by us, never by users (quote names with `quote_atom`).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from gentamp_lp.base.shipped import resource
from gentamp_lp.base.terms import quote_atom
from gentamp_lp.errors import Diagnostic, InputError, LimitReached, SolverError
from gentamp_lp.solvers.processes import die_with_parent, module

_HINT = (
    "install SWI-Prolog (e.g. `apt-get install swi-prolog-nox`) and pyswip (`pip install pyswip`); "
    "where SWI-Prolog is in an unusual place, set LIBSWIPL_PATH and SWI_HOME_DIR"
)


class Prolog:
    """SWI-Prolog in this process. There is one engine a process; use it from the main thread only."""

    def __init__(self) -> None:
        try:
            from pyswip import Prolog as Engine

            self._engine: Any = Engine()
            self._ask("set_prolog_flag(encoding, utf8)")  # whatever the locale
            self._ask(f"consult({quote_atom(resource('logic', 'bridge.pl'))})")
        except Exception as error:  # pyswip raises anything from OSError to SystemExit's cousins
            raise InputError(Diagnostic(f"SWI-Prolog cannot be started: {error}", hint=_HINT)) from error

    def load(self, path: Path) -> list[Diagnostic]:
        """Load a Prolog file and return its errors and warnings."""
        if not path.is_file():
            return [Diagnostic("file not found", path)]
        [row] = self._ask(f"bridge:load_report({quote_atom(path)}, Lines)")
        return parse_diagnostics(_text(row["Lines"]))

    def holds(self, goal: str) -> bool:
        """Whether the goal is true."""
        return self._answer(goal)[0]

    def text(self, goal: str) -> str:
        """Return what the goal, which must be true, prints."""
        true, output = self._answer(goal)
        if not true:
            raise SolverError(f"Prolog goal failed: {goal}")
        return output

    def rows(self, goal: str, *variables: str) -> list[tuple[str, ...]]:
        """Return the values of the variables in every solution, as written by Prolog."""
        line = "\\t".join(["~w"] * len(variables))
        output = self.text(f'forall(({goal}), format("{line}~n", [{", ".join(variables)}]))')
        return [tuple(row.split("\t")) for row in output.splitlines()]

    def _answer(self, goal: str) -> tuple[bool, str]:
        [row] = self._ask(f"bridge:answer({quote_atom(goal)}, Status, Output)")
        status, output = row["Status"], _text(row["Output"])
        if status == "limit":
            raise LimitReached(f"Prolog ran out of memory: {output}")
        if status == "input":
            raise InputError(*parse_diagnostics(output))
        if status == "error":
            raise SolverError(f"Prolog: {output}")
        return status == "true", output

    def _ask(self, goal: str) -> list[dict[str, Any]]:
        return list(self._engine.query(goal, maxresult=1))


def parse_diagnostics(lines: str) -> list[Diagnostic]:
    """Read lines `file TAB line TAB column TAB message`; 0 stands for unknown."""
    result = []
    for row in lines.splitlines():
        path, line, column, message = row.split("\t", 3)
        result.append(Diagnostic(message, path or None, int(line) or None, int(column) or None))
    return result


def _text(value: str | bytes) -> str:
    return value.decode() if isinstance(value, bytes) else value


class PrologProcess:
    """The same in a child process: use it in a `with` block, which ends the child in any case."""

    def __init__(self, memory_mb: int = 4096) -> None:
        self._complaints = tempfile.TemporaryFile("w+", errors="replace")  # noqa: SIM115 (closed with the child)
        self._child = subprocess.Popen(
            module(__name__, str(memory_mb)),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            text=True,
        )
        self._timed_out = False

    def __enter__(self) -> PrologProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self._child.kill()
        self._child.communicate()
        self._complaints.close()

    def load(self, path: Path, time_limit: float | None = None) -> list[Diagnostic]:
        """See `Prolog.load`."""
        return parse_diagnostics(self._call("load", str(path), time_limit))

    def text(self, goal: str, time_limit: float | None = None) -> str:
        """See `Prolog.text`; `LimitReached` after `time_limit` seconds, and then the child is gone."""
        return self._call("text", goal, time_limit)

    def _call(self, method: str, argument: str, time_limit: float | None) -> str:
        assert self._child.stdin is not None and self._child.stdout is not None
        try:
            argument.encode()
        except UnicodeEncodeError as error:
            wrong = argument[error.start : error.end]
            hint = "write formulas, and name files, in UTF-8"
            raise InputError(Diagnostic(f"{wrong!r} is not Unicode text", hint=hint)) from None
        timer = None
        if time_limit is not None and time_limit < threading.TIMEOUT_MAX:
            timer = threading.Timer(max(0.0, time_limit), self._expire)
            timer.daemon = True
            timer.start()
        try:
            self._child.stdin.write(json.dumps([method, argument]) + "\n")
            self._child.stdin.flush()
            reply = self._child.stdout.readline()
        except BrokenPipeError:
            reply = ""
        finally:
            if timer:
                timer.cancel()
        if not reply:
            self._explain_death()
        kind, value = json.loads(reply)
        if kind == "start":
            raise InputError(Diagnostic(value, hint=_HINT))
        if kind == "input":
            raise InputError(*parse_diagnostics(value))
        if kind == "limit":
            raise LimitReached(value)
        if kind == "error":
            raise SolverError(value)
        return str(value)

    def _expire(self) -> None:
        self._timed_out = True
        self._child.kill()

    def _explain_death(self) -> NoReturn:
        if self._timed_out:
            raise LimitReached("time limit reached in Prolog")
        self._child.communicate()
        self._complaints.seek(0)
        complaints = self._complaints.read()
        last = complaints.strip().splitlines()[-1:] or ["no message"]
        if "memory" in complaints or "resource" in complaints or "alloc" in complaints:
            raise LimitReached(f"Prolog ran out of memory ({last[0]})")
        raise SolverError(f"the Prolog process ended with status {self._child.returncode}: {last[0]}")


def _serve(memory_mb: int) -> None:
    """Answer requests `[method, argument]`, one JSON text a line, until the parent is gone."""
    replies = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # whatever else prints must not end up among the replies
    _restrict(memory_mb)
    try:
        prolog = Prolog()
        prolog.holds(f"set_prolog_flag(stack_limit, {memory_mb * 500_000})")
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
        problem = None
    except InputError as error:
        problem = error.diagnostics[0].message
    for line in sys.stdin:
        method, argument = json.loads(line)
        try:
            if problem is not None:
                reply = ["start", problem]
            elif method == "load":
                reply = ["ok", "".join(_lines(prolog.load(Path(argument))))]
            else:
                reply = ["ok", prolog.text(argument)]
        except InputError as error:
            reply = ["input", "".join(_lines(error.diagnostics))]
        except LimitReached as error:
            reply = ["limit", str(error)]
        except SolverError as error:
            reply = ["error", str(error)]
        replies.write(json.dumps(reply) + "\n")
        replies.flush()


def _lines(diagnostics: Iterable[Diagnostic]) -> Iterable[str]:
    for d in diagnostics:
        yield f"{d.path or ''}\t{d.line or 0}\t{d.column or 0}\t{d.message}\n"


def _restrict(memory_mb: int) -> None:
    if sys.platform == "linux":
        import resource as limits

        limits.setrlimit(limits.RLIMIT_AS, (memory_mb << 20, memory_mb << 20))
        die_with_parent()


if __name__ == "__main__":
    _serve(int(sys.argv[1]))
