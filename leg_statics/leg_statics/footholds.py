# SPDX-License-Identifier: Apache-2.0
"""Footholds: can the leg reach it, what does it carry there, and if not enough, why not."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.arguments import require
from leg_kinematics.arrays import (
    FloatArray,
    StatusArray,
    as_array,
    as_non_negative,
    broadcast_error,
    has_code,
)
from leg_kinematics.errors import NotSupportedError
from leg_kinematics.kernels.settled import UNCERTAIN, settled
from leg_kinematics.mechanism import Posture
from leg_kinematics.robot import Leg
from leg_statics.capacity.problem import FORCE, OF_CONTACT, OF_POINT, check_effort_limits
from leg_statics.contact import Contact as Contact
from leg_statics.contact import check_contact, contact_rows, leading_shapes
from leg_statics.foothold_kernel import AMPLE_CLEARANCE as AMPLE_CLEARANCE
from leg_statics.foothold_kernel import (
    CARRIED,
    CLEARANCE,
    FEASIBLE,
    FRICTION_LEFT,
    MARGIN,
    MU_E,
    MU_FULL,
    SHARE,
    VERDICT,
    WORST,
    WRONG_CONTACT,
    quick_footholds,
    thorough_footholds,
)
from leg_statics.foothold_kernel import Verdict as Verdict
from leg_statics.kinematics import Kinematics
from leg_statics.weight import level_gravity, weight_efforts

GOLDEN = 0.5 * (1.0 + 5.0**0.5)
# The corners of an icosahedron, at even distances all around.
CORNERS = np.array(
    [
        np.roll([0.0, a, GOLDEN * b], turn) / np.hypot(1.0, GOLDEN)
        for turn in range(3)
        for a in (-1.0, 1.0)
        for b in (-1.0, 1.0)
    ]
)
AROUND = np.concatenate([np.zeros((1, 3)), CORNERS])  # a candidate and the points around it


class Footholds(NamedTuple):
    """Evaluation of foothold candidates (...,).

    Attributes:
        verdict: A `Verdict` each.
        posture: The solved postures.
        numbers: All else that was found, in columns (..., 12 + n); the properties name them.
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
        """Largest load, the part of the ground's force in its direction [N].

        Infinite if the structure alone carries any load, NaN without a posture, 0 if not even an
        unloaded foot can be held.
        """
        return self._columns(CARRIED)

    @property
    def rated_friction(self) -> FloatArray:
        """mu_e = |F_x / F_z|, forward over vertical, equation (22)."""
        return self._columns(MU_E)

    @property
    def rated_friction_full(self) -> FloatArray:
        """sqrt(F_x² + F_y²) / F_z of the same force."""
        return self._columns(MU_FULL)

    @property
    def clearance(self) -> FloatArray:
        """How far the foot may move, to first order, before an actuated joint is at a limit [m].

        The least over the joints of the room to the nearer limit by the length of the joint's row
        of the inverse of J. It goes to zero at a singularity, too, where joints run away. Infinite
        without limits or if the leg has no inverse.
        """
        return self._columns(CLEARANCE)

    @property
    def margin(self) -> FloatArray:
        """How far a feasible foothold is from failing, 1 = farthest; NaN if it is not feasible.

        The least of what is left of the load, 1 - load / load_capacity, of the friction, 1 -
        rated_friction_full / mu, and of `clearance` by `AMPLE_CLEARANCE`, at most 1. It is below 0
        where the ground is smoother than rated: the load is then carried by a force of the cone
        that needs more of the actuators.
        """
        return self._columns(MARGIN)

    @property
    def friction_margin(self) -> FloatArray:
        """What the ground offers beyond the rated friction, mu - mu_e."""
        return self._columns(FRICTION_LEFT)

    @property
    def utilisation(self) -> FloatArray:
        """Share of its limit that the most used joint exerts, with the force that needs least.

        That is the least share over all forces of the friction cone with the required load. It is
        at most 1 if the foothold is feasible, above 1 if the load is too large for the limits or
        the cone, infinite if a joint without power would have to exert something.
        """
        return self._columns(SHARE)

    @property
    def limiting_joint(self) -> NDArray[np.int32]:
        """Index of that joint, -1 for none."""
        return self._columns(WORST).astype(np.int32)

    @property
    def force(self) -> FloatArray:
        """Ground reaction with the required load that uses the actuators least (..., 3) [N]."""
        return self._columns(FORCE, OF_POINT)

    @property
    def joint_efforts(self) -> FloatArray:
        """Efforts that hold it, beyond the limits if need be (..., n) [N.m or N]."""
        return self._columns(OF_POINT, None)

    def _columns(self, *rows: int | None) -> FloatArray:
        """Return what stands in a row of the kernel's block, or from one row to before another.

        It is a copy: whoever keeps it does not keep all the others.
        """
        ends = [None if row is None else row - VERDICT for row in rows]
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
        """Flat indices of the feasible candidates, largest margin first.

        Equal margins are ordered by the load capacity.
        """
        return self._ranked(self.margin, self.load_capacity)

    @property
    def ranking_by_capacity(self) -> NDArray[np.int64]:
        """Flat indices of the feasible candidates, largest load capacity first.

        The largest capacities are often next to a singularity, where a small error of the foot is
        too much. Equal capacities are ordered by the margin.
        """
        return self._ranked(self.load_capacity, self.margin)

    def _ranked(self, first: FloatArray, then: FloatArray) -> NDArray[np.int64]:
        """Return the feasible candidates, the largest first."""
        feasible = np.flatnonzero(self.feasible)
        if len(feasible) < 2:  # as in a request for one foothold
            return feasible
        values = np.ravel(first)[feasible]
        order = np.argsort(-values, kind="stable")
        if np.any(np.diff(values[order]) == 0.0):  # rarely; it takes ten times as long
            order = np.lexsort((-np.ravel(then)[feasible], -values))
        return feasible[order]


def evaluate_footholds(
    leg: Leg, foot_position: ArrayLike, contact: Contact, assembly_mode: str = ""
) -> Footholds:
    """Evaluate foothold candidates.

    A candidate is feasible if the posture is OK and every load from zero, when the foot touches
    down, to the required one can be held within the effort limits by some force of the friction
    cone, of which the load is the part against gravity, or in the direction that the contact says.
    The rest is left to the other legs.

    Args:
        leg: The leg; its foot must be a point in space.
        foot_position: Candidates in the leg frame (..., 3) [m].
        contact: Ground, required load and moment.
        assembly_mode: Branch of the closed chain; "" is the default.

    Raises:
        KindError: If it is no leg or no contact.
        UnknownNameError: If the leg has no such assembly mode.
        NotSupportedError: If the mechanism's end is no point foot.
        ShapeError: If shapes do not fit.
        ValueRangeError: If friction, load or moments are negative or NaN, or a normal is zero or
            points into the ground.
    """
    require("leg", leg, Leg)
    posture, twist_jacobian = leg.mechanism.inverse_with_twist(foot_position, assembly_mode)
    return _judged(leg, posture, twist_jacobian, contact)


def evaluate_around(
    leg: Leg, foot_position: ArrayLike, contact: Contact, radius: float, assembly_mode: str = ""
) -> Footholds:
    """Evaluate candidates of which the foot may miss each by a distance, in any direction.

    A candidate is feasible if it is and 12 points around it are, at even distances on a sphere. The
    first of these that is not tells the verdict; load capacity and margin are the least of all.

    Args:
        leg: The leg; its foot must be a point in space.
        foot_position: Candidates in the leg frame (..., 3) [m].
        contact: Ground, required load and moment.
        radius: How far from a candidate the foot may come down [m].
        assembly_mode: Branch of the closed chain; "" is the default.

    Raises:
        UnknownNameError: If the leg has no such assembly mode.
        NotSupportedError: If the mechanism's end is no point foot.
        ShapeError: If shapes do not fit.
        ValueRangeError: If a value is out of range.
    """
    size = float(as_non_negative("radius", radius))
    feet = as_array("foot_position", foot_position, 3)
    around = feet[..., None, :] + size * AROUND
    found = evaluate_footholds(leg, around, contact.spread(), assembly_mode)
    fails = ~found.feasible
    first = np.argmax(fails, axis=-1)[..., None]  # the candidate itself comes first
    verdict = np.take_along_axis(found.verdict, first, axis=-1)[..., 0]
    numbers = found.numbers[..., 0, :].copy()
    numbers[..., 0] = verdict
    numbers[..., CARRIED - VERDICT] = np.fmin.reduce(found.load_capacity, axis=-1)
    numbers[..., MARGIN - VERDICT] = np.min(found.margin, axis=-1)  # NaN if one of them is
    joints, closure, foot, status = found.posture
    posture = Posture(joints[..., 0, :], closure[..., 0, :], foot[..., 0, :], status[..., 0])
    return Footholds(verdict, posture, numbers, found.weight_counted)


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
    given = contact_rows(contact, leg)
    if mechanism.has_masses:
        gravity = level_gravity(leg) if contact.gravity is None else contact.gravity
        given = _with_bias(given, weight_efforts(mechanism, posture, gravity))
    try:
        verdict, numbers = _verdicts(leg, limits, posture, twist_jacobian, given)
    except ValueError:
        shapes = {"candidates": np.shape(posture.status), **leading_shapes(contact, leg)}
        raise broadcast_error(shapes) from None
    if not verdict.size or has_code(verdict, WRONG_CONTACT):
        check_effort_limits(limits[:, 0], limits[:, 1])
        check_contact(contact, leg)
    return Footholds(verdict, posture, numbers, mechanism.has_masses)


def _with_bias(contacts: FloatArray, efforts: FloatArray) -> FloatArray:
    """Return rows of contacts with more efforts that the actuators exert anyway."""
    batch = np.broadcast_shapes(contacts.shape[:-1], efforts.shape[:-1])
    rows = np.empty((*batch, contacts.shape[-1]))
    rows[...] = contacts
    rows[..., OF_CONTACT:] += efforts
    return rows


def _verdicts(
    leg: Leg, limits: FloatArray, posture: Posture, twist: FloatArray, contacts: FloatArray
) -> Any:
    """Return verdicts and numbers, quickly where that tells."""
    of_leg = limits, leg.mechanism.joint_limits
    of_points = posture.joint_positions, twist, posture.status, contacts
    if len(limits) != 3:
        return thorough_footholds(*of_leg, *of_points)
    results = quick_footholds(*of_leg, *of_points)
    if not has_code(results[0], UNCERTAIN):
        return results
    inputs = zip(of_points, (1, 2, 0, 1), strict=True)
    return settled(results, results[0] == UNCERTAIN, partial(thorough_footholds, *of_leg), *inputs)
