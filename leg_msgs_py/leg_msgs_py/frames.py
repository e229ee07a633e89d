# SPDX-License-Identifier: Apache-2.0
"""Frames of requests, as a gait planner says them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Pose
from leg_msgs_py.errors import InvalidInputError
from numpy.typing import ArrayLike


class Frame(NamedTuple):
    """A frame around the robot, such as "map" or "odom".

    Attributes:
        name: Its name.
        base_pose: Pose of the robot's base frame in it: a geometry_msgs/Pose, or x, y, z and the
            unit quaternion x, y, z, w (7,) [m]; None = as tf tells, where the nodes have it.
        stamp: Time of the pose, if tf tells it (builtin_interfaces/Time); None = the latest.
    """

    name: str
    base_pose: Any = None
    stamp: Any = None


def put_frame(request: Any, frame: Frame | str) -> None:
    """Tell the frame of a request.

    Raises:
        InvalidInputError: If the pose is none.
    """
    if not isinstance(frame, Frame):
        frame = Frame(frame)
    request.header.frame_id = frame.name
    if frame.stamp is not None:
        request.header.stamp = frame.stamp
    if frame.base_pose is not None:
        request.base_pose = [pose_message(frame.base_pose)]


def pose_message(pose: Any | ArrayLike) -> Any:
    """Return a pose or its 7 numbers as a geometry_msgs/Pose.

    Raises:
        InvalidInputError: If it is none.
    """
    if isinstance(pose, Pose):
        return pose
    allowed = "a geometry_msgs/Pose, or x, y, z and the quaternion x, y, z, w (7,)"
    try:
        numbers = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"base_pose must be {allowed}: {error}") from None
    if numbers.shape != (7,):
        raise InvalidInputError(f"base_pose must be {allowed}, got shape {numbers.shape}")
    message = Pose()
    place, turn = message.position, message.orientation
    place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = numbers.tolist()
    return message
