"""The state of legs at their present joint positions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, StatusArray, as_array
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.status import Status
from leg_statics.capacity import load_capacity
from leg_statics.efforts import utilisation
from leg_statics.indices import evaluate_indices, supported_indices


class LegStates(NamedTuple):
    """State of L legs with the same mechanism.

    Attributes:
        status: `Status` of the present poses (L,).
        foot_position: Feet in the leg frames (L, 3) [m]; NaN where there is no pose.
        foot_velocity: Their velocities (L, 3) [m/s]; NaN if the joints' are not known.
        condition_number: Condition number of the Jacobian (L,); NaN where status is not OK.
        load_capacity: Greatest vertical ground reaction (L,) [N]; NaN where status is not OK.
        rated_friction: mu_e (L,); NaN where status is not OK or the mechanism has none.
        utilisation: Largest effort / effort limit (L,); NaN if the efforts are not known.
    """

    status: StatusArray
    foot_position: FloatArray
    foot_velocity: FloatArray
    condition_number: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    utilisation: FloatArray


def leg_states(
    mechanism: Mechanism,
    joint_positions: ArrayLike,
    effort_limits: ArrayLike,
    friction: float,
    joint_velocities: ArrayLike | None = None,
    joint_efforts: ArrayLike | None = None,
) -> LegStates:
    """Return the state of legs that share a mechanism.

    Args:
        mechanism: The mechanism of all these legs.
        joint_positions: Actuated joints (L, n) [rad or m].
        effort_limits: Least and greatest efforts of each leg's joints (L, n, 2) [N.m or N].
        friction: Friction coefficient of the ground for the load capacity.
        joint_velocities: Joint velocities (L, n) [rad/s or m/s]; None if not known.
        joint_efforts: Present joint efforts (L, n) [N.m or N]; None if not known.

    Raises:
        ShapeError: If shapes do not fit.
        ValueRangeError: If friction is negative or NaN.
    """
    n = len(mechanism.joints)
    posture = mechanism.forward(joint_positions)
    limits = as_array("effort_limits", effort_limits, n, 2)
    jacobian = mechanism.jacobian(posture)[..., :3, :]  # a manipulator turns as well: leave it out
    bad = posture.status != Status.OK
    unknown: FloatArray = np.full(len(bad), np.nan)

    velocity: FloatArray = np.full((len(bad), 3), np.nan)
    if joint_velocities is not None:
        rates = as_array("joint_velocities", joint_velocities, n)
        velocity = np.einsum("...in,...n->...i", jacobian, rates)
    used: FloatArray = unknown
    if joint_efforts is not None:
        efforts = as_array("joint_efforts", joint_efforts, n)
        used, _ = utilisation(efforts, limits)

    names = set(supported_indices(mechanism)) & {"condition_number", "rated_friction"}
    indices = {name: evaluate_indices(mechanism, posture, [name])[1][..., 0] for name in names}
    capacity = load_capacity(jacobian, limits[..., 0], limits[..., 1], friction).capacity
    return LegStates(
        status=posture.status,
        foot_position=posture.foot_position[..., :3],
        foot_velocity=velocity,
        condition_number=indices.get("condition_number", unknown),
        load_capacity=np.where(bad, np.nan, capacity),
        rated_friction=indices.get("rated_friction", unknown),
        utilisation=used,
    )
