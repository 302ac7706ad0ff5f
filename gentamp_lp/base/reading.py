"""Reading files that users give: what cannot be read is refused with file, line and reason."""

from __future__ import annotations

import json
import os
import shlex
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedBase
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from gentamp_lp.errors import Diagnostic, InputError


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, without a byte order mark. Raises InputError when it is none.

    Pipes and devices are refused: they may keep us waiting forever, and some files are read twice.
    """
    try:
        if path.is_dir():
            raise _unreadable(path, "this is a folder", "give a file")
        if path.exists() and not path.is_file():
            raise _unreadable(path, "it is a pipe or a device", "save what comes out of it in a file first")
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(Diagnostic("no such file", path, hint=_alike(path))) from None
    except OSError as error:
        hint = f"allow it: chmod u+r {shlex.quote(str(path))}" if isinstance(error, PermissionError) else None
        raise _unreadable(path, str(error.strerror), hint) from None
    except ValueError as error:  # not UTF-8
        raise _unreadable(path, str(error), "save it as UTF-8 text") from None
    before, nul, _ = text.partition("\0")
    if nul:
        raise _unreadable(path, "it holds a NUL character", "text has none: restore the file", before.count("\n") + 1)
    return text


def _unreadable(path: Path, why: str, hint: str | None = None, line: int | None = None) -> InputError:
    return InputError(Diagnostic(f"cannot read the file: {why}", path, line, hint=hint))


def _alike(path: Path) -> str | None:
    """What may have been meant by the name of a file that is not there."""
    readable = path.parent.is_dir() and os.access(path.parent, os.R_OK | os.X_OK)
    beside = [other.name for other in path.parent.iterdir()] if readable else []
    alike = get_close_matches(path.name, beside, 1)
    return f"did you mean `{path.parent / alike[0]}`?" if alike else None


def read_json(path: Path) -> Any:
    """What a JSON file holds. Raises InputError when it is none."""
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(Diagnostic(f"not valid JSON: {error.msg}", path, error.lineno, error.colno)) from None
    except RecursionError:
        raise _unreadable(path, "it is nested too deeply") from None
    except ValueError as error:  # numbers with thousands of digits
        raise _unreadable(path, str(error)) from None


def read_yaml(path: Path) -> Any:
    """What a YAML file holds, with the lines where it stands. Raises InputError when it is none."""
    text = read_text(path)
    try:
        return YAML(typ="rt", pure=True).load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, column = (mark.line + 1, mark.column + 1) if mark else (None, None)
        raise InputError(Diagnostic(f"not valid YAML: {error.problem}", path, line, column)) from None
    except RecursionError:
        raise _unreadable(path, "it is nested too deeply") from None
    except (YAMLError, ValueError, TypeError, KeyError) as error:  # the last three: values unlike their tags
        raise _unreadable(path, str(error).partition("\n")[0]) from None


Model = TypeVar("Model", bound=BaseModel)


def validated(
    model: type[Model], value: Any, root: Any, path: Path, prefix: tuple[str, ...] = (), hint: str | None = None
) -> Model:
    """What a pydantic model makes of a value that stands at `prefix` in a YAML file, read as `root`.

    Raises InputError with the line of each mistake.
    """
    try:
        return model.model_validate(value, context={"folder": path.parent})
    except ValidationError as error:
        raise InputError(
            *(
                Diagnostic(
                    f"{'.'.join(map(str, (*prefix, *e['loc']))) or 'file'}: {e['msg']}",
                    path,
                    line_of(root, (*prefix, *e["loc"])),
                    hint=hint,
                )
                for e in error.errors()
            )
        ) from None


def line_of(node: Any, location: tuple[Any, ...]) -> int:
    """The line of the deepest part of a location that stands in the file."""
    line = 1
    for key in location:
        if not isinstance(node, CommentedBase):
            break
        try:
            line = (node.lc.item(key) if isinstance(node, list) else node.lc.key(key))[0] + 1
            node = node[key]  # type: ignore[index]
        except (KeyError, IndexError, TypeError, AttributeError):
            break
    return line
