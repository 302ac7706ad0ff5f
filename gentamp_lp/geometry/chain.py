"""Kinematic chains read from URDF files: batched forward kinematics and a damped least-squares solver."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gentamp_lp.errors import InputError
from gentamp_lp.geometry.transforms import Array

SLIDING, TURNING = ("prismatic",), ("revolute", "continuous")


def frame(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return the 4×4 pose at `xyz` (m) with roll, pitch and yaw (rad)."""
    result = np.eye(4)
    result[:3, 3] = xyz
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    result[:3, :3] = about_z @ about_y @ about_x
    return result


def origin(element: ET.Element) -> Array:
    """Return the 4×4 pose of an element's `<origin>` (identity when it is missing)."""
    found = element.find("origin")
    if found is None:
        return np.eye(4)
    xyz, rpy = ([float(v) for v in found.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return frame(xyz, rpy)


def _axis(joint: ET.Element) -> Array:
    """Return the unit axis (3,) of a joint."""
    found = joint.find("axis")
    axis = np.array([float(v) for v in (found.attrib["xyz"] if found is not None else "1 0 0").split()])
    return np.asarray(axis / np.linalg.norm(axis))


def motion(joint: ET.Element, value: float) -> Array:
    """Return the 4×4 pose of a joint's child at a value (rad, m), seen from where it is at 0."""
    result = np.eye(4)
    if value and joint.get("type") in SLIDING:
        result[:3, 3] = value * _axis(joint)
    elif value and joint.get("type") in TURNING:
        skew = _skew(_axis(joint))
        result[:3, :3] += np.sin(value) * skew + (1 - np.cos(value)) * skew @ skew
    return result


def _skew(axis: Array) -> Array:
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def link_of(joint: ET.Element, role: str) -> str:
    """Return the name of the parent or the child of a joint. Raises InputError when it has none."""
    element = joint.find(role)
    if element is None:
        raise InputError(f"joint {joint.get('name')} has no {role}")
    return element.attrib["link"]


def _limits(joint: ET.Element) -> tuple[float, float]:
    """Return the soft limits of a joint where given, else the hard ones, else none."""
    soft, hard = joint.find("safety_controller"), joint.find("limit")
    if soft is not None and "soft_lower_limit" in soft.attrib:
        return float(soft.attrib["soft_lower_limit"]), float(soft.attrib["soft_upper_limit"])
    if hard is not None and joint.get("type") != "continuous":
        return float(hard.get("lower", "-inf")), float(hard.get("upper", "inf"))
    return -np.inf, np.inf


@dataclass(frozen=True, eq=False)
class Chain:
    """Revolute and prismatic joints in series, `dof` of them; `links[i]` is moved by joint i.

    The pose of link i in link i-1 is `base[i] + sin(q) * sine[i] + (1 - cos(q)) * versine[i] + q * slide[i]` (4×4
    each); `tip` is the pose of the tool in the last link. `lower` and `upper` are the soft limits (rad, m).
    """

    joints: tuple[str, ...]
    links: tuple[str, ...]
    base: Array
    sine: Array
    versine: Array
    slide: Array
    axes: Array
    tip: Array
    lower: Array
    upper: Array

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.links)

    def frames(self, configurations: Array) -> Array:
        """Return the poses (n, dof, 4, 4) of all links for configurations (n, dof)."""
        sine = np.sin(configurations)[..., None, None]
        versine = 1 - np.cos(configurations)[..., None, None]
        local = self.base + sine * self.sine + versine * self.versine
        if self.slide.any():
            local += configurations[..., None, None] * self.slide
        result = np.empty_like(local)
        result[:, 0] = local[:, 0]
        for i in range(1, self.dof):
            np.matmul(result[:, i - 1], local[:, i], out=result[:, i])
        return result

    def tool(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) for configurations (n, dof)."""
        return np.asarray(self.frames(configurations)[:, -1] @ self.tip)

    def within(self, configurations: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Tell for each of the configurations (..., dof) whether it keeps the soft limits."""
        return np.asarray(((configurations >= self.lower) & (configurations <= self.upper)).all(axis=-1))

    def residual(self, frames: Array, targets: Array) -> tuple[Array, Array]:
        """Return tool poses (n, 4, 4) and the twist (n, 6: m, rad) from them to the targets."""
        tools = frames[:, -1] @ self.tip
        turn = targets[:, :3, :3] @ tools[:, :3, :3].transpose(0, 2, 1)
        skew = turn - turn.transpose(0, 2, 1)
        vector = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        sine = np.linalg.norm(vector, axis=1) / 2
        cosine = (turn[:, 0, 0] + turn[:, 1, 1] + turn[:, 2, 2] - 1) / 2
        angle = np.arctan2(sine, cosine)
        scale = np.where(sine > 1e-9, angle / np.maximum(2 * sine, 1e-12), 0.5)
        return tools, np.concatenate([targets[:, :3, 3] - tools[:, :3, 3], vector * scale[:, None]], axis=1)

    def solve(
        self, targets: Array, start: Array, *, iterations: int, tolerance: float = 1e-6
    ) -> tuple[Array, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]]:
        """Polish configurations (n, dof) towards tool poses (n, 4, 4) by damped least squares.

        Returns the configurations and whether each one's residual (m and rad together) is within `tolerance`.
        """
        values = start.copy()
        for step in range(iterations + 1):
            frames = self.frames(values)
            tools, twist = self.residual(frames, targets)
            error = np.sqrt((twist * twist).sum(axis=1))
            if step == iterations or (error <= tolerance).all():
                break
            axes = np.einsum("nlij,lj->nli", frames[:, :, :3, :3], self.axes)
            arms = tools[:, None, :3, 3] - frames[:, :, :3, 3]
            jacobian = np.concatenate([_cross(axes, arms), axes], axis=2)  # (n, dof, 6), transposed
            for joint in np.flatnonzero(self.slide.any(axis=(1, 2))):
                jacobian[:, joint, :3], jacobian[:, joint, 3:] = axes[:, joint], 0.0
            damping = np.minimum(1e-2, 1e-2 * error**2 + 1e-9)
            gram = jacobian.transpose(0, 2, 1) @ jacobian + damping[:, None, None] * np.eye(6)
            change = (jacobian @ np.linalg.solve(gram, twist[:, :, None]))[:, :, 0]
            largest = np.abs(change).max(axis=1, keepdims=True)
            values += change * np.minimum(1.0, 0.5 / np.maximum(largest, 1e-12))
        return values, error <= tolerance


def _cross(first: Array, second: Array) -> Array:
    """Return the cross product of (n, l, 3) arrays; several times faster than numpy.cross on small ones."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def read_chain(
    urdf: Path,
    tip: str,
    *,
    start: Array | None = None,
    tool: Array | None = None,
    held: Mapping[str, float] | None = None,
) -> Chain:
    """Return the chain from the root of a URDF to the link `tip`.

    The root stands at `start` and the tool at `tool` in the tip's frame (4×4, identity if not given). Fixed joints are
    folded in, and so are those `held` at a value. Raises InputError when the link is missing or a joint neither turns
    nor slides.
    """
    joints = {link_of(j, "child"): j for j in ET.parse(urdf).getroot().iter("joint") if j.find("child") is not None}
    if tip not in joints:
        raise InputError(f"{urdf}: no link {tip}")
    series: list[tuple[str, ET.Element]] = []
    link = tip
    while link in joints:
        series.append((link, joints[link]))
        link = link_of(joints[link], "parent")
    names, links, bases, axes, sliding, limits = [], [], [], [], [], []
    pending = np.eye(4) if start is None else start
    for link, joint in reversed(series):
        pending = pending @ origin(joint)
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind == "fixed" or name in (held or {}):
            pending = pending @ motion(joint, (held or {}).get(name, 0.0))
            continue
        if kind not in SLIDING + TURNING:
            raise InputError(f"{urdf}: joint {name} neither turns nor slides")
        names.append(name)
        links.append(link)
        bases.append(pending)
        axes.append(_axis(joint))
        sliding.append(kind in SLIDING)
        limits.append(_limits(joint))
        pending = np.eye(4)
    base, lower, upper = np.array(bases), *np.array(limits).T
    skew, slide = np.zeros((2, len(links), 4, 4))
    for i, axis in enumerate(axes):
        if sliding[i]:
            slide[i, :3, 3] = axis
        else:
            skew[i, :3, :3] = _skew(axis)
    return Chain(
        tuple(names), tuple(links), base, base @ skew, base @ skew @ skew, base @ slide, np.array(axes),
        pending if tool is None else pending @ tool, lower, upper,
    )  # fmt: skip
