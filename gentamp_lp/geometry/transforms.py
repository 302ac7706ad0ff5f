"""Poses as 4×4 float64 matrices (metres, radians) and their conversions."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Array:
    """Return the 4×4 pose at (x, y, z) turned by `yaw` about the vertical."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z], [0.0, 0.0, 0.0, 1.0]])


def inverse(matrix: Array) -> Array:
    """Return the inverse of a rigid 4×4 pose."""
    result = np.eye(4)
    rotation = matrix[:3, :3].T
    result[:3, :3] = rotation
    result[:3, 3] = -rotation @ matrix[:3, 3]
    return result


def quaternion(matrix: Array) -> Array:
    """Return the unit quaternion (x, y, z, w) of a pose, with the largest component positive."""
    m = matrix
    squares = np.array(  # four times the square of each component
        [
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
            1 + m[0, 0] + m[1, 1] + m[2, 2],
        ]
    )
    largest = int(np.argmax(squares))
    x, y, z, w = 0, 1, 2, 3
    products = {
        (x, y): m[0, 1] + m[1, 0],
        (x, z): m[0, 2] + m[2, 0],
        (y, z): m[1, 2] + m[2, 1],
        (x, w): m[2, 1] - m[1, 2],
        (y, w): m[0, 2] - m[2, 0],
        (z, w): m[1, 0] - m[0, 1],
    }
    values = [squares[i] if i == largest else products[(min(i, largest), max(i, largest))] for i in range(4)]
    result = np.array(values, dtype=np.float64)
    return result / np.linalg.norm(result)


def rotation(quaternions: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions (..., 4), ordered x, y, z, w."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    result = np.empty((*x.shape, 3, 3))
    result[..., 0, 0] = 1 - 2 * (y * y + z * z)
    result[..., 0, 1] = 2 * (x * y - z * w)
    result[..., 0, 2] = 2 * (x * z + y * w)
    result[..., 1, 0] = 2 * (x * y + z * w)
    result[..., 1, 1] = 1 - 2 * (x * x + z * z)
    result[..., 1, 2] = 2 * (y * z - x * w)
    result[..., 2, 0] = 2 * (x * z - y * w)
    result[..., 2, 1] = 2 * (y * z + x * w)
    result[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return result


def difference(first: Array, second: Array) -> tuple[float, float]:
    """Return how far two poses are apart: metres and radians."""
    sine = float(np.linalg.norm(first[:3, :3] - second[:3, :3])) / math.sqrt(8)  # of half the angle
    cosine = math.sqrt(max(0.0, 1.0 + float(np.vdot(first[:3, :3], second[:3, :3])))) / 2
    return float(np.linalg.norm(first[:3, 3] - second[:3, 3])), 2 * math.atan2(sine, cosine)
