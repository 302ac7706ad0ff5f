"""Policies learned once for the whole test session, from geometry computed here (nothing is cached on disk)."""

import signal

import pytest

from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.tasks.task import Task

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in what a shell starts in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what tests start must not inherit it


@pytest.fixture(scope="session")
def unstack() -> Learned:
    return learn(Task.load("unstack"), cache=False)


@pytest.fixture(scope="session")
def load() -> Learned:
    return learn(Task.load("load"), cache=False, max_complexity=3)


@pytest.fixture(params=["unstack", "load"])
def learned(request) -> Learned:
    return request.getfixturevalue(request.param)
