"""Robots that an extra of the package brings."""

from importlib.metadata import PackageNotFoundError, distribution

import pytest


def installed(package):
    try:
        return bool(distribution(package))
    except PackageNotFoundError:
        return False


needs_pr2 = pytest.mark.skipif(not installed("example-robot-data"), reason="no extra `robots`")
