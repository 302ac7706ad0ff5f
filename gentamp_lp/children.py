"""Processes that end with the one that started them."""

from __future__ import annotations

import ctypes
import signal
import subprocess
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


def die_with_parent() -> None:
    """Have the system kill this process once the thread that started it is gone (Linux; called in the child)."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
