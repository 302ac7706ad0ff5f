"""Processes that end with the one that started them."""

from __future__ import annotations

import ctypes
import signal

_libc = ctypes.CDLL(None)
_PR_SET_PDEATHSIG = 1


def die_with_parent() -> None:
    """Have the system kill this process once the thread that started it is gone (Linux; called in the child)."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
