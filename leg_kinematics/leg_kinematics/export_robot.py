# SPDX-License-Identifier: Apache-2.0
"""Command that writes a robot as URDF or MJCF, with a description that reads it back."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError
from leg_kinematics.export.description import description_text
from leg_kinematics.export.mjcf import mjcf_text
from leg_kinematics.export.urdf import urdf_text
from leg_kinematics.robot import Robot

EXAMPLES = """\
examples:
  # the hexapod for viewers and planners: hexapod.urdf, and hexapod_urdf.yaml with its loops
  %(prog)s hexapod --urdf

  # the quadruped for MuJoCo, into a folder
  %(prog)s quadruped --mjcf --folder models
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(
        prog="export_robot",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("robot", help="robot description or its name")
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("--urdf", action="store_const", dest="write", const=write_urdf, help="URDF")
    kind.add_argument("--mjcf", action="store_const", dest="write", const=write_mjcf, help="MJCF")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to (default: here)")
    options = parser.parse_args(arguments)
    try:
        for path in options.write(load_robot(options.robot), options.folder):
            print(f"wrote {path}")
    except (LegError, OSError) as error:
        print(f"export_robot: {error}", file=sys.stderr)
        return 1
    return 0


def write_urdf(robot: Robot, folder: Path) -> tuple[Path, Path]:
    """Write a robot as URDF, and beside it the description that closes its loops.

    Args:
        robot: The robot.
        folder: Where to; it is made if need be.

    Returns:
        The paths of the URDF and of the description.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
        OSError: If the files cannot be written.
    """
    file = f"{robot.name}.urdf"
    description = description_text(robot, file, closures=True)
    return _written(folder, file, urdf_text(robot), f"{robot.name}_urdf.yaml", description)


def write_mjcf(robot: Robot, folder: Path) -> tuple[Path, Path]:
    """Write a robot as MJCF with its loops, and beside it a description of its legs.

    Args, returns and raises as `write_urdf`.
    """
    file = f"{robot.name}.xml"
    description = description_text(robot, file, closures=False)
    return _written(folder, file, mjcf_text(robot), f"{robot.name}_mjcf.yaml", description)


def _written(
    folder: Path, file: str, model: str, beside: str, description: str
) -> tuple[Path, Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = folder / file, folder / beside
    for path, text in zip(paths, (model, description), strict=True):
        path.write_text(text)
    return paths
