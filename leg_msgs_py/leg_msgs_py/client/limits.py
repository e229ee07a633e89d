# SPDX-License-Identifier: Apache-2.0
"""The effort limits in force, and new ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from leg_msgs.srv import SetEffortLimits
from leg_msgs_py.arrays import FloatArray, from_field, to_field
from leg_msgs_py.client.inputs import numbers
from leg_msgs_py.client.questions import Request, question
from numpy.typing import ArrayLike


class EffortLimits(NamedTuple):
    """Effort limits in force of all joints of the robot.

    Attributes:
        joint_names: Names of the joints.
        lower: Least efforts, <= 0 [N.m or N].
        upper: Greatest efforts, >= 0 [N.m or N].
    """

    joint_names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def from_message(cls, message: Any) -> EffortLimits:
        """Return the content of a `leg_msgs/EffortLimits`."""
        lower, upper = from_field(message.lower), from_field(message.upper)
        return cls(tuple(message.joint_names), lower, upper)


@question("statics", SetEffortLimits)
def set_effort_limits(
    leg: str,
    joint_names: Sequence[str],
    upper: ArrayLike,
    lower: ArrayLike | None = None,
) -> Request[EffortLimits]:
    """Change the effort limits of some joints of a leg; all or none.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        joint_names: Joints to change.
        upper: Greatest efforts, >= 0, one a joint [N.m or N].
        lower: Least efforts, <= 0, one a joint [N.m or N]; None for -upper.

    Returns:
        The limits of all joints of the robot in force afterwards.
    """
    request = SetEffortLimits.Request(
        leg=leg,
        joint_names=list(joint_names),
        lower=to_field([] if lower is None else numbers("lower", lower)),
        upper=to_field(numbers("upper", upper)),
    )
    return Request(request, lambda response: EffortLimits.from_message(response.limits))
