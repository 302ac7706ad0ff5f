"""Files shipped with installed packages, found without loading these."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path


def data_path(*names: str) -> Path:
    """Return the path of a file of `pybullet_data`, e.g. `data_path("franka_panda", "panda.urdf")`.

    Raises ModuleNotFoundError when the package, which comes with pybullet, is missing.
    """
    folder = package_folder("pybullet_data")
    if folder is None:
        raise ModuleNotFoundError("pybullet_data, which comes with pybullet, is missing")
    return folder.joinpath(*names)


def package_folder(name: str) -> Path | None:
    """Return the folder of an installed top-level package, None when there is no such package."""
    spec = find_spec(name) if name.isidentifier() else None
    return None if spec is None or spec.origin is None else Path(spec.origin).parent


def find_mesh(name: str, folder: Path) -> Path:
    """Return the path of a mesh: a file in `folder`, or a package and a file in it (`pybullet_data/duck.obj`).

    Raises ValueError when there is none, or it is not in a format that both checkers read.
    """
    package, _, rest = name.partition("/")
    places = [folder / name, *(p / rest for p in (package_folder(package),) if p and rest)]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise ValueError(f"no mesh `{name}`: give a file beside the task file, or package/file of an installed package")
    if found.suffix.lower() not in (".obj", ".stl"):
        raise ValueError(f"`{name}` is neither an .obj nor an .stl file: export the mesh as one of these")
    return found
