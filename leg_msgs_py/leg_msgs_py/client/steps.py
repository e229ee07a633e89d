# SPDX-License-Identifier: Apache-2.0
"""How far the next step may go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.srv import QueryStepLength
from leg_msgs_py.arrays import FloatArray, from_field, to_field
from leg_msgs_py.client.inputs import number, numbers, vector
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.frames import Frame, put_frame
from leg_msgs_py.grounds import Ground, ground_message
from numpy.typing import ArrayLike, NDArray


class StepLengths(NamedTuple):
    """Answer of `query_step_length` for L legs and heights (...,).

    Attributes:
        legs: Names of the legs (L).
        length: Step length of each leg (L, ...) [m]; 0 where no point is feasible.
        start: Rear ends (L, ..., 3) [m]; NaN where there is none.
        end: Front ends (L, ..., 3) [m].
        start_limit: `leg_msgs/FootholdVerdict` just behind the rear ends (L, ...).
        end_limit: The same just before the front ends (L, ...).
        load_capacity: Load capacity along the stances (L, ..., P) [N].
        rated_friction: mu_e = |F_x| / |F_z|, forward over vertical, along them (L, ..., P).
        rated_friction_full: sqrt(F_x² + F_y²) / |F_z| along them (L, ..., P).
        common_length: The step that all legs can make together (...,) [m].
        limiting_leg: Index of the leg with the shortest step (...,).
        best_height: Flat index of the longest common step; -1 if there is none.
        friction_coefficient: Friction coefficients that were used: one (), or those of a profile
            (Q,).
        weight_counted: Whether the actuators were asked to hold the legs' own weight, too (L,).
    """

    legs: tuple[str, ...]
    length: FloatArray
    start: FloatArray
    end: FloatArray
    start_limit: NDArray[np.uint8]
    end_limit: NDArray[np.uint8]
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    common_length: FloatArray
    limiting_leg: NDArray[np.int32]
    best_height: int
    friction_coefficient: FloatArray
    weight_counted: NDArray[np.bool_]


@question("statics", QueryStepLength)
def query_step_length(
    legs: str | Sequence[str],
    heights: ArrayLike,
    ground: Ground | str | float,
    load: float = 0.0,
    *,
    lateral_offsets: ArrayLike = (),
    direction: ArrayLike = (0.0, 0.0, 0.0),
    profile: tuple[ArrayLike, ArrayLike] | None = None,
    moment: ArrayLike = (0.0, 0.0, 0.0),
    any_direction_moment: float = 0.0,
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    by_rated_friction: bool = False,
    frame: Frame | str = "",
) -> Request[StepLengths]:
    """Return how far the next step may go, of each leg and of all together.

    Args:
        legs: Name of a leg, or names of several; () for all.
        heights: z of the ground in the frame (...,) [m]; -0.8 if the body is 0.8 m above it.
        ground: The ground: its name, its friction coefficient, or a `Ground` with a normal; with a
            profile, friction (Q,) and normals (Q, 3) may be those at its points.
        load: Force against gravity that each leg has to bear [N].
        lateral_offsets: Distance of each leg's line from the origin of its own frame, to the
            left of the walking direction (L,), or one for all [m]; () for none.
        direction: Walking direction, horizontal (3,) of any length; zero is forward.
        profile: Distances along the lines from the origins of the legs' own frames (Q,), and how
            high the ground is there above `heights`, for all legs (Q,) or each (L, Q) [m]; NaN
            where it is not known. None is level ground.
        moment: Moment of the ground on the foot (3,) [N.m]; zero on hard ground.
        any_direction_moment: Further horizontal moment of unknown direction [N.m].
        gravity: Acceleration of gravity in the frame (3,) [m/s²]; zero is down the frame, or down
            the base frame if it is the leg's own.
        by_rated_friction: Whether a point is feasible where the ground offers the rated
            friction, whatever the load.
        frame: Frame of all vectors: "" is the leg's own for one leg, the base for several; or a
            `Frame` around the robot.
    """
    distances, rises = ((), ()) if profile is None else profile
    along = numbers("profile", distances)
    levels = numbers("heights", heights)
    request = QueryStepLength.Request(
        legs=[legs] if isinstance(legs, str) else list(legs),
        heights=to_field(levels),
        lateral_offsets=to_field(numbers("lateral_offsets", lateral_offsets)),
        direction=vector("direction", direction),
        profile_distances=to_field(along),
        profile_heights=to_field(numbers("profile", rises)),
        ground=ground_message(ground, along.shape),
        required_load=number("load", load),
        required_moment=vector("moment", moment),
        any_direction_moment=number("any_direction_moment", any_direction_moment),
        gravity=vector("gravity", gravity),
        criterion=QueryStepLength.Request.RATED_FRICTION
        if by_rated_friction
        else QueryStepLength.Request.CAPACITY,
    )
    put_frame(request, frame)

    def decode(response: Any) -> StepLengths:
        batch = (len(response.legs), *levels.shape)
        along_stance = (*batch, response.profile_points)
        used = from_field(response.friction_coefficients)
        return StepLengths(
            legs=tuple(response.legs),
            length=from_field(response.length, batch),
            start=from_field(response.start, (*batch, 3)),
            end=from_field(response.end, (*batch, 3)),
            start_limit=from_field(response.start_limit, batch, np.uint8),
            end_limit=from_field(response.end_limit, batch, np.uint8),
            load_capacity=from_field(response.load_capacity, along_stance),
            rated_friction=from_field(response.rated_friction, along_stance),
            rated_friction_full=from_field(response.rated_friction_full, along_stance),
            common_length=from_field(response.common_length, levels.shape),
            limiting_leg=from_field(response.limiting_leg, levels.shape, np.int32),
            best_height=response.best_height,
            friction_coefficient=used.reshape(()) if len(used) == 1 else used,
            weight_counted=np.array(response.weight_counted),
        )

    return Request(request, decode)
