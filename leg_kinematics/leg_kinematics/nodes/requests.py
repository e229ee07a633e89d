# SPDX-License-Identifier: Apache-2.0
"""What the nodes share in reading requests: points, and errors as codes of leg_msgs."""

from __future__ import annotations

from typing import Any

from leg_msgs.msg import ErrorCode
from leg_msgs_py.arrays import from_field

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import LegError, NotSupportedError, UnknownNameError
from leg_kinematics.robot import Leg

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
