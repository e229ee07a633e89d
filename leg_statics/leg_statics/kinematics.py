# SPDX-License-Identifier: Apache-2.0
"""Solved postures of a leg with their Jacobians: what all statics is computed from."""

from __future__ import annotations

from functools import cached_property

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism, Posture


class Kinematics:
    """Postures and their Jacobians, each computed once, and only if needed.

    Attributes:
        mechanism: The leg's mechanism.
        posture: Solved postures (...).
    """

    def __init__(self, mechanism: Mechanism, posture: Posture) -> None:
        self.mechanism = mechanism
        self.posture = posture

    @cached_property
    def twist_jacobian(self) -> FloatArray:
        """J above J_omega (..., t + 3, n)."""
        return self.mechanism.twist_jacobian(self.posture)

    @property
    def jacobian(self) -> FloatArray:
        """J of v = J q' (..., t, n)."""
        return self.twist_jacobian[..., :-3, :]

    @property
    def angular_jacobian(self) -> FloatArray:
        """J_omega of omega = J_omega q' (..., 3, n)."""
        return self.twist_jacobian[..., -3:, :]

    @cached_property
    def constraint_jacobian(self) -> FloatArray:
        """Constraint wrenches of the drive (..., c, 6)."""
        return self.mechanism.constraint_jacobian(self.posture)

    @cached_property
    def planar_jacobian(self) -> FloatArray:
        """Jacobian of the foot in the leg's plane (..., 2, 2)."""
        return self.mechanism.planar_jacobian(self.posture)
