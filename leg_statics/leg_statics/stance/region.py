# SPDX-License-Identifier: Apache-2.0
"""Where the centre of mass of a robot may be: margins along directions, and the support region.

A force of the weight at c + d turns by d x weight more than one at c. A margin is the greatest
distance of such a shift along one direction. The region is the set of all shifts: in each of K
directions its outermost point is sought, while the centre of mass may move at will across the
direction, that is, while any moment may act about it.

Without limits of effort and on level ground the region is the support polygon. In general it is
convex, with curved parts where friction limits (Bretl and Lall 2008, "Testing static equilibrium
for legged robots"). It contains the polygon of the outermost points and is within that of the
tangents there; the largest distance between the two is the stated error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, StatusArray, as_array
from leg_kinematics.errors import ValueRangeError
from leg_statics.stance.stances import (
    OF_STANCE,
    Load,
    Multiples,
    Stance,
    as_arrays,
    greatest,
    length_of,
)

DIRECTIONS = 18


class SupportRegion(NamedTuple):
    """Where the centre of mass may be, in the plane across gravity through the one given.

    Attributes:
        directions: The K directions, at equal angles counter-clockwise (..., K, 3).
        reach: Distance from the given centre of mass to the tangent in each direction (..., K) [m];
            negative where the centre is outside, NaN if no centre of mass can be carried, infinite
            where any can.
        vertices: Outermost point in each direction, a polygon inside the region (..., K, 3) [m].
        tangent_corners: Where the tangents of one direction and the next meet, a polygon around the
            region (..., K, 3) [m].
        margin: Distance of the given centre of mass from the border of the inner polygon, negative
            outside (...,) [m]; the region's own is larger by `error` at most.
        error: Largest distance between both polygons (...,) [m].
        limit: What limits each direction most (..., K), see `Multiples`.
        limiting_leg: The leg (..., K).
        limiting_joint: The joint (..., K).
    """

    directions: FloatArray
    reach: FloatArray
    vertices: FloatArray
    tangent_corners: FloatArray
    margin: FloatArray
    error: FloatArray
    limit: StatusArray
    limiting_leg: NDArray[np.int64]
    limiting_joint: NDArray[np.int64]


def margin_along(stance: Stance, load: Load, direction: ArrayLike) -> Multiples:
    """Return how far the centre of mass may be shifted along a direction [m].

    Args:
        stance: The stance.
        load: What has to be carried.
        direction: Direction of any length (..., 3); what it has along gravity does not count.

    Raises:
        ValueRangeError: If a direction is zero, or along gravity.
    """
    force = load.weight[..., :3]
    along = _across_gravity(as_array("direction", direction, 3), force)
    fixed, growing = load.weight + load.further, _shifted(along, force)
    return greatest(as_arrays(stance), fixed, growing, load_size=length_of(force))


def support_region(stance: Stance, load: Load, directions: int = DIRECTIONS) -> SupportRegion:
    """Return where the centre of mass may be for the feet to carry the load.

    Args:
        stance: The stance.
        load: What has to be carried; its mass must be positive.
        directions: How many directions, at least 3.

    Raises:
        ValueRangeError: If there are fewer directions, or the mass does not pull anywhere.
    """
    if directions < 3:
        raise ValueRangeError(f"directions must be >= 3, got {directions}")
    feet = as_arrays(stance)
    feet = Stance(*[_with_axis(array, k) for array, k in zip(feet, OF_STANCE, strict=True)])
    weight, further = load.weight[..., None, :], load.further[..., None, :]
    force = weight[..., :3]
    along = _rose(force, directions)
    found = greatest(
        feet, weight + further, _shifted(along, force), along, load_size=length_of(force)
    )
    size = length_of(force)
    moment = (
        np.cross(np.asarray(feet.position), found.force).sum(axis=-2) + (weight + further)[..., 3:]
    )
    across = np.einsum("...i,...i->...", moment, along) / size
    up = -force / size[..., None]
    sideways = np.cross(up, along)
    reach = found.multiple
    center = as_array("center_of_mass", load.center_of_mass, 3)[..., None, :]
    vertices = reach[..., None] * along + across[..., None] * sideways
    corners = reach[..., None] * along + _to_corner(reach)[..., None] * sideways
    margin, error = _margin_and_error(vertices, corners, along, sideways)
    return SupportRegion(
        directions=np.broadcast_to(along, vertices.shape),
        reach=reach,
        vertices=center + vertices,
        tangent_corners=center + corners,
        margin=margin,
        error=error,
        limit=found.limit,
        limiting_leg=found.limiting_leg,
        limiting_joint=found.limiting_joint,
    )


def _with_axis(array: ArrayLike, axes: int) -> FloatArray:
    """Return a field of stances with an axis for the directions."""
    field = np.asarray(array)
    return np.expand_dims(field, field.ndim - axes) if field.ndim > axes else field


def _shifted(along: FloatArray, force: FloatArray) -> FloatArray:
    """Return by what the wrench of a force (..., 3) grows for each metre along a direction."""
    moment = np.cross(along, force)
    return np.concatenate([np.zeros_like(moment), moment], axis=-1)


def _across_gravity(direction: FloatArray, force: FloatArray) -> FloatArray:
    """Return the unit vector along a direction (..., 3), less what it has along a force."""
    down = force / length_of(force)[..., None]
    across = direction - np.einsum("...i,...i->...", direction, down)[..., None] * down
    size = length_of(across)
    if not np.all(size > 1e-9 * length_of(direction)):
        raise ValueRangeError("direction must be finite, not zero and not along gravity")
    return across / size[..., None]


def _rose(force: FloatArray, directions: int) -> FloatArray:
    """Return directions (..., K, 3) across a force (..., 1, 3), the first forward."""
    size = length_of(force)
    if not np.all(size > 0.0):
        raise ValueRangeError("a support region needs a mass > 0 and gravity")
    forward = np.array([1.0, 0.0, 0.0])
    steep = np.abs(force[..., :1]) > 0.9 * size[..., None]
    x = _across_gravity(np.where(steep, np.array([0.0, 0.0, 1.0]), forward), force)
    y = np.cross(-force / size[..., None], x)
    angle = 2.0 * np.pi / directions * np.arange(directions)
    return np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y


def _to_corner(reach: FloatArray) -> FloatArray:
    """Return how far left along its tangent each direction meets the tangent of the next."""
    angle = 2.0 * np.pi / reach.shape[-1]
    following = np.roll(reach, -1, axis=-1)
    return (following - reach * np.cos(angle)) / np.sin(angle)


def _margin_and_error(
    vertices: FloatArray, corners: FloatArray, along: FloatArray, sideways: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far the origin is inside the polygon of vertices, and the corners outside.

    The normal of an edge is between its two directions. Rounding may turn that of a short one.
    """
    edge = np.roll(vertices, -1, axis=-2) - vertices
    outward = np.cross(edge, np.cross(along, sideways))
    with np.errstate(invalid="ignore", divide="ignore"):
        outward = outward / length_of(outward)[..., None]
        before = ~(np.einsum("...i,...i->...", outward, sideways) >= 0.0)
        after = np.einsum("...i,...i->...", outward, np.roll(sideways, -1, axis=-2)) > 0.0
    outward = np.where(before[..., None], along, outward)
    outward = np.where((after & ~before)[..., None], np.roll(along, -1, axis=-2), outward)
    inside = np.einsum("...i,...i->...", vertices, outward)
    outside = np.einsum("...i,...i->...", corners - vertices, outward)
    return inside.min(axis=-1), outside.max(axis=-1)
