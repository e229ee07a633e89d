# SPDX-License-Identifier: Apache-2.0
"""What the feet of a robot carry together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from leg_msgs.msg import StanceVerdict
from leg_msgs.srv import QueryStance
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import Points, number, numbers, vector
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.errors import InvalidInputError
from numpy.typing import ArrayLike, NDArray

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Stances(NamedTuple):
    """Answer of `query_stance` for L feet and stances (...,).

    Attributes:
        legs: Names of the legs on the ground (L).
        verdict: A `leg_msgs/StanceVerdict` constant each (...,); 0 stands.
        status: Status of the legs' poses (..., L).
        load_factor: How many times the mass is carried (...,); infinite if any, NaN if none.
        utilisation: Largest effort / effort limit of the best forces (...,).
        limit: What limits the load factor most, a `leg_msgs/StanceVerdict` constant (...,); 0 where
            nothing does.
        limiting_leg: Index of the leg where that is (...,); -1 for none.
        limiting_joint: Index of the joint of that leg, if its effort limits (...,); -1 elsewhere.
        payload: Greatest mass that can be carried besides (...,) [kg]; NaN unless asked for.
        margin_along: How far the centre of mass may move along a direction (...,) [m]; NaN unless
            asked for.
        margin: Least distance of the centre of mass from the border of the support region (...,)
            [m], negative outside; NaN without directions.
        margin_error: By so much at most the true margin is larger (...,) [m].
        region: Vertices of the support region in K directions (..., K, 3) [m].
        ranking: Flat indices of the stances that stand, best first: by margin, or without
            directions by load factor.
        best: The first of them; -1 if none stands.
        weight_counted: Whether the weight of each leg's links takes part of the efforts (L).
        mass: Mass that was used [kg].
        joint_names: Actuated joints of the L legs; empty unless forces were asked for.
        joint_efforts: Efforts of the best forces, in that order [N.m or N].
        force: Forces of the ground with the smallest largest utilisation (..., L, 3) [N].
    """

    legs: tuple[str, ...]
    verdict: NDArray[np.uint8]
    status: StatusArray
    load_factor: FloatArray
    utilisation: FloatArray
    limit: NDArray[np.uint8]
    limiting_leg: NDArray[np.int32]
    limiting_joint: NDArray[np.int32]
    payload: FloatArray
    margin_along: FloatArray
    margin: FloatArray
    margin_error: FloatArray
    region: FloatArray
    ranking: NDArray[np.int32]
    best: int
    weight_counted: tuple[bool, ...]
    mass: float
    joint_names: tuple[str, ...]
    joint_efforts: FloatArray
    force: FloatArray

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Whether the robot stands (...,)."""
        return np.asarray(self.verdict == StanceVerdict.STANDS)


@question("statics", QueryStance)
def query_stance(
    feet: Mapping[str, ArrayLike],
    ground: str | ArrayLike,
    *,
    base_position: ArrayLike | None = None,
    base_orientation: ArrayLike = UPRIGHT,
    frame: str = "",
    normals: ArrayLike = (),
    high_end: bool = False,
    mass: float = 0.0,
    center_of_mass: ArrayLike = (),
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
    force: ArrayLike = (0.0, 0.0, 0.0),
    moment: ArrayLike = (0.0, 0.0, 0.0),
    payload_position: ArrayLike = (),
    margin_direction: ArrayLike = (),
    directions: int = 0,
    forces: bool = False,
) -> Request[Stances]:
    """Return what the feet of a robot carry together, in many stances at once.

    Candidates of one foot, or of body poses, are leading axes of that foot or pose alone; feet,
    poses, normals and centres of mass broadcast.

    Args:
        feet: Positions (..., 3) by the names of the legs that stand [m].
        ground: The ground under all feet, by its name, or friction coefficients: one for all, or
            that of each foot (..., L).
        base_position: Origin of the base frame (..., 3) [m]; None if `frame` is the base frame.
        base_orientation: Quaternions x, y, z, w of the base frame (..., 4).
        frame: Frame of all vectors: the base frame ("" or its name), or with a base position any
            other, "map" unless named.
        normals: Normals of the ground (3,), or of each foot (..., L, 3); () for level.
        high_end: Whether a named ground's friction is the high end of its range.
        mass: Mass of the robot [kg]; 0 for that of its description.
        center_of_mass: Its centre in the base frame (..., 3) [m]; () for that of the description.
        gravity: Acceleration of gravity (3,) [m/s²]; zero for 9.80665 down the frame's z axis.
        acceleration: Acceleration of the body (3,) [m/s²].
        force: Further force on the robot (3,) [N].
        moment: Further moment on it about the origin of the frame (3,) [N.m].
        payload_position: Where a payload would be, in the base frame (3,) [m]; () if not asked.
        margin_direction: Where the centre of mass might move (3,); () if not asked.
        directions: In how many directions the border of the support region is found; 0 for none.
        forces: Whether to return forces and joint efforts, too.
    """
    legs = list(feet)
    if not legs:
        raise InvalidInputError("feet must name at least one leg")
    on = np.stack(np.broadcast_arrays(*[_vectors(leg, at) for leg, at in feet.items()]), axis=-2)
    friction = np.empty(0) if isinstance(ground, str) else numbers("ground", ground)
    slopes, center = numbers("normals", normals), numbers("center_of_mass", center_of_mass)
    shapes = {
        "feet": on.shape[:-2],
        "ground": friction.shape[:-1],
        "normals": slopes.shape[:-2],
        "center_of_mass": center.shape[:-1],
    }
    poses = np.empty(0) if base_position is None else _poses(base_position, base_orientation)
    shapes["base_position and base_orientation"] = np.shape(poses)[:-1]
    batch = _batch(shapes)
    request = QueryStance.Request(
        legs=legs,
        base_poses=[_pose(row) for row in _rows(poses, batch, 1).reshape(-1, 7).tolist()],
        feet=_field(on, batch, 2),
        ground=ground if isinstance(ground, str) else "",
        use_high_end=high_end,
        friction_coefficients=_field(friction, batch, min(friction.ndim, 1)),
        normals=_field(slopes, batch, min(slopes.ndim, 2)),
        mass=number("mass", mass),
        center_of_mass=_field(center, batch, 1),
        gravity=vector("gravity", gravity),
        acceleration=vector("acceleration", acceleration),
        wrench=np.concatenate([vector("force", force), vector("moment", moment)]),
        payload_position=to_field(numbers("payload_position", payload_position)),
        margin_direction=to_field(numbers("margin_direction", margin_direction)),
        region_directions=int(directions),
        include_forces=forces,
    )
    request.header.frame_id = frame or ("" if base_position is None else "map")

    def decode(response: Any) -> Stances:
        def asked(field: Any) -> FloatArray:
            return from_field(field, batch) if len(field) else np.full(batch, np.nan)

        names = tuple(response.joint_names)
        return Stances(
            legs=tuple(response.legs),
            verdict=from_field(response.verdict, batch, np.uint8),
            status=from_field(response.status, (*batch, len(legs)), np.uint8),
            load_factor=from_field(response.load_factor, batch),
            utilisation=from_field(response.utilisation, batch),
            limit=from_field(response.limit, batch, np.uint8),
            limiting_leg=from_field(response.limiting_leg, batch, np.int32),
            limiting_joint=from_field(response.limiting_joint, batch, np.int32),
            payload=asked(response.payload),
            margin_along=asked(response.margin_along),
            margin=asked(response.margin),
            margin_error=asked(response.margin_error),
            region=from_field(response.region, (*batch, directions, 3)),
            ranking=from_field(response.ranking, dtype=np.int32),
            best=response.best,
            weight_counted=tuple(response.weight_counted),
            mass=response.mass,
            joint_names=names,
            joint_efforts=from_field(response.joint_efforts, (*batch, len(names))),
            force=from_field(response.force, (*batch, len(legs), 3) if forces else (0,)),
        )

    return Request(request, decode, Points("feet", on, batch))


def _vectors(name: str, values: ArrayLike) -> FloatArray:
    """Return vectors (..., 3)."""
    array = numbers(name, values)
    if array.shape[-1:] != (3,):
        raise InvalidInputError(f"{name} must have shape (..., 3), got {array.shape}")
    return array


def _poses(position: ArrayLike, orientation: ArrayLike) -> FloatArray:
    """Return positions and quaternions side by side (..., 7)."""
    at, turned = _vectors("base_position", position), numbers("base_orientation", orientation)
    if turned.shape[-1:] != (4,):
        raise InvalidInputError(f"base_orientation must have shape (..., 4), got {turned.shape}")
    batch = _batch({"base_position": at.shape[:-1], "base_orientation": turned.shape[:-1]})
    parts = [np.broadcast_to(part, (*batch, part.shape[-1])) for part in (at, turned)]
    return np.concatenate(parts, axis=-1)


def _pose(row: list[float]) -> Any:
    """Return a message of one row."""
    x, y, z, a, b, c, d = row
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=a, y=b, z=c, w=d))


def _batch(shapes: dict[str, tuple[int, ...]]) -> tuple[int, ...]:
    """Return the leading axes of all together."""
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        told = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InvalidInputError(f"leading axes do not broadcast: {told}") from None


def _field(array: FloatArray, batch: tuple[int, ...], axes: int) -> Any:
    """Return an array, whose last axes are those of one stance, as a field."""
    return to_field(_rows(array, batch, axes))


def _rows(array: FloatArray, batch: tuple[int, ...], axes: int) -> FloatArray:
    """Return one row for all stances as it is, others broadcast to all stances."""
    if array.ndim == axes:
        return array
    return np.broadcast_to(array, batch + array.shape[array.ndim - axes :])
