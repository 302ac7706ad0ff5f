"""Processes that tests started: whether any outlives what started it."""

import time
from pathlib import Path


def left_alive(session: int, patience: float = 60.0) -> list[str]:
    """What the processes of a session run that have not ended after `patience` seconds."""
    deadline = time.monotonic() + patience  # the system ends children once their parent is gone, a little later
    while (left := _alive(session)) and time.monotonic() < deadline:
        time.sleep(0.02)
    return left


def _alive(session: int) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (path / "stat").read_text().rsplit(")", 1)[1].split()[:4]
            if int(its_session) == session and state != "Z":
                found.append((path / "cmdline").read_text().replace("\0", " "))
        except OSError:
            continue
    return found
