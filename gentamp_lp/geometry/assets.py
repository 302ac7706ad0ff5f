"""Files shipped with PyBullet, found without loading PyBullet."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path


def data_path(*names: str) -> Path:
    """Return the path of a file of `pybullet_data`, e.g. `data_path("franka_panda", "panda.urdf")`.

    Raises ModuleNotFoundError when the package, which comes with pybullet, is missing.
    """
    spec = find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError("pybullet_data, which comes with pybullet, is missing")
    return Path(spec.origin).parent.joinpath(*names)
