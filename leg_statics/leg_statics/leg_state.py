# SPDX-License-Identifier: Apache-2.0
"""The state of legs at given joint positions: where the feet are and what they can carry."""

# The compiler infers the types of the kernel below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray, StatusArray
from leg_kinematics.conditioning import condition_of_point
from leg_kinematics.kernels.kernel import kernel
from leg_kinematics.kernels.vectors import cross, inner
from leg_kinematics.status import Status
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import utilisation_of_point
from leg_statics.indices import force_slopes
from leg_statics.joint_layout import LegGroup
from leg_statics.weight import LEVEL_GRAVITY, weight_efforts

OK = int(Status.OK)


class ContactState(IntEnum):
    """Whether a foot is on the ground.

    Attributes:
        UNKNOWN: The force of the ground is not known, or which way is up.
        IN_THE_AIR: It bears less than a force that tells contact.
        ON_THE_GROUND: It bears at least that.
    """

    UNKNOWN = 0
    IN_THE_AIR = 1
    ON_THE_GROUND = 2


UNKNOWN, IN_THE_AIR, ON_THE_GROUND = map(int, ContactState)


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
        ground_force: Force of the ground on the feet that balances the joint efforts, and the legs'
            own weight if their masses are known, as if the legs were at rest (..., L, 3) [N]; NaN
            where status is not OK, if the efforts are not known, or without three actuators.
        contact: `ContactState` of the feet (..., L).
        load_capacity: Greatest ground reaction against gravity, on level ground (..., L) [N], the
            legs' own weight borne if their masses are known; NaN where status is not OK, or if
            gravity is not known.
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
    ground_force: FloatArray
    contact: StatusArray
    condition_number: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    utilisation: FloatArray


class Surroundings(NamedTuple):
    """What is around the legs.

    Attributes:
        friction: Friction coefficient of the ground for the load capacity, >= 0.
        contact_force: Force against gravity that tells contact [N].
        gravity: Acceleration of gravity in the base frame (..., 3) [m/s²]; NaN if it is not known.
    """

    friction: float
    contact_force: float
    gravity: FloatArray


def leg_states(
    group: LegGroup,
    around: Surroundings,
    joint_positions: FloatArray,
    joint_velocities: FloatArray,
    joint_efforts: FloatArray,
) -> LegStates:
    """Return the states of the legs of a group, in one pass over the kinematics and the statics.

    Args:
        group: L legs with n joints.
        around: What is around them.
        joint_positions: Actuated joints (..., L, n) [rad or m].
        joint_velocities: Joint velocities (..., L, n) [rad/s or m/s]; NaN if not known.
        joint_efforts: Present joint efforts (..., L, n) [N.m or N]; NaN if not known.
    """
    posture, twist = group.mechanism.forward_with_twist(joint_positions)
    jacobian = twist[..., :3, :]
    known = np.asarray(np.isfinite(around.gravity).all(axis=-1))[..., None]
    gravity = group.from_base(np.where(known, around.gravity, LEVEL_GRAVITY))
    weight = weight_efforts(group.mechanism, posture, gravity)
    borne = load_capacity(
        jacobian,
        group.lower,
        group.upper,
        around.friction,
        normal=-gravity,
        vertical=-gravity,
        bias_efforts=weight,
    )
    rates, idle = joint_velocities, weight
    if group.mechanism.has_masses:
        idle = np.where(known[..., None], weight, np.nan)
    velocity, force, load, condition, mu_e, mu_full, used = _leg_states(
        jacobian,
        posture.status,
        group.lower,
        group.upper,
        np.where(known[..., None], gravity, np.nan),
        rates,
        joint_efforts,
        idle,
    )
    contact = np.where(load >= around.contact_force, ON_THE_GROUND, IN_THE_AIR)
    return LegStates(
        legs=group.legs,
        joint_positions=tuple(np.moveaxis(joint_positions, -2, 0)),
        status=posture.status,
        foot_position=group.signs * posture.foot_position,
        foot_velocity=group.signs * velocity,
        ground_force=group.signs * force,
        contact=np.where(np.isnan(load), UNKNOWN, contact).astype(np.uint8),
        condition_number=condition,
        load_capacity=np.where((posture.status == Status.OK) & known, borne.capacity, np.nan),
        rated_friction=mu_e,
        rated_friction_full=mu_full,
        utilisation=used,
    )


def vectors_in_base(rotation: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return free vectors (..., 3) of leg frames in the base frame, one or many by the same bits.

    Args:
        rotation: Rotations of the legs' mounts (..., 3, 3).
        vectors: The vectors (..., 3).
    """
    x, y, z = np.moveaxis(vectors, -1, 0)[..., None]
    turned: FloatArray = rotation[..., 0] * x + rotation[..., 1] * y + rotation[..., 2] * z
    return turned


@kernel(
    "(d,n),(),(n),(n),(d),(n),(n),(n)->(d),(d),(),(),(),(),()",
    "f8[:,:], u1, f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]"
    ", f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _leg_states(
    jacobian,
    status,
    lower,
    upper,
    gravity,
    rates,
    efforts,
    idle,
    velocity,
    force,
    load,
    condition,
    mu_e,
    mu_full,
    used,
):
    """One leg without reflection; what is reflected is its vectors only."""
    for i in range(3):
        velocity[i], force[i] = 0.0, math.nan
        for k in range(len(rates)):
            velocity[i] += jacobian[i, k] * rates[k]
    used[0], _ = utilisation_of_point(efforts, lower, upper)
    condition[0], mu_e[0], mu_full[0], load[0] = math.nan, math.nan, math.nan, math.nan
    if status == OK and len(rates) == 3:
        condition[0] = condition_of_point(jacobian)
        x_slope, y_slope = force_slopes(jacobian)
        mu_e[0], mu_full[0] = abs(x_slope), math.hypot(x_slope, y_slope)
        a = jacobian[0, 0], jacobian[1, 0], jacobian[2, 0]
        b = jacobian[0, 1], jacobian[1, 1], jacobian[2, 1]
        c = jacobian[0, 2], jacobian[1, 2], jacobian[2, 2]
        normals = cross(b, c), cross(c, a), cross(a, b)  # Jᵀ F = idle - efforts, by Cramer's rule
        volume = inner(a, normals[0])
        if volume != 0.0:
            for i in range(3):
                force[i] = 0.0
                for k in range(3):
                    force[i] += normals[k][i] * (idle[k] - efforts[k]) / volume
            down = math.sqrt(inner(gravity, gravity))
            load[0] = -inner(force, gravity) / down
