"""Robots by name."""

from __future__ import annotations

from pathlib import Path

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.geometry.arm import Arm
from gentamp_lp.geometry.description import FOLDER, Box, Drive, load_description
from gentamp_lp.geometry.gripper import Gripper
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.robots import Robot


def robot_names() -> list[str]:
    """The robots that need no file of the user's."""
    return ["gripper", "mobile_gripper", *sorted(path.stem for path in FOLDER.glob("*.yaml"))]


def make_robot(name: str) -> Robot:
    """Return a robot: `gripper`, a free-flying hand, `mobile_gripper`, one above a platform that drives, or a
    described one by its name or the path of its YAML file. Raises InputError.
    """
    match name:
        case "gripper":
            return Gripper()
        case "mobile_gripper":
            platform = Box(lower=(-0.20, -0.20, -0.65), upper=(0.20, 0.20, -0.02))
            return Mobile(name, Gripper(furthest=0.8), Drive(stance=0.30, platform=platform))
    path = FOLDER / f"{name}.yaml"
    if not path.is_file():
        path = Path(name)
    if path.suffix != ".yaml" or not path.is_file():
        hint = f"known robots: {', '.join(robot_names())}; or give the path of a description (.yaml)"
        raise InputError(Diagnostic(f"unknown robot {name!r}", hint=hint))
    description = load_description(path)
    arm = Arm(name, description)
    return arm if description.base is None else Mobile(name, arm, description.base)
