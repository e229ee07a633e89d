# SPDX-License-Identifier: Apache-2.0
"""Command that draws a leg's index maps, friction, step lengths, load capacity and linkage."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure
from tqdm import tqdm

from leg_kinematics.description import load_leg_types, load_robot
from leg_kinematics.errors import LegError, UnknownNameError, ValueRangeError
from leg_kinematics.robot import Leg
from leg_statics.commands.command_line import ArgumentParser, print_on_any_terminal
from leg_statics.commands.leg_pictures import (
    MAP_RESOLUTION,
    capacity_picture,
    friction_picture,
    index_picture,
    linkage_picture,
    steps_picture,
)
from leg_statics.drawing.style import FORMATS, write_figure
from leg_statics.grounds import Ground, load_grounds
from leg_statics.indices import find_index, supported_indices
from leg_statics.workspace import is_spatial_leg

EXAMPLES = """\
examples:
  # the condition number of the right front leg at heights of your choice
  %(prog)s --robot hexapod --leg right_front --index condition_number --heights -0.7 -0.6 -0.5

  # figure 5a of the paper, for its leg before the optimisation
  %(prog)s --robot hexapod --type initial --figure 5a --output figure_5a.svg

  # rated friction before and after the optimisation
  %(prog)s --robot hexapod --figure 8

  # the whole set of one leg
  %(prog)s --robot my_robot.yaml --leg front --all pictures
"""

# Legs that figure 8 compares, if the robot has these types.
COMPARED_TYPES = ("initial", "optimised")
# Indices that the figures of paper 000 show.
FIGURE_INDICES = {
    "2": "condition_number",
    "5a": "unit_effort_capacity",
    "5b": "rated_friction",
    "5c": "unit_moment_effort",
    "6a": "constraint_force",
    "6b": "constraint_moment",
}


class Request(NamedTuple):
    """What to draw.

    Attributes:
        robot: Name of the robot.
        legs: The leg, or several to compare in figure 8.
        grounds: The grounds.
        heights: Heights of the foot in the leg frame [m]; none for those that suit the leg.
        resolution: Grid spacing of maps [m].
        load: Normal load that a step has to bear [N].
        friction: Friction coefficient of the cone in the picture of the linkage.
    """

    robot: str
    legs: Sequence[Leg]
    grounds: Sequence[Ground]
    heights: Sequence[float]
    resolution: float
    load: float
    friction: float

    @property
    def leg(self) -> Leg:
        """The one leg to draw."""
        if len(self.legs) > 1:
            names = ", ".join(leg.name for leg in self.legs)
            raise ValueRangeError(f"only figure 8 compares several types, got {names}")
        return self.legs[0]

    @property
    def title(self) -> str:
        """Robot, leg and type."""
        leg = self.leg
        own_name = leg.leg_type == leg.name
        return f"{self.robot} {leg.name}" + ("" if own_name else f" ({leg.leg_type})")

    @property
    def height(self) -> float | None:
        """The one height that is given, or None."""
        if len(self.heights) > 1:
            raise ValueRangeError(f"this figure takes one height, got {len(self.heights)}")
        return self.heights[0] if self.heights else None


def _index(request: Request, index: str) -> Figure:
    return index_picture(
        request.leg, index, request.heights, request.resolution, title=request.title
    )


def _rated_friction(request: Request) -> Figure:
    mechanisms = {leg.name: leg.mechanism for leg in request.legs}
    return friction_picture(mechanisms, request.grounds, request.heights, title=request.robot)


def _steps(request: Request) -> Figure:
    return steps_picture(
        request.leg, request.grounds, request.load, request.heights, title=request.title
    )


def _capacity(request: Request) -> Figure:
    return capacity_picture(
        request.leg, request.grounds, request.height, request.resolution, title=request.title
    )


def _linkage(request: Request) -> Figure:
    friction = request.friction if is_spatial_leg(request.leg.mechanism) else None
    return linkage_picture(request.leg, friction, title=request.title)


FIGURES: dict[str, Callable[[Request], Figure]] = {
    **{name: partial(_index, index=index) for name, index in FIGURE_INDICES.items()},
    "8": _rated_friction,
    "steps": _steps,
    "capacity": _capacity,
    "linkage": _linkage,
}


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = ArgumentParser(
        prog="plot_index_map",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    what = parser.add_argument_group("what to draw (one of)").add_mutually_exclusive_group(
        required=True
    )
    what.add_argument("--index", metavar="NAME", help="map of an index, such as condition_number")
    what.add_argument(
        "--figure",
        metavar="FIGURE",
        help="a figure of Zhang, Jin, Zhang 2017 (2: k, 5a: eta_cF, 5b: mu_e, 5c: eta_cM, "
        "6a: k_cf, 6b: k_cm, 8: mu_e along x), or steps (step length against height), capacity "
        "(load capacity on every ground), linkage (side and front view)",
    )
    what.add_argument("--all", metavar="DIR", help="every figure that the leg has, into a folder")

    leg = parser.add_argument_group("of which leg")
    leg.add_argument(
        "--robot", default="hexapod", help="shipped robot or YAML file (default: %(default)s)"
    )
    which = leg.add_mutually_exclusive_group()
    which.add_argument("--leg", default="", metavar="NAME", help="default: the robot's first leg")
    which.add_argument(
        "--type",
        nargs="+",
        default=[],
        metavar="TYPE",
        help="a leg type of the robot instead of a leg; figure 8 compares several "
        f"(default there: {' and '.join(COMPARED_TYPES)}, if the robot has them)",
    )

    how = parser.add_argument_group("how")
    how.add_argument(
        "--heights",
        nargs="+",
        type=float,
        default=[],
        metavar="Z",
        help="heights of the foot in the leg frame [m], negative below the hip (default: maps, "
        "six over the workspace; steps, all; figure 8 and capacity, that of the initial posture)",
    )
    how.add_argument(
        "--resolution",
        type=float,
        default=MAP_RESOLUTION,
        metavar="D",
        help="grid spacing of maps [m] (default: %(default)s)",
    )
    how.add_argument(
        "--load",
        type=float,
        default=600.0,
        metavar="F",
        help="normal load that a step must bear [N] (default: %(default)s)",
    )
    how.add_argument(
        "--friction",
        type=float,
        default=0.4,
        metavar="MU",
        help="friction cone in the picture of the linkage (default: %(default)s, cement)",
    )
    how.add_argument(
        "--grounds", default="grounds", metavar="FILE", help="grounds file (default: the shipped)"
    )

    where = parser.add_argument_group("where to")
    where.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help=f"picture to write, as {', '.join(FORMATS)} (default: ROBOT_LEG_FIGURE.png)",
    )
    where.add_argument(
        "--format", choices=FORMATS, default="png", help="of --all (default: %(default)s)"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw what the command line asks for and print the names of the files.

    Returns:
        0. Mistakes end with exit code 2 and a message that names what is allowed.
    """
    parser = make_parser()
    options = parser.parse_args(arguments)
    print_on_any_terminal()
    try:
        for path in _run(options):
            print(path)
    except (LegError, OSError) as error:
        parser.error(str(error))
    return 0


def _run(options: argparse.Namespace) -> list[Path]:
    """Draw and write the pictures; return their files."""
    if options.figure is not None and options.figure not in FIGURES:
        raise UnknownNameError("figure", options.figure, FIGURES)
    if options.index is not None:
        find_index(options.index)
    if options.output is not None:
        if options.all is not None:
            raise ValueRangeError("--all takes no --output; its argument is the folder")
        _check_output(options.output)
    request = _request(options)
    compared = request
    types = load_leg_types(options.robot)
    if not options.leg and not options.type and set(COMPARED_TYPES) <= set(types):
        compared = request._replace(legs=[types[name] for name in COMPARED_TYPES])
    if options.all is not None:
        return _draw_all(request, compared, Path(options.all), options.format)
    if options.index is not None:
        figure = _index(request, options.index)
        return [write_figure(figure, options.output or _file(request, options.index))]
    subject = compared if options.figure == "8" else request
    figure = FIGURES[options.figure](subject)
    return [write_figure(figure, options.output or _file(subject, options.figure))]


def _request(options: argparse.Namespace) -> Request:
    """Load the legs, the first one if none is named, and the grounds."""
    robot = load_robot(options.robot)
    if options.type:
        types = load_leg_types(options.robot)
        for name in options.type:
            if name not in types:
                raise UnknownNameError("leg type", name, types)
        legs = [types[name] for name in options.type]
    else:
        legs = [robot.leg(options.leg or next(iter(robot.legs)))]
    return Request(
        robot.name,
        legs,
        list(load_grounds(options.grounds).by_name.values()),
        options.heights,
        options.resolution,
        options.load,
        options.friction,
    )


def _draw_all(request: Request, compared: Request, folder: Path, suffix: str) -> list[Path]:
    """Draw every figure that the leg has."""
    if request.heights:
        raise ValueRangeError("--all takes no --heights: its figures need different ones")
    names = ["linkage"]
    if is_spatial_leg(request.leg.mechanism):
        supported = supported_indices(request.leg.mechanism)
        names = [name for name in FIGURES if FIGURE_INDICES.get(name, supported[0]) in supported]
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name in tqdm(names, desc="drawing", unit="figure", disable=None, leave=False):
        subject = compared if name == "8" else request
        figure = FIGURES[name](subject)
        paths.append(write_figure(figure, folder / _file(subject, name, suffix)))
    return paths


def _file(request: Request, name: str, suffix: str = "png") -> Path:
    """Return the name of a picture's file."""
    return Path("_".join([request.robot, *(leg.name for leg in request.legs), f"{name}.{suffix}"]))


def _check_output(path: Path) -> None:
    """Raise if a picture cannot be written there, before any work is done."""
    suffix = path.suffix.lstrip(".").lower()
    if suffix not in FORMATS:
        raise UnknownNameError("picture format", suffix, FORMATS)
    if not path.parent.is_dir():
        raise ValueRangeError(f"folder {path.parent} does not exist")


if __name__ == "__main__":
    sys.exit(main())
