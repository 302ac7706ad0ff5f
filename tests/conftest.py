"""A cache of the session's own; policies learned once for each process of it, from geometry computed here."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.tasks.task import Task

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in what a shell starts in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what tests start must not inherit it


@pytest.fixture(scope="session", autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where commands keep demonstrations and meshes: all processes of the session share it, other sessions do not."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


@pytest.fixture(scope="session")
def unstack() -> Learned:
    return learn(Task.load("unstack"), cache=False)


@pytest.fixture(scope="session")
def load() -> Learned:
    return learn(Task.load("load"), cache=False, max_complexity=3)


@pytest.fixture(params=["unstack", "load"])
def learned(request) -> Learned:
    return request.getfixturevalue(request.param)
