"""Footholds: can the leg reach it, what does it carry there, and if not enough, why not."""

from __future__ import annotations

import math
from enum import IntEnum
from functools import lru_cache
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
    common_batch,
    has_code,
)
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.kernels.blocks import (
    BLOCK,
    get3,
    load,
    load_columns,
    load_numbers,
    put,
    store,
)
from leg_kinematics.kernels.kernel import inlined, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.status import Status
from leg_statics.capacity.planes import plane_capacity
from leg_statics.capacity.problem import check_effort_limits, check_normals, difference, unit
from leg_statics.capacity.three_joint import inner, three_joint_capacity
from leg_statics.efforts import worst_moment_effort
from leg_statics.indices import force_slopes
from leg_statics.kinematics import Kinematics


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
WRONG_CONTACT = 255  # instead of a verdict, where the contact or a limit is out of range


class Contact(NamedTuple):
    """What a foot stands on and what it has to bear.

    Every field broadcasts with the candidates. A contact of plain numbers and tuples is quickest
    if it is used again.

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
        numbers: All else that was found, in columns (..., 9 + n); the properties name them.
    """

    verdict: StatusArray
    posture: Posture
    numbers: FloatArray

    @property
    def load_capacity(self) -> FloatArray:
        """Largest normal load [N].

        Infinite if the structure alone carries any load, NaN without a posture, 0 if not even an
        unloaded foot can be held.
        """
        return self._column(CAPACITY)

    @property
    def rated_friction(self) -> FloatArray:
        """mu_e = |F_y / F_z|, equation (22)."""
        return self._column(MU_E)

    @property
    def rated_friction_full(self) -> FloatArray:
        """sqrt(F_x² + F_y²) / F_z of the same force."""
        return self._column(MU_FULL)

    @property
    def friction_margin(self) -> FloatArray:
        """What the ground offers beyond the rated friction, mu - mu_e."""
        return self._column(MARGIN)

    @property
    def utilisation(self) -> FloatArray:
        """Largest share of an effort limit that the efforts use."""
        return self._column(SHARE)

    @property
    def limiting_joint(self) -> NDArray[np.int32]:
        """Index of that joint, -1 for none."""
        return self._column(JOINT).astype(np.int32)

    @property
    def force(self) -> FloatArray:
        """Ground reaction of the required load that uses the actuators least (..., 3) [N]."""
        return self._columns(slice(FORCE - NUMBERS, OF_POINT - NUMBERS))

    @property
    def efforts(self) -> FloatArray:
        """Actuator efforts that hold it (..., n) [N.m or N]."""
        return self._columns(slice(OF_POINT - NUMBERS, None))

    def _column(self, row: int) -> FloatArray:
        """Return what stands in a row of the kernel's block; a number if there is one point."""
        return self._columns(row - NUMBERS)

    def _columns(self, which: int | slice) -> FloatArray:
        """Return columns as a copy: whoever keeps them does not keep all the others."""
        columns: FloatArray = self.numbers[..., which].copy()[()]
        return columns

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether the leg carries the required load."""
        return np.asarray(self.verdict == FEASIBLE)

    def ranking(self) -> NDArray[np.int64]:
        """Flat indices of the feasible candidates, largest load capacity first.

        Equal capacities are ordered by the rougher ground that they need.
        """
        feasible = np.flatnonzero(self.feasible)
        if len(feasible) < 2:  # as in a request for one foothold
            return feasible
        capacity = np.ravel(self.load_capacity)[feasible]
        order = np.argsort(-capacity, kind="stable")
        if np.any(np.diff(capacity[order]) == 0.0):  # rarely; it takes ten times as long
            order = np.lexsort((np.ravel(self.rated_friction)[feasible], -capacity))
        return feasible[order]


def evaluate_footholds(
    mechanism: Mechanism, effort_limits: ArrayLike, foot_position: ArrayLike, contact: Contact
) -> Footholds:
    """Evaluate foothold candidates.

    A candidate is feasible if the posture is OK and every load from zero, when the foot touches
    down, to the required one can be held within the effort limits and the friction cone.

    Args:
        mechanism: The leg's mechanism; its foot must be a point in space.
        effort_limits: Lower (≤ 0) and upper (≥ 0) effort of each actuator (n, 2) [N.m or N].
        foot_position: Candidates in the leg frame (..., 3) [m].
        contact: Ground, required load and moment.

    Raises:
        NotSupportedError: If the mechanism's end is no point foot.
        ShapeError: If shapes do not fit.
        ValueRangeError: If friction, load or moments are negative or NaN, or a normal is zero.
    """
    posture, twist = mechanism.inverse_with_twist(foot_position)
    return _judged(mechanism, posture, twist, effort_limits, contact)


def judge_footholds(
    kinematics: Kinematics, effort_limits: ArrayLike, contact: Contact
) -> Footholds:
    """Evaluate solved postures as footholds; see `evaluate_footholds`."""
    twist = kinematics.twist_jacobian
    return _judged(kinematics.mechanism, kinematics.posture, twist, effort_limits, contact)


def _judged(
    mechanism: Mechanism,
    posture: Posture,
    twist_jacobian: FloatArray,
    effort_limits: ArrayLike,
    contact: Contact,
) -> Footholds:
    rows, n = twist_jacobian.shape[-2:]
    if rows != 6:
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has task coordinates "
            f"{', '.join(mechanism.task_coordinates)}: load capacity needs a point foot x, y, z"
        )
    limits = as_array("effort_limits", effort_limits, n, 2)
    try:
        verdict, numbers = _footholds(limits, twist_jacobian, posture.status, _rows(contact, n))
    except ValueError:
        shapes = {"candidates": np.shape(posture.status), **_leading_shapes(_arrays(contact, n))}
        raise broadcast_error(shapes) from None
    if not verdict.size or has_code(verdict, WRONG_CONTACT):
        check_effort_limits(limits[:, 0], limits[:, 1])
        _check_contact(_arrays(contact, n))
    return Footholds(verdict, posture, numbers)


def _rows(contact: Contact, n: int) -> FloatArray:
    """Return all that a contact says of a point in one row (..., 9 + n)."""
    try:
        return _known_row(contact, n)
    except TypeError:  # arrays have no hash
        return _joined(_arrays(contact, n), n)


@lru_cache
def _known_row(contact: Contact, n: int) -> FloatArray:
    """Return the row of a contact that cannot change, kept for the next call."""
    return _joined(_arrays(contact, n), n)


def _arrays(contact: Contact, n: int) -> Contact:
    """Return a contact whose fields are arrays."""
    return Contact(
        as_array("friction", contact.friction),
        as_array("normal", contact.normal, 3),
        as_array("load", contact.load),
        as_array("moment", contact.moment, 3),
        as_array("any_moment", contact.any_moment),
        as_vectors("bias", contact.bias, n),
    )


def _leading_shapes(contact: Any) -> dict[str, tuple[int, ...]]:
    """Return the leading axes of the fields, by name, of a contact of arrays."""
    return {
        "friction": contact.friction.shape,
        "normal": contact.normal.shape[:-1],
        "load": contact.load.shape,
        "moment": contact.moment.shape[:-1],
        "any_moment": contact.any_moment.shape,
        "bias": contact.bias.shape[:-1],
    }


def _joined(contact: Contact, n: int) -> FloatArray:
    """Return the fields of a contact of arrays beside each other."""
    batch = common_batch(_leading_shapes(contact).values())
    row = np.empty((OF_CONTACT + n, *batch[::-1])).T  # each field in one piece of memory
    row[..., MU] = contact.friction
    row[..., NORMAL:LOAD] = contact.normal
    row[..., LOAD] = contact.load
    row[..., MOMENT:ANY_MOMENT] = contact.moment
    row[..., ANY_MOMENT] = contact.any_moment
    row[..., OF_CONTACT:] = contact.bias
    return row


def _check_contact(contact: Contact) -> None:
    """Raise a ValueRangeError for a value that is out of range."""
    as_non_negative("friction", contact.friction)
    check_normals("normal", np.asarray(contact.normal))
    for name in ("load", "any_moment"):
        as_non_negative(name, getattr(contact, name))
    for name in ("load", "moment", "any_moment", "bias"):
        array = np.asarray(getattr(contact, name))
        if not np.isfinite(array).all():
            raise ValueRangeError(
                f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]}"
            )


# --------------------------------------------------------------------------- kernel

# Rows of a block: what the contact says, as in its row,
MU, NORMAL, LOAD, MOMENT, ANY_MOMENT, OF_CONTACT = 0, 1, 4, 5, 8, 9
# what else is given or found on the way, and the verdict,
STATUS, VALID, HOLDS, CERTAIN, ROUGH, VERDICT = 9, 10, 11, 12, 13, 14
# the numbers of `Footholds`,
CAPACITY, MU_E, MU_FULL, MARGIN, SHARE, JOINT, FORCE, OF_POINT = 15, 16, 17, 18, 19, 20, 21, 24
NUMBERS = CAPACITY
# then what n joints have, each row n times: the efforts, which are the last of those numbers;
# limits, bias, the reserve and what it leaves of the limits; columns of both Jacobians (3 n).
TAU, LOWER, UPPER, BIAS, RESERVE, LEAST, MOST = range(7)
J, OMEGA, OF_JOINTS = 7, 10, 13


@inlined
def row_of(joint_row, n, joint):
    """Return the row of a number of a joint."""
    width = 3 if joint_row >= J else 1
    return OF_POINT + joint_row * n + width * joint


@inlined
def prepare(block, i, n):
    """Find what the actuators bear before any load: the moments and, as a bias, the leg itself."""
    moment, normal = get3(block, MOMENT, i), unit(get3(block, NORMAL, i))
    valid = (block[MU, i] >= 0.0) & (block[LOAD, i] >= 0.0) & (block[ANY_MOMENT, i] >= 0.0)
    finite = normal[0] + moment[0] + moment[1] + moment[2] + block[LOAD, i] + block[ANY_MOMENT, i]
    holds = True
    for k in range(n):
        lower, upper = block[row_of(LOWER, n, k), i], block[row_of(UPPER, n, k), i]
        bias, omega = block[row_of(BIAS, n, k), i], get3(block, row_of(OMEGA, n, k), i)
        valid &= (lower <= upper) & (lower < math.inf) & (upper > -math.inf)
        finite += bias
        reserve = worst_moment_effort(omega[0], omega[1]) * block[ANY_MOMENT, i]
        least, most, effort = lower + reserve, upper - reserve, bias - inner(omega, moment)
        holds &= (least <= effort) & (effort <= most)
        block[row_of(RESERVE, n, k), i] = reserve
        block[row_of(LEAST, n, k), i] = least
        block[row_of(MOST, n, k), i] = most
        block[row_of(TAU, n, k), i] = effort
    block[VALID, i] = 1.0 if valid & math.isfinite(finite) else 0.0
    block[HOLDS, i] = 1.0 if holds & (block[STATUS, i] == OK) else 0.0


@inlined
def solve_three(block, i):
    """Find rated friction and load capacity of a leg with three actuators."""
    columns = (
        get3(block, row_of(J, 3, 0), i),
        get3(block, row_of(J, 3, 1), i),
        get3(block, row_of(J, 3, 2), i),
    )
    x_slope, y_slope = force_slopes(
        (
            (columns[0][0], columns[1][0], columns[2][0]),
            (columns[0][1], columns[1][1], columns[2][1]),
            (columns[0][2], columns[1][2], columns[2][2]),
        )
    )
    block[MU_E, i] = abs(y_slope)
    block[MU_FULL, i] = math.sqrt(x_slope * x_slope + y_slope * y_slope)
    effort = get3(block, row_of(TAU, 3, 0), i)
    up = difference(effort, get3(block, row_of(LEAST, 3, 0), i))
    down = difference(get3(block, row_of(MOST, 3, 0), i), effort)
    normal = unit(get3(block, NORMAL, i))
    found = three_joint_capacity(columns, up, down, block[MU, i], normal)
    block[CAPACITY, i] = found.capacity
    put(block, FORCE, i, found.force)
    block[ROUGH, i] = found.rough
    block[CERTAIN, i] = 1.0 if found.certain else 0.0


@inlined
def judge(block, i, n):
    """Find the verdict, and the force and efforts of the required load."""
    capacity, load, status = block[CAPACITY, i], block[LOAD, i], block[STATUS, i]
    solved, holds = status == OK, block[HOLDS, i] == 1.0
    verdict = FRICTION if block[ROUGH, i] >= load else EFFORT
    verdict = FEASIBLE if capacity >= load else verdict
    verdict = verdict if holds else EFFORT
    verdict = verdict if solved else status
    block[VERDICT, i] = verdict if block[VALID, i] == 1.0 else WRONG_CONTACT
    capacity = capacity if holds else (0.0 if solved else math.nan)
    block[CAPACITY, i] = capacity
    part = load / capacity if load > 0.0 else 0.0
    loaded = holds & math.isfinite(capacity)
    fx, fy, fz = get3(block, FORCE, i)
    fx, fy, fz = fx * part, fy * part, fz * part
    put(block, FORCE, i, (fx, fy, fz) if loaded else (math.nan, math.nan, math.nan))
    most, worst = 0.0, -1.0
    for k in range(n):
        held = inner(get3(block, row_of(J, n, k), i), (fx, fy, fz))
        effort = block[row_of(TAU, n, k), i] - (held if loaded else 0.0)
        block[row_of(TAU, n, k), i] = effort if solved else math.nan
        share = share_of_limits(
            effort,
            block[row_of(RESERVE, n, k), i],
            block[row_of(LEAST, n, k), i],
            block[row_of(MOST, n, k), i],
        )
        worst = k if share > most else worst
        most = share if share > most else most
    block[SHARE, i] = most if solved else math.nan
    block[JOINT, i] = worst if solved else -1.0
    block[MU_E, i] = block[MU_E, i] if solved else math.nan
    block[MU_FULL, i] = block[MU_FULL, i] if solved else math.nan
    block[MARGIN, i] = block[MU, i] - block[MU_E, i]


@inlined
def share_of_limits(effort, reserve, least, most):
    """Return the share of its limits that a joint uses when its effort may vary by the reserve.

    Args:
        effort: Effort of the joint.
        reserve: By how much it may vary.
        least: Lower limit plus reserve.
        most: Upper limit less reserve.
    """
    highest, lowest = effort + reserve, effort - reserve
    above = highest / abs(most + reserve) if highest > 0.0 else 0.0
    below = -lowest / abs(least - reserve) if lowest < 0.0 else 0.0
    return below if below > above else above


@points_kernel("(n,2),(points,6,n),(points),(points,w)->(points),(points,w)", "f8 f8 u1 f8 u1 f8")
def _footholds(limits, twist, status, contact, verdict, numbers):
    """Judge points in blocks; with three actuators the number is a constant for the compiler.

    What a contact says and what is found of it stand in one row each, because every array costs a
    call as much as some points do. Both rows are 9 + n long.
    """
    n = len(limits)
    block = np.empty((OF_POINT + OF_JOINTS * n, BLOCK))
    for i in range(min(BLOCK, len(status))):
        block[CERTAIN, i] = 0.0
        block[MU_E, i] = block[MU_FULL, i] = math.nan
        for k in range(n):
            block[row_of(LOWER, n, k), i] = limits[k, 0]
            block[row_of(UPPER, n, k), i] = limits[k, 1]
    for start in range(0, len(status), BLOCK):
        end = min(start + BLOCK, len(status))
        load_numbers(block, STATUS, status, start, end)
        if n == 3:
            judge_block(block, twist, contact, numbers, start, end, 3)
        else:
            judge_block(block, twist, contact, numbers, start, end, n)
        for i in range(end - start):
            verdict[start + i] = int(block[VERDICT, i])


@inlined
def judge_block(block, twist, contact, numbers, start, end, n):
    """Judge points start to end, whose status is in the block."""
    load(block, MU, contact, start, end, OF_CONTACT)
    load(block, row_of(BIAS, n, 0), contact[:, OF_CONTACT:], start, end, n)
    load_columns(block, row_of(J, n, 0), twist[:, :3], start, end, n)
    load_columns(block, row_of(OMEGA, n, 0), twist[:, 3:], start, end, n)
    for i in range(end - start):
        prepare(block, i, n)
    if n == 3:
        for i in range(end - start):
            solve_three(block, i)
    for i in range(end - start):
        if block[HOLDS, i] == 1.0 and block[VALID, i] == 1.0 and block[CERTAIN, i] == 0.0:
            solve_any(block, i, n, twist[start + i, :3])
    for i in range(end - start):
        judge(block, i, n)
    store(block, NUMBERS, numbers, start, end, OF_POINT - NUMBERS + n)


@scalar
def solve_any(block, i, n, jacobian):
    """Find the load capacity of a leg with any number of actuators."""
    lower, upper, effort = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        lower[k], upper[k] = block[row_of(LEAST, n, k), i], block[row_of(MOST, n, k), i]
        effort[k] = block[row_of(TAU, n, k), i]
    normal = unit(get3(block, NORMAL, i))
    capacity, force, _, _, _ = plane_capacity(jacobian, lower, upper, effort, block[MU, i], normal)
    block[CAPACITY, i] = capacity
    put(block, FORCE, i, force)
    block[ROUGH, i] = capacity
    if capacity < block[LOAD, i]:
        block[ROUGH, i] = plane_capacity(jacobian, lower, upper, effort, math.inf, normal)[0]
