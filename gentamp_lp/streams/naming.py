"""Names for Python values: planners know symbols only."""

from __future__ import annotations

import re
from typing import Any

#: Words with a meaning in PDDL that no predicate and no entity may be called; there may be a predicate `object`.
KEYWORDS = frozenset({"and", "or", "not", "imply", "exists", "forall", "when", "either", "define"})
RESERVED = KEYWORDS | {"object", "number"}


class Names:
    """One problem's values and their names: by equality where values are hashable, else by identity."""

    def __init__(self) -> None:
        self._equal: dict[Any, str] = {}
        self._identical: dict[int, tuple[Any, str]] = {}  # holds on to the value, so that its id stays its own
        self.given: set[str] = set()  # names of values that the problem itself states

    def find(self, value: Any) -> str | None:
        """The name of a value, None if it has none."""
        try:
            return self._equal.get(value)
        except TypeError:
            return self._identical.get(id(value), (None, None))[1]

    def add(self, value: Any, name: str) -> None:
        """Name a value."""
        try:
            self._equal[value] = name
        except TypeError:
            self._identical[id(value)] = (value, name)


def may_be_predicate(text: str) -> bool:
    """Whether something can be the name of a predicate, unlike variables, numbers and the words of PDDL."""
    return re.match(r"[^\W\d]", text) is not None and text.lower() not in KEYWORDS


def readable(value: Any) -> str:
    """The beginning of a name that reminds of a value."""
    if isinstance(value, str):
        text = re.sub(r"[^a-z0-9_]", "_", value.lower())
        return text if text[:1].isalpha() else f"o_{text}"
    return re.sub(r"[^a-z0-9_]", "_", type(value).__name__.lower()).lstrip("_0123456789") or "o"
