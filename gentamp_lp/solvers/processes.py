"""Processes that end with the one that started them, and Python processes that import what this one does."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

_libc = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1
_RAISING = {signal.SIGINT, signal.SIGALRM}  # their handlers raise


def start(command: list[str], prepare: Callable[[], None] = lambda: None, **options: Any) -> subprocess.Popen[str]:
    """Start a process that ends with this one; `prepare` is called in it first, `options` are those of `Popen`.

    Ctrl-C and alarms wait until it is started: Python swallows what they raise in the handlers that it runs on a fork.
    """
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _RAISING)

    def child() -> None:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        die_with_parent()
        prepare()

    try:
        return subprocess.Popen(command, text=True, preexec_fn=child, **options)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def python(code: str, *arguments: str) -> list[str]:
    """The command that runs code where modules are found as they are here, whatever is in the working directory."""
    return [sys.executable, "-P", "-c", f"import sys; sys.path[:] = {sys.path!r}; {code}", *arguments]


def module(name: str, *arguments: str) -> list[str]:
    """The same for a module, as `python -m` runs it."""
    return python(f"import runpy; runpy.run_module({name!r}, run_name='__main__', alter_sys=True)", *arguments)


def die_with_parent() -> None:
    """Have the system kill this process once the thread that started it is gone (Linux; called in the child)."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
