# SPDX-License-Identifier: Apache-2.0
"""Writes the robot description of a model file that was written of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from leg_kinematics.export.named_legs import UNLIMITED, NamedLeg, Site, named_legs
from leg_kinematics.robot import Robot


def description_text(robot: Robot, file: str, *, closures: bool) -> str:
    """Return a description, in YAML, of the model file of a robot.

    Args:
        robot: The robot.
        file: Name of the model file, beside which the description will be.
        closures: Whether to tell the closures of the loops, which MJCF brings itself.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
    """
    legs = named_legs(robot)
    actuated = [name for leg in legs for name in leg.leg.joint_names]
    efforts = {n: np.clip(e, -UNLIMITED, UNLIMITED) for leg in legs for n, e in leg.efforts.items()}
    lines = [
        f"# Made by export_robot of the robot {robot.name}.",
        f"name: {robot.name}",
        f"base_frame: {robot.base_frame}",
        *_body(robot),
        "",
        "model:",
        f"  file: {file}",
        f"  base: {robot.base_frame}",
        f"  actuated: [{', '.join(actuated)}]",
        "  effort_limits:",
        *(f"    {name}: {_row(effort)}" for name, effort in efforts.items()),
    ]
    pairs = [pair for leg in legs for pair in leg.closures]
    if closures and pairs:
        lines += ["  closures:", *(f"    - {_closure(*pair)}" for pair in pairs)]
    lines.append("legs:")
    for leg in legs:
        lines += _leg(leg)
    return "\n".join(lines) + "\n"


def _body(robot: Robot) -> Iterable[str]:
    if robot.body is not None:
        mass, center = robot.body
        yield f"body: {{mass: {_number(mass)}, center_of_mass: {_row(center)}}}"


def _leg(leg: NamedLeg) -> Iterable[str]:
    yield f"  {leg.leg.name}:"
    yield f"    foot: {leg.foot}"
    yield f"    frame: {leg.leg.name}_first_joint    # where the leg's way to the foot begins"
    yield "    assembly:"
    for mode, positions in leg.assembly.items():
        yield f"      {mode}: {_mapping(positions)}"


def _closure(first: Site, second: Site) -> str:
    ends = [f"{{link: {end.link}, point: {_row(end.point)}}}" for end in (first, second)]
    return f"{{first: {ends[0]}, second: {ends[1]}}}"


def _mapping(values: Mapping[str, float]) -> str:
    return f"{{{', '.join(f'{name}: {_number(value)}' for name, value in values.items())}}}"


def _row(values: Iterable[float]) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _number(value: float) -> str:
    """Return the shortest number that is read back as the same."""
    return repr(float(value))
