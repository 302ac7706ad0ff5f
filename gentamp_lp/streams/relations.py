"""Sets of tuples, indexed by what is asked for, and atoms as patterns of tuples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter

from gentamp_lp.streams.formula import Atom

Args = tuple[str, ...]
Places = dict[tuple[int, ...], int]


def picked(positions: Iterable[int]) -> Callable[[Sequence[str]], Args]:
    """A function that picks what stands at these positions."""
    match tuple(positions):
        case ():
            return lambda _: ()
        case (one,):
            return lambda row: (row[one],)
        case several:
            return itemgetter(*several)


class Relation:
    """The tuples of one predicate, in the order they came, indexed by the arguments asked for."""

    def __init__(self, rows: Iterable[Args] = ()) -> None:
        self.rows: dict[Args, None] = dict.fromkeys(rows)
        self._index: dict[tuple[int, ...], tuple[Callable[[Args], Args], dict[Args, list[Args]]]] = {}

    def __contains__(self, args: Args) -> bool:
        return args in self.rows

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, args: Args) -> bool:
        """Add a tuple; False when it was there."""
        if args in self.rows:
            return False
        self.rows[args] = None
        for key, table in self._index.values():
            table.setdefault(key(args), []).append(args)
        return True

    def remove(self, args: Args) -> Places:
        """Remove a tuple that is there; returns where it stood in each index."""
        del self.rows[args]
        places: Places = {}
        for positions, (key, table) in self._index.items():
            found = table[key(args)]
            places[positions] = found.index(args)
            del found[places[positions]]
        return places

    def put_back(self, args: Args, places: Places) -> None:
        """Undo `remove`, if everything else that was changed since has been undone: indices are as they were."""
        self.rows[args] = None
        for positions, (key, table) in self._index.items():
            found = table.setdefault(key(args), [])
            found.insert(places.get(positions, len(found)), args)

    def find(self, positions: tuple[int, ...], values: Args) -> list[Args]:
        """A new list of the tuples that have these values at these positions."""
        return list(self.index(positions).get(values, ())) if positions else list(self.rows)

    def index(self, positions: tuple[int, ...]) -> Mapping[Args, list[Args]]:
        """The tuples by their values at these positions; kept up to date."""
        if positions not in self._index:
            key, table = self._index[positions] = picked(positions), {}
            for row in self.rows:
                table.setdefault(key(row), []).append(row)
        return self._index[positions][1]

    def matches(self, pattern: tuple[str | None, ...]) -> list[Args]:
        """Tuples that agree with the pattern where it is not None."""
        positions = tuple(i for i, value in enumerate(pattern) if value is not None)
        return self.find(positions, tuple(value for value in pattern if value is not None))


EMPTY = Relation()


def match(pattern: Args, row: Args, binding: Mapping[str, str]) -> dict[str, str] | None:
    """The binding extended so that the pattern becomes the row; None when they differ."""
    extended = dict(binding)
    for arg, value in zip(pattern, row, strict=True):
        if (extended.setdefault(arg, value) if arg.startswith("?") else arg) != value:
            return None
    return extended


def bind(atom: Atom, binding: Mapping[str, str]) -> Args:
    """The atom's arguments with variables replaced."""
    return tuple([binding.get(a, a) for a in atom.args])
