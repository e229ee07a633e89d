# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models of any other chain, with or without loops, by Newton's method.

What the inverse tells with other than three actuated joints: with fewer, the joint positions whose
foot is nearest, if it is within 1 µm, otherwise UNREACHABLE; with more, those nearest to the
initial posture. A leg of two has the branches that the bends of its knee are; of one, the foot may
pass a place more than once, and one of the passes is told.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, StatusArray, as_array, wrapped_angles
from leg_kinematics.kernels.scalars import LIMIT_TOLERANCE
from leg_kinematics.mechanism import Posture
from leg_kinematics.mechanisms.model_leg import ModelLeg
from leg_kinematics.model import newton, solved
from leg_kinematics.model.equations import Equations
from leg_kinematics.model.leg_tree import WHOLE_TURN
from leg_kinematics.model.postures import (
    FEET_ARE_GIVEN,
    JOINTS_ARE_GIVEN,
    SAME,
    Postures,
    known_postures,
)
from leg_kinematics.status import Status


@dataclass(frozen=True)
class NewtonLeg(ModelLeg):
    """Any chain: followed from known postures, see `leg_kinematics.model.newton`."""

    @property
    def assembly_modes(self) -> tuple[str, ...]:
        """The branches of the given postures; the first is the default."""
        return tuple(name for name, _ in self.postures)

    @cached_property
    def _tables(self) -> dict[int, Postures]:
        return {}

    def _table(self, assembly_mode: str) -> Postures:
        """Return the known postures of a mode, reached when they are first needed."""
        index = self.mode_index(assembly_mode)
        if index not in self._tables:
            posture = np.array(self.postures[index][1])
            self._tables[index] = known_postures(self._equations, self.joint_limits, posture)
        return self._tables[index]

    def _branch(self, assembly_mode: str, signs: FloatArray) -> Equations:
        """Return the equations with what is a mode's own."""
        posture = np.array(self.postures[self.mode_index(assembly_mode)][1])
        return self._equations._replace(rest=posture[self._order[0]], signs=signs)

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot.

        With two or three actuators, where the loops close but the inverse of that foot is another
        posture, the posture is of another branch: SINGULAR. With one the foot may pass a place
        twice, with more than three it reaches a place in many postures: all are of one branch.
        """
        return self.forward_with_twist(joint_positions, assembly_mode)[0]

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` of the same points."""
        n = len(self.joints)
        given = as_array("joint_positions", joint_positions, n)
        goal = given.reshape(-1, n)
        table = self._table(assembly_mode)
        start = table.joints[table.nearest_to_joints(goal)]
        begin = start[:, self._order[0]]
        signs = np.array([table.signs[0], 0.0])
        with np.errstate(invalid="ignore"):  # infinite joint positions stay without an answer
            end = self._near_turn(goal, begin)
        q, foot, twist, _, status = newton.follow_postures(
            *self._branch(assembly_mode, signs), start, begin, end, JOINTS_ARE_GIVEN
        )
        q[:, self._order[0]] = goal
        solved = status == Status.OK
        status[solved] = self._limited(q[solved])
        if n in (2, 3):
            back = self._followed(foot[solved], assembly_mode)[0]
            same = np.abs(self._turned(back - q[solved])).max(axis=1, initial=0.0) <= SAME
            status[np.flatnonzero(solved)[~same]] = Status.SINGULAR
        posture = self._posture(q, foot, status, given.shape[:-1])
        return posture._replace(joint_positions=given), twist.reshape(*given.shape[:-1], 6, n)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the joints."""
        return self.inverse_with_twist(foot_position, assembly_mode)[0]

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        foot = as_array("foot_position", foot_position, 3)
        q, twist, status = self._followed(foot.reshape(-1, 3), assembly_mode)
        solved = status == Status.OK
        q[solved] = self._in_ranges(q[solved])
        status[solved] = self._limited(q[solved])
        batch = foot.shape[:-1]
        posture = self._posture(q, foot.reshape(-1, 3), status, batch)
        return posture._replace(foot_position=foot), twist.reshape(*batch, 6, len(self.joints))

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""
        return solved.twist_jacobian(*self._equations, self._all_joints(posture))

    def _followed(self, feet: FloatArray, mode: str) -> tuple[FloatArray, FloatArray, StatusArray]:
        """Return all joint positions (m, N), twists and status of feet (m, 3)."""
        table = self._table(mode)
        branch = self._branch(mode, table.signs)

        def followed(near: Any, feet: FloatArray) -> Any:
            known = table.joints[near], table.feet[near]
            q, _, twist, _, status = newton.follow_postures(*branch, *known, feet, FEET_ARE_GIVEN)
            return q, twist, status

        if len(self.joints) > 1:
            return followed(table.nearest_to_feet(feet), feet)
        passes = table.passes(feet)
        q, twist, status = followed(passes[:, 0], feet)
        for k in range(1, passes.shape[1]):
            missed = status == Status.UNREACHABLE
            q[missed], twist[missed], status[missed] = followed(passes[missed, k], feet[missed])
        return q, twist, status

    def _posture(
        self, q: FloatArray, foot: FloatArray, status: StatusArray, batch: tuple[int, ...]
    ) -> Posture:
        actuated, passive = self._order
        return Posture(
            q[:, actuated].reshape(*batch, len(actuated)),
            q[:, passive].reshape(*batch, len(passive)),
            foot.reshape(*batch, 3),
            status.reshape(batch),
        )

    @cached_property
    def _turning(self) -> Any:
        return np.array([joint.type == "revolute" for joint in self.tree.joints])

    def _turned(self, differences: FloatArray) -> FloatArray:
        """Return differences of all joints (m, N) without whole turns."""
        return np.where(self._turning, wrapped_angles(differences), differences)

    def _near_turn(self, goal: FloatArray, start: FloatArray) -> FloatArray:
        """Return actuated joints (m, n) by the whole turns nearest to others."""
        turning = self._turning[self._order[0]]
        return np.where(turning, start + wrapped_angles(goal - start), goal)

    def _in_ranges(self, q: FloatArray) -> FloatArray:
        """Return joint positions (m, N), the actuated ones by the turn that their range holds."""
        actuated, _ = self._order
        middle = self.joint_limits.mean(axis=1)
        q[:, actuated] = self._near_turn(
            q[:, actuated], np.broadcast_to(middle, (len(q), len(middle)))
        )
        return q

    def _limited(self, q: FloatArray) -> StatusArray:
        """Return the status of postures (m, N) on their branch."""
        actuated, passive = self._order
        status = np.full(len(q), Status.OK, dtype=np.uint8)
        rest = np.array(self.postures[0][1])
        excursions = self._turned(q - rest)[:, passive]
        for values, limits, code, turning in (
            (
                excursions,
                self.passive_joint_limits,
                Status.PASSIVE_JOINT_LIMIT,
                self._turning[passive],
            ),
            (q[:, actuated], self.joint_limits, Status.JOINT_LIMIT, self._turning[actuated]),
        ):
            endless = turning & (np.diff(limits, axis=1)[:, 0] >= WHOLE_TURN)
            within = (values >= limits[:, 0] - LIMIT_TOLERANCE) & (
                values <= limits[:, 1] + LIMIT_TOLERANCE
            )
            status[~(within | endless).all(axis=1)] = code
        return status
