# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models that are three revolute joints in a row, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.errors import GeometryError
from leg_kinematics.mechanism import Posture
from leg_kinematics.mechanisms.model_leg import ModelLeg
from leg_kinematics.model import three_revolute


@dataclass(frozen=True)
class SerialLeg(ModelLeg):
    """Three revolute joints in a row, of which two neighbours meet or are parallel."""

    @cached_property
    def assembly_modes(self) -> tuple[str, ...]:
        """The initial mode, and those with hip, knee or both bent the other way."""
        return flipped_modes(self.postures[0][0], ("hip", "knee"))

    @cached_property
    def _numbers(self) -> FloatArray:
        numbers = three_revolute.three_revolute_numbers(self.tree)
        if numbers is None:
            raise GeometryError("no two neighbouring axes of the leg meet or are parallel")
        numbers[three_revolute.MIDDLE] = self.joint_limits.mean(axis=1)
        return numbers

    @cached_property
    def _signs(self) -> FloatArray:
        """Signs of the levers in the initial posture: of the last joint solved, of the middle."""
        q = np.array(self.postures[0][1])
        foot, _ = three_revolute.forward(self._numbers, np.ones(2), self.joint_limits, q)
        levers = three_revolute.levers(self._numbers, q, foot)
        if not np.abs(levers).min() > three_revolute.DEAD_CENTRE:
            raise GeometryError(
                f"the initial posture {dict(zip(self.actuated, q.tolist(), strict=True))} is "
                "singular (a straight leg, or the foot on the axis of the hip): bend it"
            )
        return np.sign(levers)

    def _of_mode(self, assembly_mode: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        hip, knee = mode_signs(self, assembly_mode, ("hip", "knee"))
        from_foot = self._numbers[three_revolute.PLAN, 2] == 1.0
        flips = np.array([hip, knee] if from_foot else [knee, hip])
        return self._numbers, self._signs * flips, self.joint_limits

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot; a posture of another mode is SINGULAR."""
        q = as_array("joint_positions", joint_positions, 3)
        foot, status = three_revolute.forward(*self._of_mode(assembly_mode), q)
        return Posture(q, q[..., :0], foot, status)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the joints, in closed form."""
        foot = as_array("foot_position", foot_position, 3)
        q, status = three_revolute.inverse(*self._of_mode(assembly_mode), foot)
        return Posture(q, q[..., :0], foot, status)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        foot = as_array("foot_position", foot_position, 3)
        q, status, twist = three_revolute.inverse_with_twist(*self._of_mode(assembly_mode), foot)
        return Posture(q, q[..., :0], foot, status), twist

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, 3)."""
        return three_revolute.twist_jacobian(self._numbers, posture.joint_positions)
