"""Footholds: can the leg reach it, what does it carry there, and if not enough, why not."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import FloatArray, StatusArray, as_array, as_matching, as_non_negative
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.kernel import kernel, scalar
from leg_kinematics.mechanism import Mechanism, Posture, inverse_with_jacobians
from leg_kinematics.status import Status
from leg_statics.capacity import (
    capacity_of_point,
    check_effort_limits,
    rough_capacity_of_point,
    unit_normals,
)
from leg_statics.efforts import worst_moment_efforts
from leg_statics.indices import force_slopes


class Verdict(IntEnum):
    """Why a foothold is not feasible; the first five are those of `Status`.

    Attributes:
        FEASIBLE: The leg carries the required load there.
        REACH: Out of reach.
        JOINT_RANGE: An actuator is outside its range.
        PASSIVE_JOINT: A passive joint is outside its range.
        SINGULAR: At or beyond a singularity.
        INVALID_INPUT: The candidate is not finite.
        FRICTION: The actuators could carry the load, but the foot would slip.
        EFFORT: The actuators cannot carry the load, however rough the ground.
    """

    FEASIBLE = 0
    REACH = 1
    JOINT_RANGE = 2
    PASSIVE_JOINT = 3
    SINGULAR = 4
    INVALID_INPUT = 5
    FRICTION = 6
    EFFORT = 7


FEASIBLE, FRICTION, EFFORT = int(Verdict.FEASIBLE), int(Verdict.FRICTION), int(Verdict.EFFORT)
OK = int(Status.OK)


class Contact(NamedTuple):
    """What a foot stands on and what it has to bear.

    Every field broadcasts with the candidates.

    Attributes:
        friction: Friction coefficient mu of the ground (...,), 0 to infinity.
        normal: Normal of the ground in the leg frame (..., 3), of any length.
        load: Required normal load (...,) [N].
        moment: Moment that the ground applies to the foot (..., 3) [N.m]; zero on hard ground.
        any_moment: Magnitude of a horizontal moment of unknown direction that must be borne
            on top (...,) [N.m]: the worst case over directions, equation (27).
        bias: Efforts that the actuators exert anyway (..., n), such as those that carry the leg's
            own weight, which the papers ignore [N.m or N].
    """

    friction: ArrayLike
    normal: ArrayLike = (0.0, 0.0, 1.0)
    load: ArrayLike = 0.0
    moment: ArrayLike = (0.0, 0.0, 0.0)
    any_moment: ArrayLike = 0.0
    bias: ArrayLike = 0.0


class Footholds(NamedTuple):
    """Evaluation of foothold candidates (...,).

    Attributes:
        verdict: A `Verdict` each.
        posture: The solved postures.
        load_capacity: Largest normal load [N]; infinite if the structure alone carries any load,
            NaN without a posture, 0 if not even an unloaded foot can be held.
        rated_friction: mu_e = |F_y / F_z|, equation (22).
        rated_friction_full: sqrt(F_x² + F_y²) / F_z of the same force.
        friction_margin: mu - mu_e.
        force: Ground reaction of the required load that uses the actuators least (..., 3) [N].
        efforts: Actuator efforts that hold it (..., n) [N.m or N].
        utilisation: Largest share of an effort limit that they use.
        limiting_joint: Index of that joint, -1 for none.
    """

    verdict: StatusArray
    posture: Posture
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    friction_margin: FloatArray
    force: FloatArray
    efforts: FloatArray
    utilisation: FloatArray
    limiting_joint: NDArray[np.int32]

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether the leg carries the required load."""
        return np.asarray(self.verdict == Verdict.FEASIBLE)

    def ranking(self) -> NDArray[np.int64]:
        """Flat indices of the feasible candidates, largest load capacity first.

        Equal capacities are ordered by the rougher ground that they need.
        """
        feasible = np.flatnonzero(self.feasible)
        capacity = np.ravel(self.load_capacity)[feasible]
        friction = np.ravel(self.rated_friction)[feasible]
        return feasible[np.lexsort((friction, -capacity))]


def evaluate_footholds(
    mechanism: Mechanism, effort_limits: ArrayLike, foot_positions: ArrayLike, contact: Contact
) -> Footholds:
    """Evaluate foothold candidates.

    A candidate is feasible if the posture is OK and every load from zero, when the foot touches
    down, to the required one can be held within the effort limits and the friction cone.

    Args:
        mechanism: The leg's mechanism; its foot must be a point in space.
        effort_limits: Lower (≤ 0) and upper (≥ 0) effort of each actuator (n, 2) [N.m or N].
        foot_positions: Candidates in the leg frame (..., 3) [m].
        contact: Ground, required load and moment.

    Raises:
        NotSupportedError: If the mechanism's end is no point foot.
        ShapeError: If shapes do not fit.
        ValueRangeError: If friction, load or moments are negative or NaN, or a normal is zero.
    """
    foot = as_array("foot_positions", foot_positions, len(mechanism.task_coordinates))
    posture, jacobian, angular = inverse_with_jacobians(mechanism, foot)
    return _evaluate(mechanism, effort_limits, posture, jacobian, angular, contact)


def evaluate_postures(
    mechanism: Mechanism, effort_limits: ArrayLike, posture: Posture, contact: Contact
) -> Footholds:
    """Evaluate solved postures as footholds; see `evaluate_footholds`."""
    jacobian, angular = mechanism.jacobian(posture), mechanism.angular_jacobian(posture)
    return _evaluate(mechanism, effort_limits, posture, jacobian, angular, contact)


def _evaluate(
    mechanism: Mechanism,
    effort_limits: ArrayLike,
    posture: Posture,
    jacobian: FloatArray,
    angular: FloatArray,
    contact: Contact,
) -> Footholds:
    if len(mechanism.task_coordinates) != 3:
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has task coordinates "
            f"{', '.join(mechanism.task_coordinates)}: load capacity needs a point foot x, y, z"
        )
    batch = np.shape(posture.status)
    limits = as_array("effort_limits", effort_limits, len(mechanism.joints), 2)
    check_effort_limits(limits[:, 0], limits[:, 1])
    load = _magnitude("load", contact.load, batch)
    friction = as_matching("friction", as_non_negative("friction", contact.friction), (), batch)
    any_moment = _magnitude("any_moment", contact.any_moment, batch)
    reserve: FloatArray = np.zeros(len(limits))
    if np.any(any_moment > 0.0):
        reserve = worst_moment_efforts(angular) * any_moment[..., None]
    values = _footholds(
        jacobian,
        angular,
        posture.status,
        limits[:, 0] + reserve,
        limits[:, 1] - reserve,
        reserve,
        _bias(contact.bias, len(limits)),
        friction,
        unit_normals("normal", as_matching("normal", contact.normal, (3,), batch)),
        load,
        _finite("moment", contact.moment, (3,), batch),
    )
    verdict, capacity, mu_e, mu_full, force, efforts, share, joint = values
    return Footholds(
        verdict, posture, capacity, mu_e, mu_full, friction - mu_e, force, efforts, share, joint
    )


# --------------------------------------------------------------------------- one candidate


@scalar
def share_of_limits(effort, reserve, lower, upper):
    """Return the share of its limits that a joint uses when its effort may vary by the reserve."""
    up, down = effort + reserve, effort - reserve
    share = 0.0
    if up > 0.0:
        share = up / (upper + reserve)
    if down < 0.0:
        share = max(share, down / (lower - reserve))
    return share


@kernel(
    "(d,n),(d,n),(),(n),(n),(n),(n),(),(d),(),(d)->(),(),(),(),(d),(n),(),()",
    "f8[:,:], f8[:,:], u1, f8[:], f8[:], f8[:], f8[:], f8, f8[:], f8, f8[:],"
    "u1[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], i4[:]",
)
def _footholds(
    jacobian,
    angular,
    status,
    lower,
    upper,
    reserve,
    bias,
    friction,
    normal,
    load,
    moment,
    verdict,
    capacity,
    mu_e,
    mu_full,
    force,
    efforts,
    share,
    joint,
):
    """One candidate; `lower` and `upper` are what the reserve leaves of the limits."""
    n = len(lower)
    verdict[0], capacity[0], share[0], joint[0] = status, math.nan, math.nan, -1
    mu_e[0], mu_full[0] = math.nan, math.nan
    force[:] = math.nan
    efforts[:] = math.nan
    if status != OK:
        return
    if n == 3:
        x_slope, y_slope = force_slopes(jacobian)
        mu_e[0], mu_full[0] = abs(y_slope), math.hypot(x_slope, y_slope)

    # What the actuators bear before any load: the moment and, as a bias, the leg itself.
    holds = True
    for i in range(n):
        efforts[i] = bias[i] - (
            angular[0, i] * moment[0] + angular[1, i] * moment[1] + angular[2, i] * moment[2]
        )
        holds = holds and lower[i] <= efforts[i] <= upper[i]
    capacity[0] = 0.0
    verdict[0] = EFFORT
    if holds:
        capacity[0], direction, _, _, _ = capacity_of_point(
            jacobian, lower, upper, efforts, friction, normal
        )
        if capacity[0] >= load:
            verdict[0] = FEASIBLE
        elif rough_capacity_of_point(jacobian, lower, upper, efforts, normal) >= load:
            verdict[0] = FRICTION
        if math.isfinite(capacity[0]):
            for k in range(3):
                force[k] = direction[k] * (load / capacity[0]) if load > 0.0 else 0.0
            for i in range(n):
                for k in range(3):
                    efforts[i] -= jacobian[k, i] * force[k]
    share[0] = 0.0
    for i in range(n):
        used = share_of_limits(efforts[i], reserve[i], lower[i], upper[i])
        if used > share[0]:
            share[0], joint[0] = used, i


# --------------------------------------------------------------------------- checks


def _finite(name: str, value: ArrayLike, trailing: tuple[int, ...], batch: tuple[int, ...]) -> Any:
    array = as_matching(name, value, trailing, batch)
    if not np.isfinite(array).all():
        raise ValueRangeError(f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    return array


def _magnitude(name: str, value: ArrayLike, batch: tuple[int, ...]) -> FloatArray:
    magnitude: FloatArray = _finite(name, as_non_negative(name, value), (), batch)
    return magnitude


def _bias(bias: ArrayLike, joints: int) -> FloatArray:
    array = np.asarray(bias, dtype=np.float64)
    if array.ndim == 0:
        array = np.full(joints, array)
    finite: FloatArray = _finite("bias", as_array("bias", array, joints), (joints,), ())
    return finite
