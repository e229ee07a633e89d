# SPDX-License-Identifier: Apache-2.0
"""The joint efforts that hold what the ground applies to the foot."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.srv import ComputeEfforts
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import points, vector, vectors
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.frames import Frame, put_frame
from numpy.typing import ArrayLike, NDArray


class Efforts(NamedTuple):
    """Answer of `compute_efforts`.

    Attributes:
        joint_efforts: Efforts of the actuators (..., n) [N.m or N].
        utilisation: Largest effort / effort limit over the joints (...,), 1 = at the limit.
        limiting_joint: Index of the joint with that utilisation (...,); -1 where there is none.
        status: Status of each point (...,).
        joint_names: Names of the actuated joints (n).
        weight_counted: Whether the efforts hold the leg's own weight, too.
    """

    joint_efforts: FloatArray
    utilisation: FloatArray
    limiting_joint: NDArray[np.int32]
    status: StatusArray
    joint_names: tuple[str, ...]
    weight_counted: bool


@question("statics", ComputeEfforts)
def compute_efforts(
    leg: str,
    positions: ArrayLike,
    forces: ArrayLike,
    moments: ArrayLike | None = None,
    *,
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    frame: Frame | str = "",
    assembly_mode: str = "",
) -> Request[Efforts]:
    """Return the joint efforts that hold what the ground applies to the foot.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Foot (..., t) [m].
        forces: Force of the ground on the foot (..., 3), or one for all (3,) [N].
        moments: Moment of the ground on the foot, likewise [N.m]; None for hard ground.
        gravity: Acceleration of gravity in the frame (3,) [m/s²]; zero is down the frame, or down
            the base frame if it is the leg's own.
        frame: Frame of all three: the leg's own ("" or its name), the base frame, or a `Frame`.
        assembly_mode: Branch of the closed chain; "" is the default.
    """
    feet = points("positions", positions)
    request = ComputeEfforts.Request(
        leg=leg,
        positions=to_field(feet.values),
        assembly_mode=assembly_mode,
        forces=to_field(vectors("forces", forces, feet.batch)),
        gravity=vector("gravity", gravity),
        moments=to_field([] if moments is None else vectors("moments", moments, feet.batch)),
    )
    put_frame(request, frame)

    def decode(response: Any) -> Efforts:
        status = feet.status(response)
        names = tuple(response.joint_names)
        return Efforts(
            joint_efforts=from_field(response.joint_efforts, (*feet.batch, len(names))),
            utilisation=from_field(response.utilisation, feet.batch),
            limiting_joint=from_field(response.limiting_joint, feet.batch, np.int32),
            status=status,
            joint_names=names,
            weight_counted=response.weight_counted,
        )

    return Request(request, decode, feet)
