"""Ending a stream call that does not return in time.

Python code can only be interrupted by a signal, and only in the main thread. There, as long as nobody else uses
SIGALRM, a call that is still running shortly after the deadline is ended (code in C when it returns to Python);
elsewhere the deadline is only looked at between calls.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from gentamp_lp.errors import LimitReached
from gentamp_lp.streams.facts import FactBase

_GRACE = 0.15  # seconds that a call may go on after the deadline: it is not to blame if it is a short one
_AGAIN = 0.2  # seconds after which a call that has caught the interruption is interrupted again


class _Overdue(BaseException):
    """Raised inside a stream call; code that catches every `Exception` lets it pass."""


@contextmanager
def interrupting(base: FactBase, seconds: float) -> Iterator[None]:
    """Raise LimitReached when a stream call of the fact base does not return within so many seconds."""
    if seconds > threading.TIMEOUT_MAX or not _available():
        yield
        return
    start = time.monotonic()

    def ring(_signal: int, _frame: FrameType | None) -> None:
        if base.calling is not None:
            stream, inputs = base.calling
            raise _Overdue(f"stream `{stream}` was still running on ({', '.join(inputs)})")

    signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 0.0) + _GRACE, _AGAIN)
    try:
        yield
    except _Overdue as error:
        signal.setitimer(signal.ITIMER_REAL, 0)
        raise LimitReached(f"{error} at the time limit, after {time.monotonic() - start:.1f} s") from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)


def _available() -> bool:
    return (
        hasattr(signal, "setitimer")
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    )
