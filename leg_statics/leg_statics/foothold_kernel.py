# SPDX-License-Identifier: Apache-2.0
"""What a foothold is worth, point by point: the verdict, and the kernels that find it."""

# The compiler infers the types of the scalar code below; only what Python calls is annotated.
# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from enum import IntEnum

from leg_kinematics.kernels.blocks import BLOCK, get3, load, load_columns, load_numbers, put, store
from leg_kinematics.kernels.kernel import inlined
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.settled import UNCERTAIN
from leg_kinematics.kernels.vectors import cross, inner, unit
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
    ROOM_UP,
    ROUGH,
    UPPER,
    VERTICAL,
    WANTED,
    J,
    bear_moments,
    leave_room,
    new_block,
    relieve_any,
    relieve_three,
    row_of,
    solve_any,
    solve_three,
)
from leg_statics.efforts import share_of_limits
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
        FRICTION: The actuators could carry the load, but by no force of the cone: the foot would
            slip.
        EFFORT: The actuators cannot carry the load, whatever force the ground gives, or not even
            hold the unloaded foot.

    `foothold_verdict` decides. All is said of one leg: whether the robot stands is not.
    """

    FEASIBLE = 0
    REACH = 1
    JOINT_RANGE = 2
    PASSIVE_JOINT = 3
    SINGULAR = 4
    INVALID_INPUT = 5
    FRICTION = 6
    EFFORT = 7


AMPLE_CLEARANCE = 0.1  # m, which takes nothing from a foothold's margin
FEASIBLE, FRICTION, TOO_HEAVY = map(int, (Verdict.FEASIBLE, Verdict.FRICTION, Verdict.EFFORT))
OK = int(Status.OK)
WRONG_CONTACT = 255  # instead of a verdict, where the contact or a limit is out of range


# The caller's rows of a block of problems, before FORCE. From VERDICT on they are
# `Footholds.numbers`, of which the efforts of the n joints are the last.
STATUS, VALID, VERDICT, MU_E, MU_FULL, FRICTION_LEFT = range(OF_CALLER, OF_CALLER + 6)
SHARE, WORST, CARRIED, CLEARANCE, MARGIN = range(OF_CALLER + 6, FORCE)


@inlined
def foothold_verdict(status, held, capacity, rough, load):
    """Return the verdict on a foothold: what its load fails by, if it fails.

    Args:
        status: `Status` of the pose; if it is not OK, that is the verdict.
        held: Whether the limits admit the leg without load; if not, the verdict is EFFORT.
        capacity: Load capacity on the ground; if it is at least the load, the foothold is FEASIBLE.
        rough: Load capacity if the ground gave any force. If that is at least the load, the
            actuators could carry it and the cone is what forbids it: FRICTION. Otherwise no ground
            helps: EFFORT.
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
    vertical = unit(get3(block, VERTICAL, i))
    valid &= inner(normal, vertical) > 0.0
    finite = moment[0] + moment[1] + moment[2] + block[LOAD, i] + block[ANY_MOMENT, i]
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
def clear_limits(block, positions, ranges, start, end):
    """Find the clearance of a leg with three actuators; the rows of the room are free again.

    The rows of the inverse of J are the cross products of its columns by their determinant.
    """
    for i in range(end - start):
        for k in range(3):  # each time, since the rows were in use
            block[row_of(ROOM_UP, 3, k), i] = positions[start + i, k]
    for i in range(end - start):
        a, b = get3(block, row_of(J, 3, 0), i), get3(block, row_of(J, 3, 1), i)
        c = get3(block, row_of(J, 3, 2), i)
        normals = cross(b, c), cross(c, a), cross(a, b)
        clearance = math.inf
        for k in range(3):
            position = block[row_of(ROOM_UP, 3, k), i]
            below, above = position - ranges[k, 0], ranges[k, 1] - position
            room = below if below < above else above
            room = room if room > 0.0 else 0.0
            distance = room / math.sqrt(inner(normals[k], normals[k]))
            clearance = distance if distance < clearance else clearance
        block[CLEARANCE, i] = clearance * abs(inner(a, normals[0]))


@inlined
def judge(block, i):
    """Find the verdict and the load capacity."""
    capacity, status = block[CAPACITY, i], block[STATUS, i]
    solved, held = status == OK, block[WANTED, i] == 1.0
    verdict = foothold_verdict(status, held, capacity, block[ROUGH, i], block[LOAD, i])
    verdict = UNCERTAIN if held & (block[OUTCOME, i] == UNCERTAIN) else verdict
    block[VERDICT, i] = verdict if block[VALID, i] == 1.0 else WRONG_CONTACT
    block[CARRIED, i] = capacity if held else (0.0 if solved else math.nan)


@inlined
def share_efforts(block, i, n):
    """Find the force and efforts of the required load, and the share of the limits they use."""
    load, solved = block[LOAD, i], block[STATUS, i] == OK
    asked = solved & (load > 0.0) & (block[VALID, i] == 1.0)
    uncertain = asked & (block[OUTCOME, i] == UNCERTAIN)
    block[VERDICT, i] = UNCERTAIN if uncertain else block[VERDICT, i]
    used = load / block[CAPACITY, i]
    # a load that is carried uses no more than the limits, whatever rounding says
    used = 1.0 if (block[VERDICT, i] == FEASIBLE) & (used > 1.0) else used
    fx, fy, fz = get3(block, FORCE, i)
    force = fx * load, fy * load, fz * load
    most, worst = 0.0, -1.0
    for k in range(n):
        borne = inner(get3(block, row_of(J, n, k), i), force)
        effort = block[row_of(EFFORT, n, k), i] - (borne if asked else 0.0)
        block[row_of(EFFORT, n, k), i] = effort if solved else math.nan
        share = share_of_limits(
            effort,
            block[row_of(RESERVE, n, k), i],
            block[row_of(LOWER, n, k), i],
            block[row_of(UPPER, n, k), i],
        )
        # a joint without power that need not exert anything exerts no more than rounding
        share = 0.0 if asked & (share == math.inf) & (used < math.inf) else share
        worst = k if share > most else worst
        most = share if share > most else most
    nowhere = (math.nan, math.nan, math.nan)
    put(block, FORCE, i, force if asked else ((0.0, 0.0, 0.0) if solved else nowhere))
    block[SHARE, i] = (used if asked else most) if solved else math.nan
    block[WORST, i] = worst if solved else -1.0
    block[MU_E, i] = block[MU_E, i] if solved else math.nan
    block[MU_FULL, i] = block[MU_FULL, i] if solved else math.nan
    block[FRICTION_LEFT, i] = block[MU, i] - block[MU_E, i]
    block[CLEARANCE, i] = block[CLEARANCE, i] if solved else math.nan
    left = 1.0 - load / block[CARRIED, i] if load > 0.0 else 1.0
    rough = 1.0 - block[MU_FULL, i] / block[MU, i] if block[MU_FULL, i] > 0.0 else 1.0
    clear = block[CLEARANCE, i] / AMPLE_CLEARANCE
    least = left if left < rough else rough
    least = clear if clear < least else least  # neither of which is above 1
    block[MARGIN, i] = least if block[VERDICT, i] == FEASIBLE else math.nan


def _footholds_kernel(solve, relieve, joints):
    """Return a kernel that judges points of legs with so many joints, a constant, or any if 0.

    What a contact says and what is found of it stand in one row each, because every array costs a
    call as much as some points do. Both rows are 12 + n long.
    """
    n = joints or "n"

    @points_kernel(
        f"({n},2),({n},2),(points,{n}),(points,6,{n}),(points),(points,w)->(points),(points,w)",
        "f8 f8 f8 f8 u1 f8 u1 f8",
    )
    def footholds(limits, ranges, positions, twist, status, contact, verdict, numbers):
        n = joints or len(limits)
        block = new_block(n, len(status))
        for i in range(min(BLOCK, len(status))):
            block[MU_E, i] = block[MU_FULL, i] = math.nan
            for k in range(n):
                block[row_of(LOWER, n, k), i] = limits[k, 0]
                block[row_of(UPPER, n, k), i] = limits[k, 1]
        for start in range(0, len(status), BLOCK):
            end = min(start + BLOCK, len(status))
            load_numbers(block, STATUS, status, start, end)
            load(block, MU, contact, start, end, OF_CONTACT)
            load(block, row_of(BIAS, n, 0), contact[:, OF_CONTACT:], start, end, n)
            load_columns(block, row_of(J, n, 0), twist[:, :3], start, end, n)
            load_columns(block, row_of(OMEGA, n, 0), twist[:, 3:], start, end, n)
            for i in range(end - start):
                block[CLEARANCE, i] = math.inf
                prepare(block, i, n)
            solve(block, end - start, n)
            if n == 3:
                for i in range(end - start):
                    rate_friction(block, i)
                clear_limits(block, positions, ranges, start, end)
            for i in range(end - start):
                judge(block, i)
            relieve(block, end - start, n)
            for i in range(end - start):
                share_efforts(block, i, n)
            store(block, VERDICT, numbers, start, end, OF_POINT - VERDICT + n)
            for i in range(end - start):
                verdict[start + i] = int(block[VERDICT, i])

    return footholds


quick_footholds = _footholds_kernel(solve_three, relieve_three, 3)
thorough_footholds = _footholds_kernel(solve_any, relieve_any, 0)
