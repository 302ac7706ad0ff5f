"""Sets of small numbers as the bits of one integer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt


def bits(mask: int) -> Iterator[int]:
    """Yield the positions of the ones in a mask, lowest first.

    >>> list(bits(0b10110))
    [1, 2, 4]
    """
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


def subsets(mask: int) -> Iterator[int]:
    """Yield every mask within a mask, itself first, the empty one last.

    >>> list(subsets(0b101))
    [5, 4, 1, 0]
    """
    part = mask
    yield part
    while part:
        part = (part - 1) & mask
        yield part


def minimal(sets: Iterable[int], limit: int | None = None) -> list[int]:
    """Return the inclusion-minimal masks, smallest first; only so many if a limit is given.

    >>> minimal([0b111, 0b011, 0b100])
    [4, 3]
    """
    kept: list[int] = []
    for candidate in sorted(set(sets), key=lambda mask: (mask.bit_count(), mask)):
        if len(kept) == limit:
            break
        if not any(mask & candidate == mask for mask in kept):
            kept.append(candidate)
    return kept


def hitting(sets: Iterable[int]) -> int:
    """Return a small mask that meets every given mask, inclusion-minimal among those that do."""
    left = minimal(sets)
    everything, chosen = left, 0
    while left:
        counts: dict[int, int] = {}
        for mask in left:
            for bit in bits(mask):
                counts[bit] = counts.get(bit, 0) + 1
        best = min(counts, key=lambda bit: (-counts[bit], bit))
        chosen |= 1 << best
        left = [mask for mask in left if not mask >> best & 1]
    for bit in bits(chosen):
        if all(mask & chosen & ~(1 << bit) for mask in everything):
            chosen &= ~(1 << bit)
    return chosen


def pack(rows: npt.NDArray[np.bool_]) -> list[int]:
    """Return one mask for each row of a matrix of truth values.

    >>> pack(np.array([[False, True, True], [True, False, False]]))
    [6, 1]
    """
    return [int.from_bytes(row.tobytes(), "little") for row in np.packbits(rows, axis=1, bitorder="little")]


def transpose(masks: Sequence[int], width: int) -> list[int]:
    """Return for each bit position below `width` the mask of the rows that have this bit.

    >>> transpose([0b110, 0b001], 3)
    [2, 1, 1]
    """
    size = (width + 7) // 8
    raw = b"".join(mask.to_bytes(size, "little") for mask in masks)
    table = np.frombuffer(raw, dtype=np.uint8).reshape(len(masks), size)
    rows = np.unpackbits(table, axis=1, bitorder="little", count=width)
    return pack(rows.T.astype(np.bool_))
