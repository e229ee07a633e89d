# SPDX-License-Identifier: Apache-2.0
"""The mirror image of a mechanism, so that left and right legs share one geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.mechanism import Excursion, Joint, Linkage, Mechanism, Posture

# Reflection at the plane y = 0: a vector keeps its x and z, an axial vector (rotation, moment)
# keeps its y.
VECTOR = np.array([1.0, -1.0, 1.0])
AXIAL = -VECTOR
WRENCH = np.concatenate([VECTOR, AXIAL])
VECTOR_ROWS, AXIAL_ROWS = VECTOR[:, None], AXIAL[:, None]  # of Jacobians
TWIST_ROWS = WRENCH[:, None]


def without_reflection(mechanism: Mechanism) -> tuple[Mechanism, FloatArray]:
    """Return the mechanism that is reflected, and the signs (3,) of its vectors' components.

    Legs on both sides of a robot share that mechanism, so that they can be computed in one call.
    """
    if isinstance(mechanism, Mirrored):
        return mechanism.original, VECTOR
    return mechanism, np.ones(3)


@dataclass(frozen=True)
class Mirrored(Mechanism):
    """A mechanism reflected at y = 0; the leg frame stays right-handed.

    Joint positions keep their meaning: an actuator whose axis is parallel to y turns the same way
    in the mirror image, and stands on the other side. What else a mechanism has beyond the protocol
    is asked of its `original`.

    Attributes:
        original: The mechanism that is reflected.
    """

    original: Mechanism

    def __post_init__(self) -> None:
        """Refuse what has no point foot to reflect.

        Raises:
            KindError: If it is no mechanism.
            NotSupportedError: If the task coordinates are not x, y, z.
        """
        require("original", self.original, Mechanism)
        if not self.original.has_point_foot:
            raise NotSupportedError(
                f"mechanism {self.original.name!r} has no point foot and cannot be mirrored"
            )

    # ------------------------------------------------------------- what a reflection keeps

    @property
    def name(self) -> str:
        """Name of the kind of mechanism."""
        return self.original.name

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The actuated joints (n)."""
        return self.original.joints

    @property
    def passive_joints(self) -> tuple[Joint, ...]:
        """The passive joints (p)."""
        return self.original.passive_joints

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """What the limits of the passive joints bound (e)."""
        return self.original.excursions

    @property
    def closure_names(self) -> tuple[str, ...]:
        """Names of the dependent coordinates that close the loops."""
        return self.original.closure_names

    @property
    def assembly_modes(self) -> tuple[str, ...]:
        """Names of the branches of the closed chain."""
        return self.original.assembly_modes

    @property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""
        return self.original.joint_limits

    @property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the excursions of the passive joints (e, 2) [rad or m]."""
        return self.original.passive_joint_limits

    @property
    def has_masses(self) -> bool:
        """Whether the masses of the links are known."""
        return self.original.has_masses

    def offers(self, ability: Callable[..., Any]) -> bool:
        """Tell whether the mechanism has an optional ability."""
        return self.original.offers(ability)

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Positions of the passive joints about the mirror images of their axes (..., p)."""
        return self.original.passive_joint_positions(_reflected(posture))

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints (..., e)."""
        return self.original.passive_joint_excursions(_reflected(posture))

    def positions_by_name(self, posture: Posture) -> dict[str, FloatArray]:
        """Positions of all joints by name (...)."""
        return self.original.positions_by_name(_reflected(posture))

    def planar_jacobian(self, posture: Posture) -> FloatArray:
        """Jacobian of the foot in the leg's plane (..., 2, 2): forward and up are kept."""
        return self.original.planar_jacobian(_reflected(posture))

    # ------------------------------------------------------------- what it turns round

    def holding_efforts(self, posture: Posture, gravity: ArrayLike) -> FloatArray:
        """Efforts that hold the links' own weight (..., n) [N.m or N]."""
        vector = as_array("gravity", gravity, 3)
        return self.original.holding_efforts(_reflected(posture), vector * VECTOR)

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """The mirror images of the leg's bodies."""
        return self.original.body_tree(assembly_mode).reflected()

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
        return _reflected(self.original.inverse(foot * VECTOR, assembly_mode))

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        foot = as_array("foot_position", foot_position, 3)
        posture, twist = self.original.inverse_with_twist(foot * VECTOR, assembly_mode)
        return _reflected(posture), TWIST_ROWS * twist

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` of the same points."""
        posture, twist = self.original.forward_with_twist(joint_positions, assembly_mode)
        return _reflected(posture), TWIST_ROWS * twist

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""
        return TWIST_ROWS * self.original.twist_jacobian(_reflected(posture))

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q' (..., 3, n)."""
        return VECTOR_ROWS * self.original.jacobian(_reflected(posture))

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q' (..., 3, n)."""
        return AXIAL_ROWS * self.original.angular_jacobian(_reflected(posture))

    def acceleration(
        self, posture: Posture, joint_velocities: ArrayLike, joint_accelerations: ArrayLike
    ) -> FloatArray:
        """Acceleration of the foot (..., 3) [m/s²]."""
        acceleration = self.original.acceleration(
            _reflected(posture), joint_velocities, joint_accelerations
        )
        return VECTOR * acceleration

    def constraint_jacobian(self, posture: Posture) -> FloatArray:
        """Constraint wrenches (..., c, 6): force part, then moment part."""
        return WRENCH * self.original.constraint_jacobian(_reflected(posture))

    def linkage(self, posture: Posture) -> Linkage:
        """Points and bars of the leg in this posture."""
        linkage = self.original.linkage(_reflected(posture))
        return linkage._replace(points=linkage.points * VECTOR)


def _reflected(posture: Posture) -> Posture:
    q, closure, foot, status = posture
    return Posture(q, closure, foot * VECTOR, status)
