# SPDX-License-Identifier: Apache-2.0
"""What the nodes share in reading requests about grounds: friction, normal, loads and moments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from leg_msgs_py.arrays import from_field
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError, NotSupportedError
from leg_kinematics.nodes.frames import LegFrame
from leg_kinematics.nodes.requests import XYZ, RequestError
from leg_kinematics.robot import Leg, Robot
from leg_statics.contact import Contact
from leg_statics.grounds import Grounds, load_grounds
from leg_statics.weight import gravity_below

if TYPE_CHECKING:  # requests are read without ROS, too
    from leg_kinematics.nodes.robot_node import RobotNode

NO_MOMENT = (0.0, 0.0, 0.0)


def declare_grounds(node: RobotNode) -> Grounds:
    """Declare the parameter `grounds` of a node and load the file that it names.

    Raises:
        DescriptionError: If the file is missing or wrong.
    """
    node.declare(
        "grounds",
        "grounds",
        "Grounds that requests may name: path of a YAML file, or 'grounds' for the shipped one.",
        read_only=True,
    )
    source = node.value("grounds")
    if not source:
        raise DescriptionError("parameter grounds: got ''; allowed: the path of a YAML file")
    return load_grounds(source)


def standing_leg(robot: Robot, name: str) -> Leg:
    """Return a leg by its name.

    Raises:
        UnknownNameError: If there is no such leg.
        NotSupportedError: If it does not end in a foot that the ground could push.
    """
    leg = robot.leg(name)
    if not leg.mechanism.has_point_foot:
        raise NotSupportedError(
            f"{leg.name}: mechanism {leg.mechanism.name!r} has the coordinates "
            f"{', '.join(leg.mechanism.task_coordinates)}; ground reactions need x, y, z"
        )
    return leg


def standing_legs(robot: Robot, names: Sequence[str]) -> list[Leg]:
    """Return legs by their names.

    Raises:
        UnknownNameError: If there is no leg of a name.
        NotSupportedError: If one does not end in a foot that the ground could push.
        RequestError: If a leg is named twice.
    """
    for name in names:
        if names.count(name) > 1:
            raise RequestError(f"legs: {name!r} is given twice; allowed: once each")
    return [standing_leg(robot, name) for name in names]


class GroundRows(NamedTuple):
    """Grounds of a request, in its frame: what is one for all is a number or tuple, else an array.

    Attributes:
        friction: Friction coefficient, or N of them.
        normal: Normal (3,), or (N, 3); None = level.
    """

    friction: float | FloatArray
    normal: tuple[float, ...] | FloatArray | None


class Contacts(NamedTuple):
    """Contacts of the N candidates of a request, in its frame; see `GroundRows`.

    Attributes:
        ground: The grounds.
        load: Required load [N].
        moment: Moment of the ground on the foot (3,) [N.m].
        any_direction_moment: Further moment of unknown direction [N.m].
        bias_efforts: Efforts that the actuators exert anyway, of the most joints of these legs
            (n,) [N.m or N].
        gravity: Gravity (3,) [m/s²]; None = down the frame of the request.
        along_normal: Whether loads count along the normal.
    """

    ground: GroundRows
    load: float | FloatArray
    moment: tuple[float, ...] | FloatArray
    any_direction_moment: float | FloatArray
    bias_efforts: tuple[float, ...] | FloatArray
    gravity: tuple[float, ...] | None
    along_normal: bool

    def of(self, leg: Leg, frame: LegFrame, rows: slice) -> Contact:
        """Return the contact of the candidates of a leg, which stand in some rows."""
        gravity = turned(frame, self.gravity) or gravity_below(frame.vertical)
        normal = turned(frame, _part(self.ground.normal, rows))
        bias, n = _part(self.bias_efforts, rows), len(leg.joint_names)
        return Contact(
            _part(self.ground.friction, rows),
            normal,
            _part(self.load, rows),
            cast(ArrayLike, turned(frame, _part(self.moment, rows))),
            _part(self.any_direction_moment, rows),
            bias[:n] if isinstance(bias, tuple) else bias[:, :n],
            gravity,
            normal if self.along_normal else None,
        )


def read_contacts(grounds: Grounds, request: Any, count: int, joints: Sequence[str]) -> Contacts:
    """Return the contacts of the candidates of a `leg_msgs/QueryFootholds`.

    Args:
        grounds: The grounds that it may name.
        request: The request.
        count: Number of its candidates.
        joints: Names of the most joints of its legs.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If a field has the wrong length, or a value is out of range.
    """
    directions = request.AGAINST_GRAVITY, request.ALONG_NORMAL
    if request.load_direction not in directions:
        raise RequestError(
            f"load_direction: got {request.load_direction}; allowed: {directions[0]} "
            f"(AGAINST_GRAVITY), {directions[1]} (ALONG_NORMAL)"
        )
    moment = _vectors("required_moment", request.required_moment, XYZ, count)
    bias = _vectors("bias_efforts", request.bias_efforts, joints, count)
    return Contacts(
        read_grounds(grounds, request.ground, count),
        _sizes("required_load", request.required_load, count, "N"),
        NO_MOMENT if moment is None else moment,
        _sizes("any_direction_moment", request.any_direction_moment, count, "N.m"),
        (0.0,) * len(joints) if bias is None else bias,
        read_gravity(request),
        request.load_direction == request.ALONG_NORMAL,
    )


def read_grounds(grounds: Grounds, ground: Any, count: int) -> GroundRows:
    """Return a `leg_msgs/Ground` that may have one ground for each of `count` candidates.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If friction or normals are out of range, or there is no ground.
    """
    friction = _friction(grounds, ground, count)
    return GroundRows(friction, _vectors("ground.normals", ground.normals, XYZ, count))


def read_ground(grounds: Grounds, ground: Any, frame: LegFrame) -> Contact:
    """Return a `leg_msgs/Ground` that must be one ground as an unloaded contact.

    Raises:
        UnknownNameError: If it names an unknown ground.
        RequestError: If friction or normal are out of range, or there is no ground.
    """
    rows = read_grounds(grounds, ground, 1)
    return Contact(rows.friction, turned(frame, rows.normal))


def is_ground(ground: Any) -> bool:
    """Tell whether a `leg_msgs/Ground` says anything of a ground."""
    return bool(ground.name) or len(ground.friction_coefficients) + len(ground.normals) > 0


def read_gravity(request: Any) -> tuple[float, ...] | None:
    """Return gravity in the frame of a request (3,) [m/s²]; None if it does not tell.

    Raises:
        RequestError: If it is not finite.
    """
    given = finite("gravity", request.gravity)
    return tuple(given.tolist()) if given.any() else None


def gravity_in_leg(frame: LegFrame, request: Any) -> tuple[float, ...]:
    """Return gravity in the frame of the leg that a request is about (3,) [m/s²].

    Raises:
        RequestError: If it is not finite.
    """
    return turned(frame, read_gravity(request)) or gravity_below(frame.vertical)


def turned(frame: LegFrame, vectors: Any) -> Any:
    """Return vectors of a request in the leg frame: a tuple of a tuple, an array, None of None.

    What is known of a contact of tuples is kept.
    """
    if vectors is None:
        return None
    found = frame.vectors_to_leg(np.asarray(vectors))
    return tuple(found.tolist()) if isinstance(vectors, tuple) else found


def _part(values: Any, rows: slice) -> Any:
    """Return some rows of an array; what is one for all is returned as it is."""
    return values[rows] if isinstance(values, np.ndarray) else values


def _sizes(field: str, values: Any, count: int, unit: str) -> float | FloatArray:
    """Return a field with a size for all candidates or for each; 0 if it is empty."""
    numbers = _each(field, values, 1, count)
    check_values(field, numbers, (numbers >= 0.0) & (numbers < np.inf), f"finite and >= 0 {unit}")
    return float(numbers[0]) if len(numbers) == 1 else numbers if len(numbers) else 0.0


def _vectors(
    field: str, values: Any, columns: Sequence[str], count: int
) -> tuple[float, ...] | FloatArray | None:
    """Return a field with a vector for all candidates or for each; None if it is empty."""
    width = len(columns)
    numbers = _each(field, values, width, count, columns)
    check_values(field, numbers, np.isfinite(numbers), "finite values")
    if len(numbers) == width:
        return tuple(numbers.tolist())
    return numbers.reshape(count, width) if len(numbers) else None


def _each(
    field: str, values: Any, width: int, count: int, columns: Sequence[str] = ()
) -> FloatArray:
    """Return the numbers of a field that has none, those of all candidates, or those of each.

    Raises:
        RequestError: If their number is another one.
    """
    if len(values) not in (0, width, width * count):
        each = f" ({', '.join(columns)})" if columns else ""
        several = f", or {width * count} for the {count}" if count > 1 else ""
        raise RequestError(
            f"{field}: got {len(values)} values; allowed: none, {width}{each}{several}"
        )
    numbers: FloatArray = from_field(values)
    return numbers


def check_values(field: str, numbers: FloatArray, good: Any, allowed: str) -> None:
    """Raise a RequestError that tells the first of a field's numbers that is not good."""
    if not good.all():
        k = int(np.argmin(good))
        where = f"[{k}]" if len(numbers) > 1 else ""
        raise RequestError(f"{field}{where}: got {numbers[k]}; allowed: {allowed}")


def _friction(grounds: Grounds, ground: Any, count: int) -> float | FloatArray:
    told = ground.friction_coefficients
    if ground.name:
        if len(told):
            raise RequestError(
                f"ground: name {ground.name!r} and friction_coefficients ({len(told)} values) are "
                "both given; allowed: one of them"
            )
        found = grounds.find(ground.name)
        return found.friction_high if ground.use_high_end else found.friction_low
    if not len(told) and not count:
        return 0.0  # under no candidates
    if not len(told):
        raise RequestError(
            "ground: neither name nor friction_coefficients are given; allowed: a name "
            f"({', '.join(grounds.by_name)}), or friction coefficients >= 0"
        )
    numbers = _each("ground.friction_coefficients", told, 1, count)
    allowed = ">= 0, infinity included"
    check_values("ground.friction_coefficients", numbers, numbers >= 0.0, allowed)
    return float(numbers[0]) if len(numbers) == 1 else numbers


def magnitude(field: str, value: float, unit: str) -> float:
    """Return a number of a request that is a size.

    Raises:
        RequestError: If it is negative or not finite.
    """
    if not 0.0 <= value < np.inf:
        raise RequestError(f"{field}: got {value}; allowed: finite and >= 0 {unit}")
    return float(value)


def finite(field: str, values: Any) -> FloatArray:
    """Return the numbers of a field.

    Raises:
        RequestError: If one of them is not finite.
    """
    numbers: FloatArray = from_field(values)
    check_values(field, numbers, np.isfinite(numbers), "finite values")
    return numbers
