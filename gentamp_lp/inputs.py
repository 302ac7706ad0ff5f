"""Reading files that users give: what cannot be read is refused with file, line and reason."""

from __future__ import annotations

import json
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
            raise InputError(Diagnostic("cannot read the file: this is a folder", path))
        if path.exists() and not path.is_file():
            raise InputError(Diagnostic("cannot read the file: it is a pipe or a device", path))
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(Diagnostic("no such file", path)) from None
    except OSError as error:
        raise InputError(Diagnostic(f"cannot read the file: {error.strerror}", path)) from None
    except ValueError as error:  # not UTF-8
        raise InputError(Diagnostic(f"cannot read the file: {error}", path)) from None


def read_json(path: Path) -> Any:
    """What a JSON file holds. Raises InputError when it is none."""
    text = read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(Diagnostic(f"not valid JSON: {error.msg}", path, error.lineno, error.colno)) from None
    except RecursionError:
        raise InputError(Diagnostic("cannot read the file: it is nested too deeply", path)) from None
    except ValueError as error:  # numbers with thousands of digits
        raise InputError(Diagnostic(f"cannot read the file: {error}", path)) from None


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
        raise InputError(Diagnostic("cannot read the file: it is nested too deeply", path)) from None
    except (YAMLError, ValueError, TypeError, KeyError) as error:  # the last three: values unlike their tags
        reason = str(error).partition("\n")[0]
        raise InputError(Diagnostic(f"cannot read the file: {reason}", path)) from None


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
