# SPDX-License-Identifier: Apache-2.0
"""What the feet of a robot carry together: verdict, load factor, payload, best forces.

A leg by itself may choose its tangential force. The feet of a standing robot may not: their forces
have to balance the weight, as forces and as moments. Each force F_i keeps within the true friction
cone of its ground and within what the efforts of its leg admit,

    lower_i <= bias_i - J_iᵀ F_i <= upper_i,

and every question here is how many times a load is borne, see `balance`. All vectors of a stance
are in one frame, in which its feet are given. All arguments broadcast over their leading axes.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arrays import (
    FloatArray,
    StatusArray,
    as_array,
    as_non_negative,
    as_vectors,
    broadcast_error,
    has_code,
)
from leg_kinematics.errors import ShapeError
from leg_kinematics.status import Status
from leg_statics.capacity.problem import UP, check_directions, check_effort_limits
from leg_statics.stance.balance import INVALID_INPUT, greatest_multiple
from leg_statics.stance.interior_point import OPTIMAL, UNBOUNDED
from leg_statics.weight import LEVEL_GRAVITY

NONE_FREE = np.zeros(3)
BAND = 1e-9  # a load is borne if this much less of it is


class StanceVerdict(IntEnum):
    """Whether a robot stands, and why it does not; numbers are those of `Verdict` as far as it has.

    Attributes:
        STANDS: The feet carry the load.
        REACH: A foot is out of reach.
        JOINT_RANGE: An actuator of a leg is outside its range.
        PASSIVE_JOINT: A passive joint of a leg is outside its range.
        SINGULAR: A leg is at or beyond a singularity.
        INVALID_INPUT: A foot, a Jacobian or the load is not finite.
        FRICTION: On rougher ground the actuators would hold the robot.
        EFFORT: Stronger actuators would hold it on rough ground; those there are do so on none.
        PULL: A foot would have to pull at the ground, whatever the actuators: the robot tips over.
    """

    STANDS = 0
    REACH = 1
    JOINT_RANGE = 2
    PASSIVE_JOINT = 3
    SINGULAR = 4
    INVALID_INPUT = 5
    FRICTION = 6
    EFFORT = 7
    PULL = 8


FRICTION, EFFORT, PULL = map(
    int, (StanceVerdict.FRICTION, StanceVerdict.EFFORT, StanceVerdict.PULL)
)


class Stance(NamedTuple):
    """L feet with n joints a leg; legs with fewer joints have columns of zeros and infinite limits.

    Attributes:
        position: The feet (..., L, 3) [m].
        jacobian: J of v = J q' of each leg (..., L, 3, n) [m/rad or m/m].
        effort_lower: Smallest efforts (..., L, n) [N.m or N]; -inf never limits.
        effort_upper: Largest efforts (..., L, n) [N.m or N]; inf never limits.
        friction: Friction coefficient mu of the ground under each foot (..., L), 0 to inf.
        normal: Normal of the ground, out of the ground, of any length (..., L, 3).
        bias_efforts: Efforts without ground, such as those that carry the leg's own weight
            (..., L, n) or one for all [N.m or N].
        stands: Whether each foot is on the ground (..., L).
        status: `Status` of the pose of each leg (..., L).
    """

    position: ArrayLike
    jacobian: ArrayLike
    effort_lower: ArrayLike
    effort_upper: ArrayLike
    friction: ArrayLike
    normal: ArrayLike = UP
    bias_efforts: ArrayLike = 0.0
    stands: ArrayLike = True
    status: ArrayLike = 0


class Load(NamedTuple):
    """What acts on the robot besides the ground, in the frame of the stance.

    Attributes:
        mass: Mass of the robot (...,) [kg].
        center_of_mass: Its centre of mass (..., 3) [m].
        gravity: Acceleration of a falling body (..., 3) [m/s²].
        acceleration: Acceleration of the centre of mass, which is borne as a weight is (..., 3)
            [m/s²].
        force: Further force on the robot (..., 3) [N].
        moment: Further moment on it, about the origin of the frame (..., 3) [N.m].
    """

    mass: ArrayLike
    center_of_mass: ArrayLike = (0.0, 0.0, 0.0)
    gravity: ArrayLike = LEVEL_GRAVITY
    acceleration: ArrayLike = (0.0, 0.0, 0.0)
    force: ArrayLike = (0.0, 0.0, 0.0)
    moment: ArrayLike = (0.0, 0.0, 0.0)

    @property
    def weight(self) -> FloatArray:
        """Wrench of the mass about the origin of the frame (..., 6) [N, N.m]."""
        mass = as_non_negative("mass", self.mass)
        return wrench_at(self.center_of_mass, mass[..., None] * self.falling)

    @property
    def falling(self) -> FloatArray:
        """What acts on each kg (..., 3) [m/s²]."""
        return as_array("gravity", self.gravity, 3) - as_array("acceleration", self.acceleration, 3)

    @property
    def further(self) -> FloatArray:
        """Wrench of all but the mass (..., 6) [N, N.m]."""
        parts = as_array("force", self.force, 3), as_array("moment", self.moment, 3)
        return np.concatenate(np.broadcast_arrays(*parts), axis=-1)


def wrench_at(point: ArrayLike, force: FloatArray) -> FloatArray:
    """Return the wrench (..., 6) of a force (..., 3) at a point (..., 3), about the origin."""
    moment = np.cross(as_array("center_of_mass", point, 3), force)
    return np.concatenate(np.broadcast_arrays(force, moment), axis=-1)


class Multiples(NamedTuple):
    """How many times loads are borne.

    Attributes:
        multiple: Greatest multiple (...,); infinite if any is borne, NaN if none or without pose.
        force: Forces of the ground that bear it (..., L, 3) [N]; NaN unless it is finite.
        limit: What limits it most (...,), as `StanceVerdict`: FRICTION, EFFORT, PULL, or 0 for
            nothing.
        limiting_leg: Index of the leg where that is (...,); -1 for none.
        limiting_joint: Index of the joint, if EFFORT limits (...,); -1 otherwise.
        status: Status of the solver (...,), see `balance`.
    """

    multiple: FloatArray
    force: FloatArray
    limit: StatusArray
    limiting_leg: NDArray[np.int64]
    limiting_joint: NDArray[np.int64]
    status: StatusArray


class Stances(NamedTuple):
    """Evaluation of stances.

    Attributes:
        verdict: A `StanceVerdict` each (...,).
        load_factor: How many times the mass can be carried (...,); infinite if any mass, NaN if
            none or without pose.
        utilisation: Largest effort / effort limit of the best forces (...,); above 1 where they are
            beyond the limits, infinite where no forces balance the load, NaN without pose.
        force: Best forces of the ground: none has a smaller utilisation (..., L, 3) [N]; 0 at feet
            that do not stand, NaN where there are none.
        joint_efforts: Their efforts (..., L, n) [N.m or N].
        limit: What limits the load factor, see `Multiples`.
        limiting_leg: See `Multiples`.
        limiting_joint: See `Multiples`.
    """

    verdict: StatusArray
    load_factor: FloatArray
    utilisation: FloatArray
    force: FloatArray
    joint_efforts: FloatArray
    limit: StatusArray
    limiting_leg: NDArray[np.int64]
    limiting_joint: NDArray[np.int64]

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Whether the robot stands (...,)."""
        return np.asarray(self.verdict == StanceVerdict.STANDS)

    @property
    def ranking(self) -> NDArray[np.int64]:
        """Flat indices of the stances that stand, largest load factor first."""
        return ranking_of(self.stands, self.load_factor)

    @property
    def best(self) -> int:
        """Flat index of the first of the ranking, -1 if none stands."""
        ranking = self.ranking
        return int(ranking[0]) if len(ranking) else -1


def ranking_of(stands: NDArray[np.bool_], merit: FloatArray) -> NDArray[np.int64]:
    """Return the flat indices of the stances that stand, that of the greatest merit first."""
    standing = np.flatnonzero(stands)
    return standing[np.argsort(-np.ravel(merit)[standing], kind="stable")]


def evaluate_stances(stance: Stance, load: Load) -> Stances:
    """Return whether robots stand, how much they carry, what limits that, and the best forces.

    Raises:
        ShapeError: If shapes do not fit.
        ValueRangeError: If a mass or friction is negative or NaN, limits are reversed, or a normal
            is zero.
    """
    feet = as_arrays(stance)
    weight, further = load.weight, load.further
    factor = greatest(feet, further, weight, load_size=length_of(weight[..., :3]))
    best = _best_forces(feet, weight + further)
    verdict = _verdicts(feet, weight + further, best)
    return Stances(
        verdict=verdict,
        load_factor=factor.multiple,
        utilisation=best.utilisation,
        force=best.force,
        joint_efforts=best.joint_efforts,
        limit=factor.limit,
        limiting_leg=factor.limiting_leg,
        limiting_joint=factor.limiting_joint,
    )


def load_factor(stance: Stance, load: Load) -> Multiples:
    """Return how many times the mass can be carried where it is, beside the further load."""
    weight = load.weight
    return greatest(as_arrays(stance), load.further, weight, load_size=length_of(weight[..., :3]))


def payload(stance: Stance, load: Load, position: ArrayLike) -> Multiples:
    """Return the greatest mass that can be carried besides [kg].

    Args:
        stance: The stance.
        load: What has to be carried anyway.
        position: Where the further mass is (..., 3) [m].
    """
    unit = wrench_at(position, load.falling)
    return greatest(
        as_arrays(stance), load.weight + load.further, unit, load_size=length_of(unit[..., :3])
    )


class BestForces(NamedTuple):
    """Forces of the ground with the smallest largest utilisation.

    Attributes:
        utilisation: Largest effort / effort limit (...,); infinite if no forces balance the load.
        force: Forces (..., L, 3) [N].
        joint_efforts: Efforts (..., L, n) [N.m or N].
    """

    utilisation: FloatArray
    force: FloatArray
    joint_efforts: FloatArray


def best_forces(stance: Stance, load: Load) -> BestForces:
    """Return the forces that balance the load and use the actuators least.

    The largest utilisation of all joints is as small as can be. Where that leaves a choice, forces
    are far from all limits. They may be beyond the limits of efforts: utilisation tells.
    """
    return _best_forces(as_arrays(stance), load.weight + load.further)


# --------------------------------------------------------------------------- arrays

OF_STANCE = (2, 3, 2, 2, 1, 2, 2, 1, 1)  # axes of the fields of one stance


def as_arrays(stance: Stance) -> Stance:
    """Return a stance whose fields are arrays with an axis of legs.

    Raises:
        ShapeError: If shapes do not fit.
    """
    position, jacobian = as_array("position", stance.position, 3), np.asarray(stance.jacobian)
    jacobian = as_array("jacobian", jacobian)
    if position.ndim < 2 or jacobian.ndim < 3 or jacobian.shape[-2] != 3:
        raise ShapeError(
            "position and jacobian must have shapes (..., L, 3) and (..., L, 3, n), got "
            f"{position.shape} and {jacobian.shape}"
        )
    legs, n = jacobian.shape[-3], jacobian.shape[-1]
    if position.shape[-2] != legs:
        raise ShapeError(f"position is of {position.shape[-2]} legs, jacobian of {legs}")
    return Stance(
        position,
        jacobian,
        _of_legs("effort_lower", as_vectors("effort_lower", stance.effort_lower, n), legs, 1),
        _of_legs("effort_upper", as_vectors("effort_upper", stance.effort_upper, n), legs, 1),
        _of_legs("friction", as_array("friction", stance.friction), legs, 0),
        _of_legs("normal", as_array("normal", stance.normal, 3), legs, 1),
        _of_legs("bias_efforts", as_vectors("bias_efforts", stance.bias_efforts, n), legs, 1),
        _of_legs("stands", np.asarray(stance.stands, np.bool_), legs, 0),
        _of_legs("status", np.asarray(stance.status, np.uint8), legs, 0),
    )


def _of_legs(name: str, array: Any, legs: int, axes: int) -> Any:
    """Return an array with an axis of legs before those of one leg."""
    if array.ndim == axes:
        return np.broadcast_to(array, (legs, *array.shape))
    if array.shape[-1 - axes] not in (1, legs):
        raise ShapeError(f"{name} is of {array.shape[-1 - axes]} legs, position of {legs}")
    shape = (*array.shape[: array.ndim - 1 - axes], legs, *array.shape[array.ndim - axes :])
    return np.broadcast_to(array, shape)


def length_of(vectors: FloatArray) -> FloatArray:
    """Return the lengths (...,) of vectors (..., 3)."""
    length: FloatArray = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return length


OF_KERNEL = (1, 2, 2, 1, 3, 2, 2, 2, 1, 1, 1, 1)  # axes of what the kernel takes of one stance


def _solved(feet: Stance, *question: Any) -> Any:
    """Return the kernel's answer; raise if something is out of range."""
    arguments: list[Any] = [feet.stands, feet.position, feet.normal, feet.friction, feet.jacobian]
    arguments += [feet.effort_lower, feet.effort_upper, feet.bias_efforts, *question]
    alone = all(a.ndim == axes for a, axes in zip(arguments, OF_KERNEL, strict=True))
    if alone:  # as points, so that the code for one, which is as long, is never compiled
        arguments[1] = arguments[1][None]
    try:
        answer = greatest_multiple(*arguments)
    except ValueError:
        shapes = {"position": np.shape(feet.position)[:-2], "load": question[0].shape[:-1]}
        shapes |= {"growing": question[1].shape[:-1], "jacobian": np.shape(feet.jacobian)[:-3]}
        raise broadcast_error(shapes) from None
    if not answer[0].size or has_code(answer[0], INVALID_INPUT):
        check_effort_limits(np.asarray(feet.effort_lower), np.asarray(feet.effort_upper))
        as_non_negative("friction", feet.friction)
        check_directions("normal", np.asarray(feet.normal))
    return [found[0] for found in answer] if alone else answer


# --------------------------------------------------------------------------- the question

AS_IT_IS = np.array([1.0, 0.0])  # parts of the bias: all of it, however large the load
GROWS_TOO = np.array([0.0, 1.0])  # as many times as the load


def greatest(
    feet: Stance,
    fixed: FloatArray,
    growing: FloatArray,
    free: FloatArray = NONE_FREE,
    *,
    load_size: FloatArray,
) -> Multiples:
    """Return how many times a growing wrench is borne beside a fixed one.

    Args:
        feet: A stance of arrays.
        fixed: Wrench on the robot (..., 6).
        growing: Wrench that grows (..., 6).
        free: Axis about which any moment may be added (..., 3); zero for none.
        load_size: A force that a foot's pull is compared with, to tell what limits most (...) [N].
    """
    status, multiple, force, share, gain = _solved(feet, fixed, growing, AS_IT_IS, free)
    multiple = np.where(_posed(feet), multiple, np.nan)
    limit, leg, joint = _limits(feet, force, share, gain, load_size)
    known = np.isfinite(multiple)
    return Multiples(
        multiple=multiple,
        force=np.where(known[..., None, None], force, np.nan),
        limit=np.where(known, limit, 0).astype(np.uint8),
        limiting_leg=np.where(known, leg, -1),
        limiting_joint=np.where(known, joint, -1),
        status=status,
    )


def _posed(feet: Any) -> NDArray[np.bool_]:
    """Return whether every foot that stands has a pose (...,)."""
    posed: NDArray[np.bool_] = np.all((feet.status == np.uint8(Status.OK)) | ~feet.stands, axis=-1)
    return posed


def _limits(feet: Stance, force: Any, share: Any, gain: Any, load_size: Any) -> Any:
    """Return what limits a multiple most, the leg and the joint.

    Compared is by how much the multiple grows where something is relaxed by all of itself: a limit
    of effort or a friction coefficient doubled, a foot allowed to pull with an equal part of the
    load.
    """
    normal = np.asarray(feet.normal)
    normal = normal / length_of(normal)[..., None]
    pressure = np.einsum("...i,...i->...", force, normal)
    legs = force.shape[-2]
    part = np.asarray(load_size)[..., None] / legs
    slip, pull = gain * pressure, gain * np.where(pressure <= 1e-6 * part, part, 0.0)
    shares = np.concatenate([share, slip[..., None], pull[..., None]], axis=-1)
    flat = shares.reshape(*shares.shape[:-2], shares.shape[-2] * shares.shape[-1])
    which = np.argmax(np.nan_to_num(flat, nan=-np.inf), axis=-1)
    n = share.shape[-1]
    leg, what = which // (n + 2), which % (n + 2)
    limit = np.where(what < n, EFFORT, np.where(what == n, FRICTION, PULL))
    return limit, leg, np.where(what < n, what, -1)


def _best_forces(feet: Any, load: FloatArray) -> BestForces:
    """Return the best forces: the load grows with the bias until a limit is reached."""
    status, multiple, force, *_ = _solved(feet, np.zeros(6), load, GROWS_TOO, NONE_FREE)
    posed = _posed(feet)
    borne = posed & ((status == UNBOUNDED) | ((status == OPTIMAL) & (multiple > 1e-7)))
    per = np.where(status == UNBOUNDED, 1.0, np.where(borne, multiple, np.nan))
    force = np.where(posed[..., None, None], force / per[..., None, None], np.nan)
    borne_by_joints = np.einsum("...ij,...i->...j", feet.jacobian, force)
    efforts = feet.bias_efforts - borne_by_joints
    with np.errstate(divide="ignore"):
        used = np.where(
            borne, 1.0 / multiple, np.where(posed & (status == OPTIMAL), np.inf, np.nan)
        )
    return BestForces(used, force, efforts)


def _verdicts(feet: Stance, load: FloatArray, best: BestForces) -> StatusArray:
    """Return the verdicts: what those fail by that do not stand is found as far as needed."""
    status = np.where(feet.stands, feet.status, 0)
    verdict = np.broadcast_to(status.max(axis=-1), best.utilisation.shape).astype(np.uint8)
    verdict = np.where(
        (verdict == 0) & np.isnan(best.utilisation), StanceVerdict.INVALID_INPUT, verdict
    ).astype(np.uint8)
    fails = (verdict == 0) & ~(best.utilisation <= 1.0 + BAND)
    if not np.any(fails):
        return verdict
    chosen, wrench = _chosen(feet, fails), np.broadcast_to(load, (*fails.shape, 6))[fails]
    rough = chosen._replace(friction=np.full_like(chosen.friction, np.inf))
    strong = rough._replace(
        effort_lower=np.full_like(chosen.effort_lower, -np.inf),
        effort_upper=np.full_like(chosen.effort_upper, np.inf),
    )
    on_rough = _best_forces(rough, wrench).utilisation <= 1.0 + BAND
    if_strong = _solved(strong, np.zeros(6), wrench, GROWS_TOO, NONE_FREE)[0] == UNBOUNDED
    verdict[fails] = np.where(on_rough, FRICTION, np.where(if_strong, EFFORT, PULL))
    return verdict


def _chosen(feet: Stance, which: NDArray[np.bool_]) -> Any:
    """Return some of the stances (m, ...)."""
    axes = (1, 2, 1, 1, 0, 1, 1, 0, 0)  # besides those of the legs
    return Stance(
        *[
            np.broadcast_to(array, (*which.shape, *np.shape(array)[np.ndim(array) - 1 - k :]))[
                which
            ]
            for array, k in zip(feet, axes, strict=True)
        ]
    )
