"""Errors the user can act on, and the diagnostics they carry."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Diagnostic:
    """One complaint about an input file: where it is, what is wrong, what to do about it."""

    message: str
    path: Path | str | None = None
    line: int | None = None
    column: int | None = None
    hint: str | None = None

    def __str__(self) -> str:
        path = None if self.path is None else "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(self.path))
        where = ":".join(str(part) for part in (path, self.line, self.column) if part is not None)
        text = f"{where}: error: {self.message}" if where else f"error: {self.message}"
        return f"{text}\n  hint: {self.hint}" if self.hint else text


class GentampError(Exception):
    """Base of all errors raised on purpose; `exit_code` is what the command line returns for it."""

    exit_code = 1


class InputError(GentampError):
    """Bad input: a file, an option or a missing program. Carries one or more diagnostics."""

    exit_code = 2

    def __init__(self, *diagnostics: Diagnostic | str) -> None:
        self.diagnostics = tuple(Diagnostic(d) if isinstance(d, str) else d for d in diagnostics)
        super().__init__("\n".join(str(d) for d in self.diagnostics))


def code_fault(what: str, error: Exception, folder: Path | None = None) -> InputError:
    """What to raise when Python code of a domain raises: where it did, in a file of its `folder` if there is one."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if folder and Path(frame.filename).is_relative_to(folder)]
    where, message = (own or frames)[-1], f"{what}: {type(error).__name__}: {error}"
    return InputError(Diagnostic(message, where.filename, where.lineno, hint="this is Python code of the domain"))


class SceneError(InputError):
    """What a task's `scene:` asks for cannot be; `location` holds the keys below `scene:` that lead to the place."""

    def __init__(self, message: str, location: tuple[str | int, ...], *, hint: str | None = None) -> None:
        super().__init__(Diagnostic(message, hint=hint))
        self.location = location


class NoAnswer(GentampError):
    """A true negative: no policy or no plan exists (within what was sampled), or a plan is invalid."""

    exit_code = 1


class LimitReached(GentampError):
    """A limit, of time unless a subclass says otherwise, ended the work before an answer was known.

    `remedy` is what may lead to one.
    """

    exit_code = 3
    remedy = "a longer --timeout"


class MemoryLimitReached(LimitReached):
    """The limit that ended the work was memory."""

    remedy = "more memory, or fewer `samples` in the task file,"


class SolverError(GentampError):
    """An outside program failed in a way that is neither an answer nor a limit."""

    exit_code = 1
