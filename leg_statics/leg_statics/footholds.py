# SPDX-License-Identifier: Apache-2.0
"""Footholds: can the leg reach it, what does it carry there, and if not enough, why not."""

from __future__ import annotations

import math
from enum import IntEnum
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arguments import require
from leg_kinematics.arrays import FloatArray, StatusArray, as_array, broadcast_error, has_code
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.kernels.blocks import BLOCK, get3, load, load_columns, load_numbers, put, store
from leg_kinematics.kernels.kernel import inlined
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.settled import UNCERTAIN, settled
from leg_kinematics.kernels.vectors import inner, unit
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg
from leg_kinematics.status import Status
from leg_statics.capacity.problem import (
    ANY_MOMENT,
    BIAS,
    CAPACITY,
    EFFORT,
    FORCE,
    LOAD,
    LOWER,
    MOMENT,
    MU,
    NORMAL,
    OF_CALLER,
    OF_CONTACT,
    OF_POINT,
    OMEGA,
    OUTCOME,
    RESERVE,
    ROUGH,
    UPPER,
    WANTED,
    J,
    bear_moments,
    check_effort_limits,
    leave_room,
    new_block,
    row_of,
    solve_any,
    solve_three,
)
from leg_statics.contact import Contact as Contact
from leg_statics.contact import check_contact, contact_rows, leading_shapes
from leg_statics.efforts import share_of_limits
from leg_statics.indices import force_slopes
from leg_statics.kinematics import Kinematics
from leg_statics.weight import gravity_of, weight_efforts


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

    `foothold_verdict` decides.
    """

    FEASIBLE = 0
    REACH = 1
    JOINT_RANGE = 2
    PASSIVE_JOINT = 3
    SINGULAR = 4
    INVALID_INPUT = 5
    FRICTION = 6
    EFFORT = 7


FEASIBLE, FRICTION, TOO_HEAVY = map(int, (Verdict.FEASIBLE, Verdict.FRICTION, Verdict.EFFORT))
OK = int(Status.OK)
WRONG_CONTACT = 255  # instead of a verdict, where the contact or a limit is out of range


class Footholds(NamedTuple):
    """Evaluation of foothold candidates (...,).

    Attributes:
        verdict: A `Verdict` each.
        posture: The solved postures.
        numbers: All else that was found, in columns (..., 9 + n); the properties name them.
        weight_counted: Whether the actuators hold the leg's own weight, too; not if its masses are
            not known.
    """

    verdict: StatusArray
    posture: Posture
    numbers: FloatArray
    weight_counted: bool

    @property
    def status(self) -> StatusArray:
        """`Status` of the poses alone, whatever they carry."""
        return self.posture.status

    @property
    def load_capacity(self) -> FloatArray:
        """Largest normal load [N].

        Infinite if the structure alone carries any load, NaN without a posture, 0 if not even an
        unloaded foot can be held.
        """
        return self._columns(CAPACITY)

    @property
    def rated_friction(self) -> FloatArray:
        """mu_e = |F_x / F_z|, forward over vertical, equation (22)."""
        return self._columns(MU_E)

    @property
    def rated_friction_full(self) -> FloatArray:
        """sqrt(F_x² + F_y²) / F_z of the same force."""
        return self._columns(MU_FULL)

    @property
    def friction_margin(self) -> FloatArray:
        """What the ground offers beyond the rated friction, mu - mu_e."""
        return self._columns(MARGIN)

    @property
    def utilisation(self) -> FloatArray:
        """Largest share of an effort limit that the efforts use."""
        return self._columns(SHARE)

    @property
    def limiting_joint(self) -> NDArray[np.int32]:
        """Index of that joint, -1 for none."""
        return self._columns(WORST).astype(np.int32)

    @property
    def force(self) -> FloatArray:
        """Ground reaction of the required load that uses the actuators least (..., 3) [N]."""
        return self._columns(FORCE, OF_POINT)

    @property
    def joint_efforts(self) -> FloatArray:
        """Actuator efforts that hold it (..., n) [N.m or N]."""
        return self._columns(OF_POINT, None)

    def _columns(self, *rows: int | None) -> FloatArray:
        """Return what stands in a row of the kernel's block, or from one row to before another.

        It is a copy: whoever keeps it does not keep all the others.
        """
        ends = [None if row is None else row - MU_E for row in rows]
        which = ends[0] if len(ends) == 1 else slice(*ends)
        columns: FloatArray = self.numbers[..., which].copy()[()]
        return columns

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether the leg carries the required load."""
        return np.asarray(self.verdict == FEASIBLE)

    @property
    def best(self) -> int:
        """Flat index of the first of the ranking, -1 if no candidate is feasible."""
        ranking = self.ranking
        return int(ranking[0]) if len(ranking) else -1

    @property
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


def evaluate_footholds(leg: Leg, foot_position: ArrayLike, contact: Contact) -> Footholds:
    """Evaluate foothold candidates.

    A candidate is feasible if the posture is OK and every load from zero, when the foot touches
    down, to the required one can be held within the effort limits and the friction cone.

    Args:
        leg: The leg; its foot must be a point in space.
        foot_position: Candidates in the leg frame (..., 3) [m].
        contact: Ground, required load and moment.

    Raises:
        KindError: If it is no leg or no contact.
        NotSupportedError: If the mechanism's end is no point foot.
        ShapeError: If shapes do not fit.
        ValueRangeError: If friction, load or moments are negative or NaN, or a normal is zero.
    """
    require("leg", leg, Leg)
    posture, twist_jacobian = leg.mechanism.inverse_with_twist(foot_position)
    return _judged(leg, posture, twist_jacobian, contact)


def judge_footholds(leg: Leg, kinematics: Kinematics, contact: Contact) -> Footholds:
    """Evaluate solved postures of a leg as footholds; see `evaluate_footholds`."""
    return _judged(leg, kinematics.posture, kinematics.twist_jacobian, contact)


def _judged(leg: Leg, posture: Posture, twist_jacobian: FloatArray, contact: Contact) -> Footholds:
    mechanism = leg.mechanism
    rows, n = twist_jacobian.shape[-2:]
    if rows != 6:
        raise NotSupportedError(
            f"mechanism {mechanism.name!r} has task coordinates "
            f"{', '.join(mechanism.task_coordinates)}: load capacity needs a point foot x, y, z"
        )
    limits = as_array("effort_limits", leg.effort_limits, n, 2)
    given = contact_rows(contact, n)
    if mechanism.has_masses:
        gravity = gravity_of(leg) if contact.gravity is None else contact.gravity
        weight = weight_efforts(mechanism, posture, gravity)
        given = _with_bias(given, weight)
    try:
        verdict, numbers = _verdicts(limits, twist_jacobian, posture.status, given)
    except ValueError:
        shapes = {"candidates": np.shape(posture.status), **leading_shapes(contact, n)}
        raise broadcast_error(shapes) from None
    if not verdict.size or has_code(verdict, WRONG_CONTACT):
        check_effort_limits(limits[:, 0], limits[:, 1])
        check_contact(contact, n)
    return Footholds(verdict, posture, numbers, mechanism.has_masses)


def _with_bias(contacts: FloatArray, efforts: FloatArray) -> FloatArray:
    """Return rows of contacts with more efforts that the actuators exert anyway."""
    batch = np.broadcast_shapes(contacts.shape[:-1], efforts.shape[:-1])
    rows = np.empty((*batch, contacts.shape[-1]))
    rows[...] = contacts
    rows[..., OF_CONTACT:] += efforts
    return rows


def _verdicts(
    limits: FloatArray, twist: FloatArray, status: StatusArray, contacts: FloatArray
) -> Any:
    """Return verdicts and numbers, quickly where that tells."""
    if len(limits) != 3:
        return _thorough_footholds(limits, twist, status, contacts)
    results = _quick_footholds(limits, twist, status, contacts)
    if not has_code(results[0], UNCERTAIN):
        return results
    thorough = partial(_thorough_footholds, limits)
    inputs = (twist, 2), (status, 0), (contacts, 1)
    return settled(results, results[0] == UNCERTAIN, thorough, *inputs)


# --------------------------------------------------------------------------- kernel

# The caller's rows of a block of problems, before CAPACITY and FORCE. From MU_E on they are
# `Footholds.numbers`, of which the efforts of the n joints are the last.
STATUS, VALID, VERDICT, MU_E, MU_FULL, MARGIN, SHARE, WORST = range(OF_CALLER, CAPACITY)


@inlined
def foothold_verdict(status, held, capacity, rough, load):
    """Return the verdict on a foothold: what its load fails by, if it fails.

    Args:
        status: `Status` of the pose; if it is not OK, that is the verdict.
        held: Whether the limits admit the leg without load; if not, the verdict is EFFORT.
        capacity: Load capacity on the ground; if it is at least the load, the foothold is FEASIBLE.
        rough: Load capacity on ground of any roughness (mu = infinity). If that is at least the
            load, the actuators could carry it and the cone is what forbids it: FRICTION. Otherwise
            no ground helps: EFFORT.
        load: Required load.
    """
    verdict = FRICTION if rough >= load else TOO_HEAVY
    verdict = FEASIBLE if capacity >= load else verdict
    verdict = verdict if held else TOO_HEAVY
    return verdict if status == OK else status


@inlined
def prepare(block, i, n):
    """Find what the limits leave to the load, and whether contact and limits are in range."""
    valid = (block[MU, i] >= 0.0) & (block[LOAD, i] >= 0.0) & (block[ANY_MOMENT, i] >= 0.0)
    moment, normal = get3(block, MOMENT, i), unit(get3(block, NORMAL, i))
    finite = normal[0] + moment[0] + moment[1] + moment[2] + block[LOAD, i] + block[ANY_MOMENT, i]
    for k in range(n):
        lower, upper = block[row_of(LOWER, n, k), i], block[row_of(UPPER, n, k), i]
        valid &= (lower <= upper) & (lower < math.inf) & (upper > -math.inf)
        finite += block[row_of(BIAS, n, k), i]
    valid &= math.isfinite(finite)
    bear_moments(block, i, n)
    held = leave_room(block, i, n)
    block[VALID, i] = 1.0 if valid else 0.0
    block[WANTED, i] = 1.0 if valid & held & (block[STATUS, i] == OK) else 0.0


@inlined
def rate_friction(block, i):
    """Find the rated friction of a leg with three actuators."""
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
    block[MU_E, i] = abs(x_slope)
    block[MU_FULL, i] = math.sqrt(x_slope * x_slope + y_slope * y_slope)


@inlined
def judge(block, i, n):
    """Find the verdict, and the force and efforts of the required load."""
    capacity, load, status = block[CAPACITY, i], block[LOAD, i], block[STATUS, i]
    solved, held = status == OK, block[WANTED, i] == 1.0
    verdict = foothold_verdict(status, held, capacity, block[ROUGH, i], load)
    verdict = UNCERTAIN if held & (block[OUTCOME, i] == UNCERTAIN) else verdict
    block[VERDICT, i] = verdict if block[VALID, i] == 1.0 else WRONG_CONTACT
    capacity = capacity if held else (0.0 if solved else math.nan)
    block[CAPACITY, i] = capacity
    part = load / capacity if load > 0.0 else 0.0
    loaded = held & math.isfinite(capacity)
    fx, fy, fz = get3(block, FORCE, i)
    fx, fy, fz = fx * part, fy * part, fz * part
    put(block, FORCE, i, (fx, fy, fz) if loaded else (math.nan, math.nan, math.nan))
    most, worst = 0.0, -1.0
    for k in range(n):
        borne = inner(get3(block, row_of(J, n, k), i), (fx, fy, fz))
        effort = block[row_of(EFFORT, n, k), i] - (borne if loaded else 0.0)
        block[row_of(EFFORT, n, k), i] = effort if solved else math.nan
        share = share_of_limits(
            effort,
            block[row_of(RESERVE, n, k), i],
            block[row_of(LOWER, n, k), i],
            block[row_of(UPPER, n, k), i],
        )
        worst = k if share > most else worst
        most = share if share > most else most
    block[SHARE, i] = most if solved else math.nan
    block[WORST, i] = worst if solved else -1.0
    block[MU_E, i] = block[MU_E, i] if solved else math.nan
    block[MU_FULL, i] = block[MU_FULL, i] if solved else math.nan
    block[MARGIN, i] = block[MU, i] - block[MU_E, i]


def _footholds_kernel(solve, joints):
    """Return a kernel that judges points of legs with so many joints, a constant, or any if 0.

    What a contact says and what is found of it stand in one row each, because every array costs a
    call as much as some points do. Both rows are 9 + n long.
    """

    @points_kernel(
        f"({joints or 'n'},2),(points,6,{joints or 'n'}),(points),(points,w)->(points),(points,w)",
        "f8 f8 u1 f8 u1 f8",
    )
    def footholds(limits, twist, status, contact, verdict, numbers):
        n = joints or len(limits)
        block = new_block(n, len(status))
        for i in range(min(BLOCK, len(status))):
            block[MU_E, i] = block[MU_FULL, i] = math.nan
            for k in range(n):
                block[row_of(LOWER, n, k), i] = limits[k, 0]
                block[row_of(UPPER, n, k), i] = limits[k, 1]
        for start in range(0, len(status), BLOCK):
            end = min(start + BLOCK, len(status))
            jacobian = twist[:, :3]
            load_numbers(block, STATUS, status, start, end)
            load(block, MU, contact, start, end, OF_CONTACT)
            load(block, row_of(BIAS, n, 0), contact[:, OF_CONTACT:], start, end, n)
            load_columns(block, row_of(J, n, 0), jacobian, start, end, n)
            load_columns(block, row_of(OMEGA, n, 0), twist[:, 3:], start, end, n)
            for i in range(end - start):
                prepare(block, i, n)
            solve(block, jacobian, start, end, n)
            if n == 3:
                for i in range(end - start):
                    rate_friction(block, i)
            for i in range(end - start):
                judge(block, i, n)
            store(block, MU_E, numbers, start, end, OF_POINT - MU_E + n)
            for i in range(end - start):
                verdict[start + i] = int(block[VERDICT, i])

    return footholds


_quick_footholds = _footholds_kernel(solve_three, 3)
_thorough_footholds = _footholds_kernel(solve_any, 0)
