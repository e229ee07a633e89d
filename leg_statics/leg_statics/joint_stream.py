# SPDX-License-Identifier: Apache-2.0
"""Joint states in, leg states out: the same for a live stream and for a recording.

A stream is made for a robot with the limits in force, and reads one message or many at once:

    stream = JointStream(robot, friction=0.4)
    states = stream.read(names, position, velocity, effort)   # one message: (N,) each
    states = stream.read(names, positions, velocities, efforts)   # T messages: (T, N) each
    states.load_capacity   # (..., L) of the L legs named in `states.legs`
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arguments import as_names, require
from leg_kinematics.arrays import FloatArray, as_array, as_non_negative
from leg_kinematics.errors import LegError, ShapeError, ValueRangeError
from leg_kinematics.robot import Robot
from leg_statics.capacity.problem import check_effort_limits
from leg_statics.joint_layout import JointLayout, LegGroup, joint_layout
from leg_statics.leg_state import LegStates, Surroundings, leg_states
from leg_statics.weight import LEVEL_GRAVITY

CONTACT_FORCE = 10.0  # N
KNOWN_LAYOUTS = 64  # kinds of joint state messages remembered


class JointStateError(LegError, ValueError):
    """A joint state message that cannot be used."""


class JointStream:
    """Turns joint states into the states of the legs whose joints they name.

    Joints are found by name, in any order; joints of no leg are ignored. What depends on the names
    and on the robot only is worked out once for each tuple of names.

    Args:
        robot: The robot, with the effort limits in force.
        friction: Friction coefficient of the ground for the load capacity.
        contact_force: Force against gravity by which a foot is on the ground [N].

    Raises:
        KindError: If it is no robot.
        ShapeError: If friction or contact force are not one number.
        ValueRangeError: If they are negative or NaN, or limits are NaN or reversed.
    """

    def __init__(self, robot: Robot, friction: float, contact_force: float = CONTACT_FORCE) -> None:
        require("robot", robot, Robot)
        self.robot = robot
        self.friction = _size("friction", friction)
        self.contact_force = _size("contact_force", contact_force)
        _, limits = robot.effort_limits()
        check_effort_limits(limits[:, 0], limits[:, 1])
        self._layouts: dict[tuple[str, ...], JointLayout] = {}

    def layout(self, names: Sequence[str]) -> JointLayout:
        """Return which legs a message with these joint names updates, and which lack joints.

        Raises:
            JointStateError: If a name appears more than once.
            KindError: If they are no names.
        """
        names = _as_tuple(names)
        try:
            known = self._layouts.get(names)
        except TypeError:  # what has no hash is no name
            known = None
        if known is not None:
            return known
        names = as_names("names", names)
        repeated = [name for name, count in Counter(names).items() if count > 1]
        if repeated:
            raise JointStateError(f"name: {', '.join(repeated)} appear more than once")
        if len(self._layouts) >= KNOWN_LAYOUTS:  # a stream whose names keep changing
            self._layouts.clear()
        self._layouts[names] = joint_layout(self.robot, names)
        return self._layouts[names]

    def read(
        self,
        names: Sequence[str],
        position: ArrayLike,
        velocity: ArrayLike = (),
        effort: ArrayLike = (),
        gravity: ArrayLike = LEVEL_GRAVITY,
    ) -> LegStates:
        """Return the states of all legs whose joints are named, in the order of the robot.

        Args:
            names: Names of N joints.
            position: Joint positions (..., N) [rad or m].
            velocity: Joint velocities (..., N) [rad/s or m/s]; empty if not known.
            effort: Joint efforts (..., N) [N.m or N]; empty if not known.
            gravity: Acceleration of gravity in the base frame (..., 3) [m/s²]; NaN if not known.

        Returns:
            States with the batch axes of the position; `legs` is empty if there is none to update.
            A leg with a position that is not finite has the status INVALID_INPUT.

        Raises:
            JointStateError: If a name appears more than once or a length is wrong.
            ShapeError: If gravity is no vector.
            ValueRangeError: If gravity is zero or infinite.
        """
        names = _as_tuple(names)
        layout = self.layout(names)
        fields = joint_fields(len(names), position, velocity, effort)
        down = as_array("gravity", gravity, 3)
        if not down.any(axis=-1).all():
            raise ValueRangeError("gravity must not be zero")
        around = Surroundings(self.friction, self.contact_force, down)
        parts = [self._group_states(group, around, *fields) for group in layout.groups]
        if len(parts) == 1:
            return parts[0]
        return _merged(parts, layout, fields[0].shape[:-1])

    def _group_states(
        self,
        group: LegGroup,
        around: Surroundings,
        position: FloatArray,
        velocity: FloatArray,
        effort: FloatArray,
    ) -> LegStates:
        positions, rates = position[..., group.columns], _rows(velocity, group)
        efforts = _rows(effort, group)
        if group.drives is not None:
            positions = group.drives.positions(positions)
            rates, efforts = group.drives.velocities(rates), group.drives.efforts(efforts)
        return leg_states(group, around, positions, rates, efforts)


class StampOrder:
    """Watches that the stamps of messages with the same joint names increase."""

    def __init__(self) -> None:
        self._last: dict[tuple[str, ...], int] = {}

    def advances(self, names: Sequence[str], stamp: int) -> bool:
        """Tell whether a message is later than the one before it.

        Args:
            names: Its joint names; messages with others are another stream.
            stamp: Its time [ns]; 0 if it has none, which is never out of order.
        """
        names = tuple(names)
        if len(self._last) >= KNOWN_LAYOUTS and names not in self._last:
            self._last.clear()
        last = self._last.get(names, 0)
        self._last[names] = stamp
        return stamp == 0 or stamp > last


def joint_fields(
    count: int, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike
) -> list[FloatArray]:
    """Return position, velocity and effort of joints as arrays (..., count), or (..., 0) if empty.

    Raises:
        JointStateError: If a length is wrong; only velocity and effort may be empty.
    """
    return [
        _field("position", position, count, may_be_empty=False),
        _field("velocity", velocity, count, may_be_empty=True),
        _field("effort", effort, count, may_be_empty=True),
    ]


def _size(name: str, value: float) -> float:
    """Return one number that is not negative.

    Raises:
        ShapeError: If there are several.
        ValueRangeError: If it is negative or NaN.
    """
    checked = as_non_negative(name, value)
    if checked.ndim:
        raise ShapeError(f"{name} must be one number, got shape {checked.shape}")
    return float(checked)


def _as_tuple(names: Sequence[str]) -> tuple[str, ...]:
    """Return names as a tuple; what is in a tuple is looked at when it is new."""
    return names if isinstance(names, tuple) else as_names("names", names)


def _field(name: str, values: ArrayLike, count: int, *, may_be_empty: bool) -> FloatArray:
    """Return a field of a message as an array (..., count), or (..., 0) if that is allowed."""
    array = as_array(name, values)
    length = array.shape[-1] if array.ndim else 1
    if length != count and not (length == 0 and may_be_empty):
        allowed = f"{count} values, one a name" + (", or none" if may_be_empty else "")
        raise JointStateError(f"{name}: got {length} values; allowed: {allowed}")
    return array


def _merged(parts: Sequence[LegStates], layout: JointLayout, batch: tuple[int, ...]) -> LegStates:
    """Return the states of several groups, or of none, as one in the order of the robot."""
    code, vector, number = ((), np.uint8), ((3,), np.float64), ((), np.float64)
    fields = (code, *[vector] * 3, code, *[number] * 5)
    nothing = LegStates((), (), *(np.empty((*batch, 0, *axes), kind) for axes, kind in fields))
    joints = [positions for part in parts for positions in part.joint_positions]
    arrays = (
        np.concatenate(fields, axis=len(batch)).take(layout.order, axis=len(batch))
        for fields in zip(*(part[2:] for part in (nothing, *parts)), strict=True)
    )
    return LegStates(layout.legs, tuple(joints[k] for k in layout.order), *arrays)


def _rows(values: FloatArray, group: LegGroup) -> FloatArray:
    """Return the values of the joints of each leg (..., L, n); NaN (n,) if there are none."""
    if values.shape[-1] == 0:
        return np.full(group.columns.shape[-1], np.nan)
    return values[..., group.columns]
