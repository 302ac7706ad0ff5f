"""Grammar files by name or by path."""

from __future__ import annotations

from pathlib import Path

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import Diagnostic, InputError


def find_grammar(name: str | Path, folder: Path = Path()) -> Path:
    """The path of a grammar file, relative to `folder`; or a shipped one by its name, such as `paper`.

    Raises InputError when there is none.
    """
    path = folder / name
    shipped = resource("logic", f"{name}.lp")
    if path.is_file() or path.suffix or len(Path(name).parts) > 1:
        return path  # if it is missing, Prolog says so
    if shipped.is_file():
        return shipped
    names = ", ".join(sorted(p.stem for p in resource("logic").glob("*.lp") if p.stem != "grammar"))
    raise InputError(Diagnostic("no such grammar", str(name), hint=f"give the path of a file or one of: {names}"))
