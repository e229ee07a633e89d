"""Command that draws a leg's index maps, friction, step lengths, load capacity and linkage."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from tqdm import tqdm

from leg_kinematics.description import find_robot_file, robot_from_document
from leg_kinematics.documents import Document
from leg_kinematics.errors import LegError, NotSupportedError, UnknownNameError, ValueRangeError
from leg_kinematics.mechanisms.parallel_drive import ParallelDrive
from leg_kinematics.robot import Leg
from leg_statics.commands.command_line import ArgumentParser
from leg_statics.drawing import plots
from leg_statics.global_means import means_on_grid
from leg_statics.grounds import Ground, load_grounds
from leg_statics.indices import find_index, supported_indices
from leg_statics.maps import workspace_bounds
from leg_statics.published import paper_000

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

FORMATS = ("png", "svg", "pdf")
RESOLUTION = 300  # dots per inch
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
        grounds: Grounds by name.
        heights: Heights of the foot in the leg frame [m]; none for those that suit the leg.
        resolution: Grid spacing of maps [m].
        load: Normal load that a step has to bear [N].
        friction: Friction coefficient of the cone in the picture of the linkage.
    """

    robot: str
    legs: Sequence[Leg]
    grounds: Mapping[str, Ground]
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
        return _title(self.robot, self.leg)

    @property
    def frictions(self) -> dict[str, float]:
        """Friction to count on by ground, the smoothest first."""
        grounds = sorted(self.grounds.values(), key=lambda ground: ground.friction_low)
        return {ground.name: ground.friction_low for ground in grounds}

    @property
    def height(self) -> float | None:
        """The one height that is given, or None."""
        if len(self.heights) > 1:
            raise ValueRangeError(f"this figure takes one height, got {len(self.heights)}")
        return self.heights[0] if self.heights else None


# --------------------------------------------------------------------------- figures


def draw_index(request: Request, index: str) -> Figure:
    """Draw an index at several heights."""
    leg = request.leg
    supported = supported_indices(leg.mechanism)
    if plots.is_spatial_leg(leg.mechanism) and find_index(index).name not in supported:
        raise NotSupportedError(
            f"mechanism {leg.mechanism.name!r} has no index {index!r}; "
            f"it has: {', '.join(supported)}"
        )
    _check_heights(leg, request.heights)
    return plots.plot_index(
        leg.mechanism, index, request.heights, request.resolution, title=request.title
    )


def draw_rated_friction(request: Request) -> Figure:
    """Draw figure 8."""
    return plots.plot_rated_friction(
        {leg.name: leg.mechanism for leg in request.legs},
        list(request.grounds.values()),
        request.heights,
        title=request.robot,
    )


def draw_steps(request: Request) -> Figure:
    """Draw step length against height."""
    leg = request.leg
    _check_heights(leg, request.heights)
    return plots.plot_step_lengths(
        leg.mechanism,
        leg.effort_limits,
        request.frictions,
        request.load,
        request.heights or None,
        title=request.title,
    )


def draw_capacity(request: Request) -> Figure:
    """Draw the load capacity on every ground."""
    leg = request.leg
    _check_heights(leg, request.heights)
    return plots.plot_load_capacity(
        leg.mechanism,
        leg.effort_limits,
        request.frictions,
        request.height,
        request.resolution,
        title=request.title,
    )


def draw_linkage(request: Request) -> Figure:
    """Draw the leg in its initial posture."""
    leg = request.leg
    if not plots.is_spatial_leg(leg.mechanism):
        return plots.plot_linkage(leg.mechanism, title=request.title)
    return plots.plot_linkage(
        leg.mechanism, leg.effort_limits, request.friction, title=request.title
    )


def draw_designs(request: Request) -> Figure:
    """Draw figure 7: global means of the paper's 847 designs, about the dimensions of the leg."""
    leg = request.leg.geometry
    if not isinstance(leg, ParallelDrive):
        raise NotSupportedError(
            f"figure 7 varies the dimensions of {ParallelDrive.name!r}, got {leg.name!r}"
        )
    bar = partial(tqdm, desc="designs", unit="design", disable=None, leave=False)
    _, means = paper_000.sampled_designs(leg, progress=bar)
    optimum = {name: [value] for name, value in paper_000.OPTIMISED_LENGTHS.items()}
    marked = {
        request.leg.leg_type: means_on_grid(
            leg, plots.DESIGN_MEANS, paper_000.PROTOCOL_GRID
        ).values,
        "paper's optimum": paper_000.sampled_designs(leg, optimum)[1][0],
    }
    return plots.plot_designs(means, marked, title=request.title)


def _index_figure(index: str) -> Callable[[Request], Figure]:
    return lambda request: draw_index(request, index)


FIGURES: dict[str, Callable[[Request], Figure]] = {
    **{name: _index_figure(index) for name, index in FIGURE_INDICES.items()},
    "7": draw_designs,
    "8": draw_rated_friction,
    "steps": draw_steps,
    "capacity": draw_capacity,
    "linkage": draw_linkage,
}


SLOW_FIGURES = ("7",)  # drawn on request only


def _title(robot: str, leg: Leg) -> str:
    return f"{robot} {leg.name}" + (f" ({leg.leg_type})" if leg.leg_type != leg.name else "")


def _check_heights(leg: Leg, heights: Sequence[float]) -> None:
    """Raise a ValueRangeError for a height at which the leg reaches nothing."""
    if not heights:
        return
    lower, upper = workspace_bounds(leg.mechanism)[2]
    for height in heights:
        if not lower <= height <= upper:
            raise ValueRangeError(
                f"height {height:g} m is outside the workspace of {leg.name}: "
                f"{lower:.3f} to {upper:.3f} m"
            )


# --------------------------------------------------------------------------- legs


def load_legs(
    source: str, leg: str = "", types: Sequence[str] = ()
) -> tuple[str, dict[str, Leg], list[Leg]]:
    """Load the legs to draw.

    Args:
        source: Name or path of the robot description.
        leg: Name of a leg; "" for the first one.
        types: Names of leg types, to draw them as such instead of a leg.

    Returns:
        The robot's name, a leg of every type by the type's name, and the legs chosen.

    Raises:
        DescriptionError: If the description is missing or wrong.
        UnknownNameError: If there is no such leg or type.
    """
    document = Document(find_robot_file(source))
    robot = robot_from_document(document)
    names = list(document.root["leg_types"])
    mount = {"position": [0.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]}
    document.root["legs"] = {name: {"type": name, "mount": mount} for name in names}
    by_type = dict(robot_from_document(document).legs)
    for name in types:
        if name not in by_type:
            raise UnknownNameError("leg type", name, by_type)
    if types:
        return robot.name, by_type, [by_type[name] for name in types]
    return robot.name, by_type, [robot.leg(leg or next(iter(robot.legs)))]


# --------------------------------------------------------------------------- command


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
        "6a: k_cf, 6b: k_cm, 8: mu_e along y), or steps (step length against height), capacity "
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
        default=0.005,
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
    robot, by_type, legs = load_legs(options.robot, options.leg, options.type)
    request = Request(
        robot,
        legs,
        load_grounds(options.grounds).by_name,
        options.heights,
        options.resolution,
        options.load,
        options.friction,
    )
    compared = request
    if not options.leg and not options.type and set(COMPARED_TYPES) <= set(by_type):
        compared = request._replace(legs=[by_type[name] for name in COMPARED_TYPES])
    if options.all is not None:
        return _draw_all(request, compared, Path(options.all), options.format)
    if options.index is not None:
        figure = draw_index(request, options.index)
        return [_write(figure, options.output or _file(request, options.index))]
    subject = compared if options.figure == "8" else request
    figure = FIGURES[options.figure](subject)
    return [_write(figure, options.output or _file(subject, options.figure))]


def _draw_all(request: Request, compared: Request, folder: Path, suffix: str) -> list[Path]:
    """Draw every figure that the leg has."""
    if request.heights:
        raise ValueRangeError("--all takes no --heights: its figures need different ones")
    names = ["linkage"]
    if plots.is_spatial_leg(request.leg.mechanism):
        supported = supported_indices(request.leg.mechanism)
        names = [
            name
            for name in FIGURES
            if FIGURE_INDICES.get(name, supported[0]) in supported and name not in SLOW_FIGURES
        ]
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name in tqdm(names, desc="drawing", unit="figure", disable=None, leave=False):
        subject = compared if name == "8" else request
        figure = FIGURES[name](subject)
        paths.append(_write(figure, folder / _file(subject, name, suffix)))
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


def _write(figure: Figure, path: Path) -> Path:
    """Write a picture; the same picture gives the same bytes."""
    stamp = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix.lower())
    with mpl.rc_context({"svg.hashsalt": "leg_statics"}):
        figure.savefig(path, dpi=RESOLUTION, metadata=stamp)
    return path


if __name__ == "__main__":
    sys.exit(main())
