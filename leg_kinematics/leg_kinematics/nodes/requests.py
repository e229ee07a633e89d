# SPDX-License-Identifier: Apache-2.0
"""What the nodes share in reading requests: points, frames, and errors as codes of leg_msgs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from leg_msgs.msg import ErrorCode
from leg_msgs_py.arrays import from_field

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import LegError, NotSupportedError, UnknownNameError
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg, Mount, Robot

XYZ = ("x", "y", "z")  # components of points and vectors, column by column
NAME_CODES = {"leg": ErrorCode.UNKNOWN_LEG, "ground": ErrorCode.UNKNOWN_GROUND}


class RequestError(LegError):
    """A request that cannot be carried out, with its code of `leg_msgs/ErrorCode`."""

    def __init__(self, message: str, code: int = ErrorCode.INVALID_INPUT) -> None:
        super().__init__(message)
        self.code = code


def error_code(error: Exception) -> int:
    """Return the `leg_msgs/ErrorCode` of an exception."""
    if isinstance(error, RequestError):
        return error.code
    if isinstance(error, UnknownNameError):
        return int(NAME_CODES.get(error.kind, ErrorCode.INVALID_INPUT))
    if isinstance(error, NotSupportedError):
        return int(ErrorCode.NOT_SUPPORTED)
    return int(ErrorCode.INVALID_INPUT if isinstance(error, LegError) else ErrorCode.INTERNAL)


def read_rows(field: str, values: Any, names: tuple[str, ...]) -> FloatArray:
    """Return a flat field as an array (N, k) with one column a name.

    Args:
        field: Name of the field, for the message.
        values: Its content, row-major.
        names: What the columns are.

    Raises:
        RequestError: If the number of values is not a multiple of k.
    """
    if len(values) % len(names):
        columns = ", ".join(names)
        raise RequestError(
            f"{field}: the number of values must be a multiple of {len(names)} ({columns} of each "
            f"point), got {len(values)}"
        )
    rows: FloatArray = from_field(values, (-1, len(names)))
    return rows


def check_count(field: str, count: int, limit: int, parameter: str = "max_points") -> None:
    """Raise a TOO_LARGE RequestError if a request asks for more than the node accepts.

    Args:
        field: Name of the field, for the message.
        count: What it asks for.
        limit: How much is accepted.
        parameter: The node's parameter that holds the limit, named "max_" and what is counted.
    """
    if count > limit:
        raise RequestError(
            f"{field}: {count} {parameter.removeprefix('max_')}; allowed: at most {limit} at once "
            f"(parameter {parameter})",
            ErrorCode.TOO_LARGE,
        )


def read_joints(leg: Leg, request: Any, limit: int) -> FloatArray:
    """Return the `joint_positions` of a request (N, n).

    Raises:
        RequestError: If their number is wrong or too large.
    """
    joints = read_rows("joint_positions", request.joint_positions, leg.joint_names)
    check_count("joint_positions", len(joints), limit)
    return joints


def read_feet(leg: Leg, request: Any, frame: LegFrame) -> FloatArray:
    """Return the `positions` of a request in the leg frame (N, t).

    Raises:
        RequestError: If their number is wrong.
    """
    positions = read_rows("positions", request.positions, leg.mechanism.task_coordinates)
    return frame.points_to_leg(positions)


def read_posture(leg: Leg, request: Any, frame: LegFrame, limit: int) -> Posture:
    """Return the postures (N,) at the `positions` of a request.

    Raises:
        RequestError: If their number is wrong or too large.
        UnknownNameError: If the leg has no such assembly mode.
    """
    feet = read_feet(leg, request, frame)
    check_count("positions", len(feet), limit)
    return leg.mechanism.inverse(feet, request.assembly_mode)


class LegFrame:
    """A request in the leg's own frame: nothing to convert."""

    def points_to_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., t) of the request in the leg frame."""
        return points

    def points_from_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., t) of the leg frame in the frame of the request."""
        return points

    def vectors_to_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the request in the leg frame."""
        return vectors

    def vectors_from_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the leg frame in the frame of the request."""
        return vectors

    def rows_from_leg(self, matrix: FloatArray) -> FloatArray:
        """Return a matrix (..., 3, n) whose columns are free vectors in the request's frame."""
        return matrix


@dataclass(frozen=True)
class BaseFrame(LegFrame):
    """A request in the robot's base frame: the leg's mount converts."""

    mount: Mount

    def points_to_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the base frame in the leg frame."""
        return self.mount.to_leg(points)

    def points_from_leg(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the leg frame in the base frame."""
        return self.mount.to_base(points)

    def vectors_to_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the base frame in the leg frame."""
        return self.mount.vectors_to_leg(vectors)

    def vectors_from_leg(self, vectors: FloatArray) -> FloatArray:
        """Return free vectors (..., 3) of the leg frame in the base frame."""
        return self.mount.vectors_to_base(vectors)

    def rows_from_leg(self, matrix: FloatArray) -> FloatArray:
        """Return a matrix (..., 3, n) whose columns are free vectors in the base frame."""
        return self.mount.rotation @ matrix


def find_frame(robot: Robot, leg: Leg, frame_id: str) -> LegFrame:
    """Return the frame that a request names.

    Raises:
        RequestError: If it is neither the leg's own frame nor the robot's base frame.
        NotSupportedError: If it is the base frame and the foot's coordinates are not x, y, z.
    """
    if frame_id in ("", leg.frame):
        return LegFrame()
    if frame_id != robot.base_frame:
        raise RequestError(
            f"header.frame_id: unknown frame {frame_id!r}; allowed: '' or {leg.frame!r} (the leg's "
            f"own), {robot.base_frame!r} (the robot's base)"
        )
    if not leg.mechanism.has_point_foot:
        raise NotSupportedError(
            f"header.frame_id: {frame_id!r} needs a leg with coordinates x, y, z; {leg.name!r} has "
            f"{', '.join(leg.mechanism.task_coordinates)}: give positions in {leg.frame!r}"
        )
    return BaseFrame(leg.mount)
