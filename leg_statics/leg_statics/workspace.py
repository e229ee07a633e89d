# SPDX-License-Identifier: Apache-2.0
"""The workspace of a leg: grids over the actuators' ranges, its volume, bounds, heights, sections.

An integral over the foot's workspace W is one over the actuator ranges, with dW = |det J| dq; there
the grid is regular, and every point is a pose the leg can take.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arguments import as_count, require
from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.status import Status

POINTS_PER_JOINT = 15  # of the grids that tell bounds and heights
MOST_POINTS = 10_000_000  # of a grid
UP = (0.0, 0.0, 1.0)
MIDDLE = 0.8  # share of the volume that typical heights span
SECTION_POINTS = 240  # along each axis of a section


class WorkspaceSample(NamedTuple):
    """Postures that fill the workspace, with the volume each stands for.

    Attributes:
        posture: The OK postures of the grid (m,).
        volume: Volume of the foot's workspace that each posture stands for (m,) [m³].
        usable: Share of the actuator box whose poses are OK.
    """

    posture: Posture
    volume: FloatArray
    usable: float


class Section(NamedTuple):
    """Where a vertical plane through the foot cuts the workspace.

    Attributes:
        across: Grid coordinates along the plane's horizontal axis (m,) [m].
        z: Grid coordinates along z (m,) [m].
        inside: Whether the leg reaches the points (m, m), z by rows.
    """

    across: FloatArray
    z: FloatArray
    inside: NDArray[np.bool_]


def is_spatial_leg(mechanism: Mechanism) -> bool:
    """Tell whether a mechanism moves a point foot in space, so that its workspace has a volume."""
    return mechanism.has_point_foot and len(mechanism.joints) == 3


def actuator_grid(mechanism: Mechanism, points_per_joint: int) -> FloatArray:
    """Mid-points of the cells of a regular grid over the actuator ranges (points_per_joint^n, n).

    Each stands for the same volume of the box.
    """
    require("mechanism", mechanism, Mechanism)
    most = int(MOST_POINTS ** (1.0 / len(mechanism.joints)))
    points_per_joint = as_count("points_per_joint", points_per_joint, most)
    lower, upper = mechanism.joint_limits.T
    share = (np.arange(points_per_joint) + 0.5) / points_per_joint
    axes = lower + np.outer(share, upper - lower)
    return np.stack(np.meshgrid(*axes.T, indexing="ij"), axis=-1).reshape(-1, len(lower))


def volume_factor(jacobian: FloatArray) -> FloatArray:
    """dW/dq = sqrt(det JᵀJ), which is |det J| of a square J (...,)."""
    rows, columns = jacobian.shape[-2:]
    with np.errstate(invalid="ignore"):
        if rows == columns:
            return np.abs(np.linalg.det(jacobian))
        return np.sqrt(np.linalg.det(np.swapaxes(jacobian, -1, -2) @ jacobian))


def sample_workspace(mechanism: Mechanism, points_per_joint: int) -> WorkspaceSample:
    """Fill the workspace by a grid over the actuator ranges.

    Args:
        mechanism: A leg with as many actuators as task coordinates.
        points_per_joint: Grid points of each actuator.

    Raises:
        NotSupportedError: If the Jacobian is not square, so that there is no volume.
    """
    n = len(mechanism.joints)
    if n != len(mechanism.task_coordinates):
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has {n} actuators for "
            f"{len(mechanism.task_coordinates)} task coordinates: its workspace has no volume"
        )
    everything = mechanism.forward(actuator_grid(mechanism, points_per_joint))
    ok = everything.status == Status.OK
    posture = Posture(*(field[ok] for field in everything))
    widths = np.diff(mechanism.joint_limits, axis=1)[:, 0] / points_per_joint
    volume = volume_factor(mechanism.jacobian(posture)) * np.prod(widths)
    return WorkspaceSample(posture, volume, float(np.mean(ok)))


def workspace_bounds(mechanism: Mechanism, points_per_joint: int = POINTS_PER_JOINT) -> FloatArray:
    """Box in the leg frame that holds the workspace (t, 2) [m], with a margin of 2 %."""
    grid = actuator_grid(mechanism, points_per_joint)
    posture = mechanism.forward(grid)
    foot = posture.foot_position[posture.status == Status.OK]
    if not len(foot):
        raise ValueRangeError(f"mechanism {mechanism.name!r} reaches no point within its limits")
    lower, upper = foot.min(axis=0), foot.max(axis=0)
    margin = 0.02 * np.max(upper - lower) + 0.5 * (upper - lower) / points_per_joint
    return np.stack([lower - margin, upper + margin], axis=-1)


def check_heights(mechanism: Mechanism, heights: ArrayLike, up: ArrayLike = UP) -> None:
    """Raise a ValueRangeError for a height above the leg's origin that no foot can have.

    Below the origin such a height is a question like others; above it, it is a forgotten sign.

    Args:
        mechanism: The leg's mechanism.
        heights: Heights over the origin of the leg frame (...) [m].
        up: Direction in which they count, in the leg frame (3,).
    """
    highest = np.max(as_array("height", heights), initial=-np.inf)
    if not highest > 0.0:
        return
    top = float(np.sum(np.max(workspace_bounds(mechanism) * np.reshape(up, (3, 1)), axis=1)))
    if highest > top:
        raise ValueRangeError(
            f"height must be negative below the leg's origin, and the foot reaches no higher than "
            f"{top:.3g} m, got {highest}"
        )


def initial_height(mechanism: Mechanism) -> float:
    """Height of the foot in the initial posture [m]."""
    return float(mechanism.initial_posture.foot_position[2])


def typical_heights(mechanism: Mechanism, count: int = 6) -> FloatArray:
    """Heights of the foot that span the middle 80 % of the workspace's volume (count,) [m].

    They are rounded to 1 cm where that keeps them apart.
    """
    sample = sample_workspace(mechanism, POINTS_PER_JOINT)
    z = sample.posture.foot_position[:, 2]
    order = np.argsort(z)
    share = np.cumsum(sample.volume[order]) / np.sum(sample.volume)
    outside = 0.5 * (1.0 - MIDDLE)
    lowest, highest = np.interp([outside, 1.0 - outside], share, z[order])
    heights = np.linspace(lowest, highest, count)
    rounded = np.round(heights, 2)
    return rounded if len(np.unique(rounded)) == count else heights


def vertical_section(mechanism: Mechanism, foot: ArrayLike, axis: int) -> Section:
    """Cut the workspace by the vertical plane through a foot position.

    Args:
        mechanism: The leg's mechanism.
        foot: Foot position (t,) [m].
        axis: The plane's horizontal axis in the leg frame: 0 for x, 1 for y.
    """
    bounds = workspace_bounds(mechanism)
    lower, upper = bounds.T
    across, z = (np.linspace(lower[k], upper[k], SECTION_POINTS) for k in (axis, 2))
    place = as_array("foot", foot, len(bounds))
    points = np.broadcast_to(place, (len(z), len(across), len(place))).copy()
    points[..., axis], points[..., 2] = across, z[:, None]
    return Section(across, z, np.asarray(mechanism.inverse(points).status) == Status.OK)
