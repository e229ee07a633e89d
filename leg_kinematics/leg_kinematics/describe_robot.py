# SPDX-License-Identifier: Apache-2.0
"""Command that tells what a robot is made of, and makes a robot description of a model file."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.description import load_robot
from leg_kinematics.documents import Document
from leg_kinematics.errors import DescriptionError, LegError
from leg_kinematics.files import existing_path
from leg_kinematics.mechanism import Joint, Mechanism
from leg_kinematics.model.reading import read_model
from leg_kinematics.model.tree import ModelTree
from leg_kinematics.model_description import ModelDescription
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status

SAMPLES = 2000  # postures that tell how far a leg reaches
FOOT_NAME = re.compile(r"[._-]?(foot|toe)[._-]?", re.IGNORECASE)
SI = {"length": 1.0, "angle": 1.0, "ratio": 1.0}
EXAMPLES = """\
examples:
  # what a shipped robot is made of
  %(prog)s solo12

  # my URDF to a robot description, then to a map of what its first leg carries
  %(prog)s my_robot.urdf --foot lf_foot rf_foot --write my_robot.yaml
  ros2 run leg_statics plot_index_map --robot my_robot.yaml --all pictures
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="describe_robot",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", help="robot description or its name, or a URDF, xacro or MJCF file")
    parser.add_argument("--base", help="link that carries the legs (default: the model's first)")
    parser.add_argument("--foot", nargs="+", help="links that stand on the ground")
    parser.add_argument("--write", type=Path, help="robot description to make of a model file")
    options = parser.parse_args(arguments)
    try:
        if not is_model(options.file):
            if options.write or options.base or options.foot:
                raise DescriptionError("--write, --base and --foot are for model files")
            print(robot_text(options.file))
            return 0
        path = existing_path("model", options.file)
        text = description_of_model(path, options.base, options.foot, options.write)
        if options.write:
            options.write.write_text(text)
            print(f"wrote {options.write}")
        print("\n".join(_model_lines(Document(options.write or path, text), path)))
    except (LegError, OSError) as error:
        print(f"describe_robot: {error}", file=sys.stderr)
        return 1
    return 0


def is_model(file: str) -> bool:
    """Tell whether a file is a model, by its name."""
    return Path(file).suffix in (".urdf", ".xacro", ".xml", ".mjcf")


def robot_text(source: str) -> str:
    """Return what a robot is made of, for people to read.

    Raises:
        DescriptionError: If there is no such robot or its description is wrong.
    """
    robot = load_robot(source)
    lines = [f"{robot.name}: {len(robot.legs)} leg(s) on {robot.base_frame}"]
    for leg in robot.legs.values():
        lines += ["", *leg_lines(leg)]
    return "\n".join(lines)


def leg_lines(leg: Leg) -> Iterator[str]:
    """Yield the lines that tell what a leg is made of."""
    yield f"{leg.name}: {leg.mechanism.name}, on {_numbers(leg.mount.position)} m"
    yield from mechanism_lines(leg.mechanism, leg.joint_names, leg.effort_limits)


def mechanism_lines(mechanism: Mechanism, names: Sequence[str], efforts: Any) -> Iterator[str]:
    """Yield the lines that tell what a mechanism is made of.

    Args:
        mechanism: The mechanism.
        names: Names of its actuated joints in the robot.
        efforts: Least and most effort of each (n, 2); NaN if not known.
    """
    yield "  actuated joint            type       range                   effort"
    rows = zip(mechanism.joints, names, mechanism.joint_limits, efforts, strict=True)
    for joint, name, limits, effort in rows:
        force = f"{_range(effort)} {joint.effort_unit}" if np.isfinite(effort).any() else "missing"
        yield f"  {name:<25} {joint.type:<10} {_range(limits) + ' ' + joint.unit:<23} {force}"
    for joint in mechanism.passive_joints:
        yield f"  {joint.name:<25} {joint.type:<10} passive"
    posture = mechanism.initial_posture
    yield f"  assembly modes: {', '.join(mechanism.assembly_modes)}"
    yield f"  initial posture: {_posture(mechanism.joints, posture.joint_positions)}"
    yield f"  foot there: {_numbers(posture.foot_position[:3])} m from the leg frame"
    yield f"  reach: {_reach(mechanism)}"
    if mechanism.has_masses:
        yield f"  mass: {getattr(mechanism, 'mass', np.nan):.4g} kg; its weight counts"
    else:
        yield "  mass: not known; its weight does not count"


def description_of_model(
    path: Path, base: str | None, feet: Sequence[str] | None, written: Path | None
) -> str:
    """Return a robot description, with comments, of a model file.

    Args:
        path: The model file.
        base: Link that carries the legs; None for the first of the model.
        feet: Links that stand on the ground; None for those called foot or toe.
        written: Where the description will be; None for beside the model.

    Raises:
        DescriptionError: If the model is wrong or no link is a foot.
    """
    tree = read_model(path)
    carrier = base or tree.root
    found = list(feet or _feet(tree))
    if not found:
        ends = [name for name in tree.links if name not in {j.parent for j in tree.joints.values()}]
        raise DescriptionError(
            f"{path}: no link is called foot or toe; name the feet with --foot, such as: "
            f"{', '.join(ends)}"
        )
    file = path.resolve() if written else Path(path.name)
    name = re.sub(r"\W", "_", tree.name) or "robot"
    lines = [
        f"# Made by describe_robot from {path.name}: a start, to be changed.",
        f"name: {name if name[0].isalpha() else f'robot_{name}'}",
        f"base_frame: {re.sub(r'[^A-Za-z0-9_]', '_', carrier)}             # REP-103",
        "",
        "model:",
        f"  file: {file}",
        f"  base: {carrier}",
        "  # joint_limits: {a_joint: [-1.0, 1.0]}     # in place of the file's [rad or m]",
        "  # effort_limits: {a_joint: 40}             # the same [N.m or N]",
        "  # masses: {a_link: 0.3}                    # the same [kg]",
        "",
        "legs:",
    ]
    for foot in found:
        lines += [f"  {_leg_name(foot)}:", f"    foot: {foot}"]
    return "\n".join(lines) + "\n"


def _model_lines(document: Document, path: Path) -> Iterator[str]:
    """Yield what a model's legs are made of, and what they lack."""
    description = ModelDescription(document, SI)
    yield f"{path.name}: {len(description.tree.links)} links, legs on {description.base}"
    for name in document.root["legs"]:
        mechanism, chain = description.mechanism(name)
        known = {joint.name: joint.effort or (np.nan, np.nan) for joint in chain.joints}
        efforts = [known[joint] for joint in mechanism.actuated]
        yield ""
        yield f"{name}: {mechanism.name}, on {_numbers(chain.origin)} m"
        yield from mechanism_lines(mechanism, mechanism.actuated, efforts)
        missing = [j for j, e in zip(mechanism.actuated, efforts, strict=True) if np.isnan(e).any()]
        if missing:
            yield f"  for load capacity, give model.effort_limits of: {', '.join(missing)}"


def _feet(tree: ModelTree) -> list[str]:
    carriers = {joint.parent for joint in tree.joints.values()}
    return [n for n in tree.links if FOOT_NAME.search(n) and n not in carriers]


def _leg_name(foot: str) -> str:
    name = re.sub(r"\W", "_", FOOT_NAME.sub("", foot)) or foot
    return name if name[0].isalpha() else f"leg_{name}"


def _reach(mechanism: Mechanism) -> str:
    lower, upper = np.clip(mechanism.joint_limits, -np.pi, np.pi).T
    q = np.random.default_rng(0).uniform(lower, upper, (SAMPLES, len(lower)))
    posture = mechanism.forward(q)
    foot = posture.foot_position[posture.status == Status.OK][:, :3]
    if not len(foot):
        return "nothing within the limits"
    ends = np.stack([foot.min(axis=0), foot.max(axis=0)], axis=1)
    return (
        ", ".join(f"{axis} {_range(pair)}" for axis, pair in zip("xyz", ends, strict=True)) + " m"
    )


def _range(pair: Any) -> str:
    return f"{pair[0]:.4g} .. {pair[1]:.4g}"


def _numbers(values: Any) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"


def _posture(joints: Sequence[Joint], positions: Any) -> str:
    pairs = zip(joints, positions, strict=True)
    return ", ".join(f"{joint.name} {value:.4g} {joint.unit}" for joint, value in pairs)
