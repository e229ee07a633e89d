"""The mirror image of a mechanism, so that left and right legs share one geometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.mechanism import (
    Linkage,
    Mechanism,
    Posture,
    forward_with_twist,
    inverse_with_twist,
    twist_jacobian,
)

# Reflection at the plane x = 0: a vector keeps its y and z, an axial vector (rotation, moment)
# keeps its x.
VECTOR = np.array([-1.0, 1.0, 1.0])
AXIAL = np.array([1.0, -1.0, -1.0])
VECTOR_ROWS, AXIAL_ROWS = VECTOR[:, None], AXIAL[:, None]  # of Jacobians
TWIST_ROWS = np.concatenate([VECTOR_ROWS, AXIAL_ROWS])


def without_reflection(mechanism: Mechanism) -> tuple[Mechanism, FloatArray]:
    """Return the mechanism that is reflected, and the signs (3,) of its vectors' components.

    Legs on both sides of a robot share that mechanism, so that they can be computed in one call.
    """
    if isinstance(mechanism, Mirrored):
        return mechanism.original, VECTOR
    return mechanism, np.ones(3)


@dataclass(frozen=True)
class Mirrored:
    """A mechanism reflected at x = 0; the leg frame stays right-handed.

    Joint positions keep their meaning: an actuator whose axis is parallel to x turns the same way
    in the mirror image, and stands on the other side.

    Attributes:
        original: The mechanism that is reflected.
    """

    original: Mechanism

    def __post_init__(self) -> None:
        """Refuse what has no point foot to reflect.

        Raises:
            NotSupportedError: If the task coordinates are not x, y, z.
        """
        if tuple(self.original.task_coordinates) != ("x", "y", "z"):
            raise NotSupportedError(
                f"mechanism {self.original.name!r} has no point foot and cannot be mirrored"
            )

    def __getattr__(self, name: str) -> Any:
        """Take what a reflection does not change (names, joints, limits ...) from the original."""
        if name.startswith("__") or name == "original":
            raise AttributeError(name)
        return getattr(self.original, name)

    @property
    def initial_posture(self) -> Posture:
        """The mirror image of the reference posture."""
        return _reflected(self.original.initial_posture)

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot; see `Mechanism.forward`."""
        return _reflected(self.original.forward(joint_positions, assembly_mode))

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the actuators; see `Mechanism.inverse`."""
        foot = as_array("foot_position", foot_position, 3)
        q, closure, _, status = self.original.inverse(foot * VECTOR, assembly_mode)
        return Posture(q, closure, foot, status)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` in one pass."""
        foot = as_array("foot_position", foot_position, 3)
        (q, closure, _, status), twist = inverse_with_twist(
            self.original, foot * VECTOR, assembly_mode
        )
        return Posture(q, closure, foot, status), TWIST_ROWS * twist

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` in one pass."""
        posture, twist = forward_with_twist(self.original, joint_positions, assembly_mode)
        return _reflected(posture), TWIST_ROWS * twist

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""
        return TWIST_ROWS * twist_jacobian(self.original, _reflected(posture))

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q' (..., 3, n)."""
        return VECTOR_ROWS * self.original.jacobian(_reflected(posture))

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q' (..., 3, n)."""
        return AXIAL_ROWS * self.original.angular_jacobian(_reflected(posture))

    def acceleration(
        self, posture: Posture, joint_velocities: ArrayLike, joint_accelerations: ArrayLike
    ) -> FloatArray:
        """Acceleration of the foot (..., 3), for mechanisms that offer it."""
        original: Any = self.original
        acceleration: FloatArray = original.acceleration(
            _reflected(posture), joint_velocities, joint_accelerations
        )
        return VECTOR * acceleration

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints (..., p)."""
        return self.original.passive_joint_positions(_reflected(posture))

    def constraint_jacobian(self, posture: Posture) -> FloatArray:
        """Constraint wrenches (..., c, 6): force part, then moment part."""
        original: Any = self.original
        jacobian: FloatArray = original.constraint_jacobian(_reflected(posture))
        return np.concatenate([VECTOR, AXIAL]) * jacobian

    def linkage(self, posture: Posture) -> Linkage:
        """Points and bars of the leg in this posture."""
        linkage = self.original.linkage(_reflected(posture))
        return linkage._replace(points=linkage.points * VECTOR)


def _reflected(posture: Posture) -> Posture:
    return posture._replace(foot_position=posture.foot_position * VECTOR)
