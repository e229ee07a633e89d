# SPDX-License-Identifier: Apache-2.0
"""Pictures of a leg: each computes what it shows, then draws it.

Every function returns a figure, drawn into `figure` if one is given, such as `plt.figure()`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from leg_kinematics.errors import NotSupportedError, ShapeError, ValueRangeError
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.robot import Leg
from leg_statics.drawing.friction import RATED_FRICTION, plot_rated_friction
from leg_statics.drawing.linkage import View, plot_linkage
from leg_statics.drawing.maps import plot_maps
from leg_statics.drawing.steps import plot_step_lengths
from leg_statics.drawing.style import height_title
from leg_statics.footholds import Contact
from leg_statics.force_shapes import force_polygon
from leg_statics.grounds import Ground
from leg_statics.indices import find_index, supported_indices
from leg_statics.maps import CAPACITY_LAYER, line_map, plane_map
from leg_statics.step_length import Criterion, longest_step
from leg_statics.weight import level_gravity, weight_efforts
from leg_statics.workspace import (
    initial_height,
    is_spatial_leg,
    typical_heights,
    vertical_section,
    workspace_bounds,
)

MAP_RESOLUTION = 0.005  # m
LINE_RESOLUTION = 0.001  # m
STEP_HEIGHTS = 61


def index_picture(
    leg: Leg,
    index: str,
    heights: Sequence[float] = (),
    resolution: float = MAP_RESOLUTION,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Map an index over x and y at several heights: figures 2, 5 and 6 of paper 000.

    Args:
        leg: The leg.
        index: Name of an index.
        heights: Heights of the planes in the leg frame [m]; none for `typical_heights`.
        resolution: Grid spacing [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        UnknownNameError: If there is no such index.
        NotSupportedError: If the mechanism does not have it.
        ValueRangeError: If a plane does not meet the workspace.
    """
    find_index(index)
    _check_spatial(leg.mechanism)
    supported = supported_indices(leg.mechanism)
    if index not in supported:
        raise NotSupportedError(
            f"mechanism {leg.mechanism.name!r} has no index {index!r}; "
            f"it has: {', '.join(supported)}"
        )
    _check_heights(leg, heights)
    chosen = np.sort(heights if len(heights) else typical_heights(leg.mechanism))
    maps = {
        height_title(height): plane_map(leg, height, resolution, layers=[index])
        for height in chosen.tolist()
    }
    return plot_maps(maps, index, title=title, figure=figure)


def capacity_picture(
    leg: Leg,
    grounds: Sequence[Ground],
    height: float | None = None,
    resolution: float = MAP_RESOLUTION,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Map the load capacity over x and y on level grounds, with the friction to count on.

    Args:
        leg: The leg.
        grounds: The grounds.
        height: Height of the plane in the leg frame [m]; by default that of the initial posture.
        resolution: Grid spacing [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        NotSupportedError: If the mechanism does not move a point foot in space.
        ValueRangeError: If the plane does not meet the workspace.
    """
    _check_spatial(leg.mechanism)
    plane = initial_height(leg.mechanism) if height is None else height
    _check_heights(leg, [plane])
    maps = {
        name: plane_map(leg, plane, resolution, layers=[CAPACITY_LAYER], contact=Contact(friction))
        for name, friction in _frictions(grounds).items()
    }
    where = ", ".join(filter(None, [title, height_title(plane)]))
    return plot_maps(maps, CAPACITY_LAYER, title=where, figure=figure)


def friction_picture(
    mechanisms: Mapping[str, Mechanism],
    grounds: Sequence[Ground],
    heights: Sequence[float] = (),
    *,
    y: float = 0.0,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the rated friction along the walking direction: figure 8 of paper 000.

    Args:
        mechanisms: Mechanisms by the name of their curve, such as before and after optimisation.
        grounds: Grounds to compare with.
        heights: Height of the foot for each mechanism, or one for all [m]; by default that of
            each one's initial posture.
        y: y of the line in the leg frame [m].
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        NotSupportedError: If a mechanism does not move a point foot in space.
        ShapeError: If the number of heights is neither one nor that of the mechanisms.
        ValueRangeError: If a line does not meet the workspace.
    """
    for mechanism in mechanisms.values():
        _check_spatial(mechanism)
    chosen = list(heights) or [initial_height(m) for m in mechanisms.values()]
    if len(chosen) == 1:
        chosen *= len(mechanisms)
    if len(chosen) != len(mechanisms):
        raise ShapeError(f"{len(mechanisms)} mechanisms need as many heights, got {len(chosen)}")
    curves = {
        name: line_map(Leg.of(mechanism), y, height, LINE_RESOLUTION, layers=[RATED_FRICTION])
        for (name, mechanism), height in zip(mechanisms.items(), chosen, strict=True)
    }
    return plot_rated_friction(curves, grounds, title=title, figure=figure)


def steps_picture(
    leg: Leg,
    grounds: Sequence[Ground],
    load: float,
    heights: Sequence[float] = (),
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw the longest step against the height by each `Criterion`, on each ground.

    Args:
        leg: The leg.
        grounds: The grounds.
        load: Required normal load [N].
        heights: Heights of the foot in the leg frame [m]; by default all of the workspace.
        title: Title of the figure.
        figure: Figure to draw into.

    Raises:
        NotSupportedError: If the mechanism does not move a point foot in space.
        ValueRangeError: If a height is outside the workspace.
    """
    _check_spatial(leg.mechanism)
    _check_heights(leg, heights)
    lowest, highest = workspace_bounds(leg.mechanism)[2]
    z = np.sort(heights if len(heights) else np.linspace(lowest, highest, STEP_HEIGHTS))
    lengths = {
        criterion: {
            name: longest_step(leg, z, Contact(friction, load=load), criterion=criterion).length
            for name, friction in _frictions(grounds).items()
        }
        for criterion in Criterion
    }
    return plot_step_lengths(z, lengths, load, title=title, figure=figure)


def linkage_picture(
    leg: Leg,
    friction: float | None = None,
    *,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw a leg in its initial posture from the side and from the front.

    The ground reactions which its actuators can hold are drawn if it moves a point foot in space,
    so that not the structure alone holds forces of any size.

    Args:
        leg: The leg.
        friction: Friction coefficient of the ground; if given, its cone is drawn.
        title: Title of the figure.
        figure: Figure to draw into.
    """
    mechanism, posture = leg.mechanism, leg.mechanism.initial_posture
    forces: dict[str, Any] = {"side": None, "front": None}
    if is_spatial_leg(mechanism):
        jacobian = mechanism.jacobian(posture)
        weight = weight_efforts(mechanism, posture, level_gravity(leg))
        forces["side"] = force_polygon(jacobian[[0, 2]], leg.effort_limits, weight)
        forces["front"] = force_polygon(jacobian[[1, 2]], leg.effort_limits, weight)
    foot = posture.foot_position
    return plot_linkage(
        mechanism.linkage(posture),
        foot,
        View(vertical_section(mechanism, foot, 0), forces["side"]),
        View(vertical_section(mechanism, foot, 1), forces["front"]),
        friction,
        title=title,
        figure=figure,
    )


def _frictions(grounds: Sequence[Ground]) -> dict[str, float]:
    """Return the friction to count on by the label of the ground, the smoothest first."""
    ordered = sorted(grounds, key=lambda ground: ground.friction_low)
    return {f"{g.name}, $\\mu$ = {g.friction_low:g}": g.friction_low for g in ordered}


def _check_spatial(mechanism: Mechanism) -> None:
    if not is_spatial_leg(mechanism):
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} does not move a point foot in space: "
            "only its linkage can be drawn"
        )


def _check_heights(leg: Leg, heights: Sequence[float]) -> None:
    """Raise a ValueRangeError for a height at which the leg reaches nothing."""
    lower, upper = workspace_bounds(leg.mechanism)[2]
    for height in heights:
        if not lower <= height <= upper:
            raise ValueRangeError(
                f"height {height:g} m is outside the workspace of {leg.name}: "
                f"{lower:.3f} to {upper:.3f} m"
            )
