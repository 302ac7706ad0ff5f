"""Writing files whole or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gentamp_lp.errors import Diagnostic, InputError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make what keeps a file or folder from being written in the block an InputError."""
    try:
        yield
    except OSError as error:
        hint = "choose a place that has room and where you may write"
        raise InputError(Diagnostic(f"cannot write the file: {error.strerror}", path, hint=hint)) from None


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a file beside `path` to write to; at the end of the block it takes the place of `path`.

    If the block fails nothing is left behind. Raises InputError when the folder cannot be written to.
    """
    with writing(path):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "this is a folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:50]}-")
        os.close(handle)
        beside = Path(name)
        try:
            yield beside
            beside.chmod(0o644)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all. Raises InputError when it cannot be written."""
    with replacing(path) as beside:
        try:
            beside.write_text(text, encoding="utf-8", newline="\n")
        except UnicodeEncodeError as error:
            wrong = text[error.start : error.end]
            raise InputError(Diagnostic(f"cannot write the file: {wrong!r} is not Unicode text", path)) from None
