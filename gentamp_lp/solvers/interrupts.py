"""Ctrl-C beside code in C: put off while that runs, and not lost where Python swallows what it raises."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType

_AGAIN = 0.01  # seconds until a swallowed Ctrl-C is sent again


class Held:
    """Puts Ctrl-C off until the end of a `with` block, or forgets it there if `pending` was set to false.

    To be used around libraries that lose or are broken by an exception that is raised while they run. In other threads
    than the main one nothing is done, as none but the main thread is interrupted.
    """

    def __init__(self) -> None:
        self.pending = False

    def __enter__(self) -> Held:
        self._main = threading.current_thread() is threading.main_thread()
        if self._main:
            self._previous = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        if self._main:
            signal.signal(signal.SIGINT, self._previous)
            if self.pending:
                signal.raise_signal(signal.SIGINT)

    def _note(self, _signal: int, _frame: FrameType | None) -> None:
        self.pending = True


def send_swallowed_again() -> None:
    """Have Ctrl-C sent again where Python only prints what it raises: in finalizers, callbacks from C and on forks."""
    previous = sys.unraisablehook

    def hook(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            main = threading.main_thread().ident
            assert main is not None
            threading.Timer(_AGAIN, signal.pthread_kill, (main, signal.SIGINT)).start()
        else:
            previous(unraisable)

    sys.unraisablehook = hook
