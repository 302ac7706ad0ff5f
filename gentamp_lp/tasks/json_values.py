"""Sampled values as JSON and back, for domains that do not say how to write theirs.

Numbers, strings, truth values and None stand for themselves, so do lists of what can be written; a tuple is written as
`{"tuple": [...]}`, an array as `{"array": rows, "shape": [...], "dtype": "float64"}`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_KINDS = "biuf"  # of arrays: truth values, whole numbers, floating point numbers


def to_json(value: Any) -> Any:
    """JSON data from which `from_json` makes an equal value. Raises TypeError, ValueError when it cannot be written."""
    match value:
        case np.generic():
            return to_json(value.item())
        case None | bool() | int() | str():
            return value
        case float():
            return _finite(value)
        case list():
            return [to_json(part) for part in value]
        case tuple():
            return {"tuple": [to_json(part) for part in value]}
        case np.ndarray() if value.dtype.kind in _KINDS:
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise ValueError("an array with a number that is not finite")
            return {"array": value.tolist(), "shape": list(value.shape), "dtype": value.dtype.name}
        case np.ndarray():
            raise TypeError(f"an array of {value.dtype.name}")
    raise TypeError(f"a value of type {type(value).__name__}")


def from_json(data: Any) -> Any:
    """The value that `to_json` wrote. Raises ValueError, KeyError, TypeError for what it never writes."""
    match data:
        case None | bool() | int() | str():
            return data
        case float():
            return _finite(data)
        case {"tuple": Sequence() as parts} if not isinstance(parts, str):
            return tuple(from_json(part) for part in parts)
        case {"array": rows}:
            kind = np.dtype(data["dtype"])
            if kind.kind not in _KINDS:
                raise ValueError(f"an array of {kind.name}")
            return np.array(rows, dtype=kind).reshape([int(length) for length in data["shape"]])
        case Mapping():
            raise ValueError(f"an object with the keys {', '.join(data)}")
    return [from_json(part) for part in data]


def _finite(number: float) -> float:
    if not math.isfinite(number):
        raise ValueError(f"{number}, which is not finite")
    return number
