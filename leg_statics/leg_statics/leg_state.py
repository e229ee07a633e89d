# SPDX-License-Identifier: Apache-2.0
"""The state of legs at given joint positions: where the feet are and what they can carry."""

# The compiler infers the types of the kernel below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray, StatusArray
from leg_kinematics.conditioning import condition_of_point
from leg_kinematics.kernels.kernel import kernel
from leg_kinematics.status import Status
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation_of_point
from leg_statics.indices import force_slopes
from leg_statics.joint_layout import LegGroup
from leg_statics.weight import weight_efforts

OK = int(Status.OK)


class LegStates(NamedTuple):
    """State of L legs, at one moment or at many.

    Attributes:
        legs: Names of the legs (L).
        joint_positions: Actuated joints, one array (..., n) a leg [rad or m].
        status: `Status` of the poses (..., L).
        foot_position: Feet in the leg frames (..., L, 3) [m]; NaN where there is no pose.
        foot_velocity: Their velocities (..., L, 3) [m/s]; NaN if the joints' are not known.
        condition_number: Condition number of the Jacobian (..., L); NaN where status is not OK, or
            if the Jacobian is not square.
        load_capacity: Greatest vertical ground reaction, along z of the base frame, on level ground
            (..., L) [N], the legs' own weight borne if their masses are known; NaN where status is
            not OK.
        rated_friction: mu_e = |F_x / F_z|, forward over vertical (..., L); NaN as the condition
            number.
        rated_friction_full: sqrt(F_x² + F_y²) / F_z of the same force (..., L).
        utilisation: Largest effort / effort limit (..., L); NaN if the efforts are not known.
    """

    legs: tuple[str, ...]
    joint_positions: tuple[FloatArray, ...]
    status: StatusArray
    foot_position: FloatArray
    foot_velocity: FloatArray
    condition_number: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    utilisation: FloatArray


def leg_states(
    group: LegGroup,
    friction: float,
    joint_positions: FloatArray,
    joint_velocities: FloatArray,
    joint_efforts: FloatArray,
) -> LegStates:
    """Return the states of the legs of a group, in one pass over the kinematics and the statics.

    Args:
        group: L legs with n joints.
        friction: Friction coefficient of the ground for the load capacity, >= 0.
        joint_positions: Actuated joints (..., L, n) [rad or m].
        joint_velocities: Joint velocities (..., L, n) [rad/s or m/s]; NaN if not known.
        joint_efforts: Present joint efforts (..., L, n) [N.m or N]; NaN if not known.
    """
    posture, twist = group.mechanism.forward_with_twist(joint_positions)
    jacobian = twist[..., :3, :]
    weight = weight_efforts(group.mechanism, posture, group.gravity)
    borne = load_capacity(
        jacobian,
        group.lower,
        group.upper,
        friction,
        normal=-group.gravity,
        vertical=-group.gravity,
        bias_efforts=weight,
    )
    velocity, condition, mu_e, mu_full, used = _leg_states(
        jacobian, posture.status, group.lower, group.upper, joint_velocities, joint_efforts
    )
    return LegStates(
        legs=group.legs,
        joint_positions=tuple(np.moveaxis(joint_positions, -2, 0)),
        status=posture.status,
        foot_position=group.signs * posture.foot_position,
        foot_velocity=group.signs * velocity,
        condition_number=condition,
        load_capacity=np.where(posture.status == Status.OK, borne.capacity, np.nan),
        rated_friction=mu_e,
        rated_friction_full=mu_full,
        utilisation=used,
    )


@kernel(
    "(d,n),(),(n),(n),(n),(n)->(d),(),(),(),()",
    "f8[:,:], u1, f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _leg_states(
    jacobian, status, lower, upper, rates, efforts, velocity, condition, mu_e, mu_full, used
):
    """One leg without reflection; what is reflected is its velocity only."""
    for i in range(3):
        velocity[i] = 0.0
        for k in range(len(rates)):
            velocity[i] += jacobian[i, k] * rates[k]
    used[0], _ = utilisation_of_point(efforts, lower, upper)
    condition[0], mu_e[0], mu_full[0] = math.nan, math.nan, math.nan
    if status == OK and len(rates) == 3:
        condition[0] = condition_of_point(jacobian)
        x_slope, y_slope = force_slopes(jacobian)
        mu_e[0], mu_full[0] = abs(x_slope), math.hypot(x_slope, y_slope)
