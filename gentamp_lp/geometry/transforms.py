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


def _products() -> Array:
    """The linear map (9, 16) from a rotation to four times the products of its quaternion's components, less eye(4)."""
    terms = np.zeros((3, 3, 4, 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        for row, sign in ((i, 1), (j, -1), (k, -1)):
            terms[row, row, i, i] = sign
        terms[i, i, 3, 3] = 1
        for one, other in ((i, j), (j, i)):
            terms[i, j, one, other] = terms[j, i, one, other] = 1
        for one, other in ((k, 3), (3, k)):
            terms[j, i, one, other], terms[i, j, one, other] = 1, -1
    return terms.reshape(9, 16)


_PRODUCTS = _products()


def quaternion(matrices: Array) -> Array:
    """Return the unit quaternions (..., 4), ordered x, y, z, w, of poses (..., 4, 4), largest component positive."""
    products = (matrices[..., :3, :3].reshape(-1, 9) @ _PRODUCTS).reshape(-1, 4, 4) + np.eye(4)
    largest = products[:, range(4), range(4)].argmax(axis=1)
    result = products[np.arange(len(products)), largest]
    result /= np.sqrt((result * result).sum(axis=1, keepdims=True))
    return np.asarray(result.reshape(*matrices.shape[:-2], 4))


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
