"""How long things take on this machine, as busy as it is at the moment; no test supposes its speed."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager


def start_of_python() -> float:
    """Seconds that the interpreter needs to start and end: the shortest of three times."""
    times = []
    for _ in range(3):
        begun = time.monotonic()
        subprocess.run([sys.executable, "-S", "-c", "pass"], check=True)
        times.append(time.monotonic() - begun)
    return min(times)


@contextmanager
def at_most(seconds: float, starts: int) -> Iterator[None]:
    """What is inside takes no longer than these seconds and so many starts of the interpreter, before or after it."""
    start = start_of_python()
    begun = time.monotonic()
    yield
    spent = time.monotonic() - begun
    allowed = seconds + starts * max(start, start_of_python())
    assert spent <= allowed, f"{spent:.2f} s, more than {seconds} s and {starts} starts of Python, {allowed:.2f} s"
