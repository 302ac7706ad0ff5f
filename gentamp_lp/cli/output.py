"""Data goes to stdout, messages to stderr."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console

from gentamp_lp.errors import Diagnostic, InputError

messages = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)  # names are not markup


class Progress:
    """Messages of a long stage, unless silenced."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet

    def __call__(self, text: str) -> None:
        """Print a message."""
        if not self.quiet:
            messages.print(f"· {text}", style="dim")


def print_json(document: dict[str, Any]) -> None:
    """Print the one document of `--json`."""
    sys.stdout.write(json.dumps(document, indent=2, ensure_ascii=False) + "\n")


def say(text: str) -> None:
    """Print a line of the answer."""
    sys.stdout.write(text + "\n")


class _Output(io.TextIOWrapper):
    """A stream whose failure ends the program: as SIGPIPE does where nobody reads, else (full disk) as bad input."""

    def write(self, text: str) -> int:
        with self._ending():
            return super().write(text)

    def flush(self) -> None:
        with self._ending():
            super().flush()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())  # also what Python writes at its end
            if isinstance(error, BrokenPipeError):
                raise SystemExit(141) from None
            raise InputError(
                Diagnostic(f"cannot write the output: {error.strerror}", hint="send it elsewhere")
            ) from None


def open_streams() -> None:
    """Let closed streams lead nowhere, and show what the locale has no signs for as escapes."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: SIM115
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        if type(stream) is io.TextIOWrapper:  # nobody replaced it
            encoding, buffering, through = stream.encoding, stream.line_buffering, stream.write_through
            setattr(sys, name, _Output(stream.detach(), encoding, "backslashreplace", None, buffering, through))
