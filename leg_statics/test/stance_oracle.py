# SPDX-License-Identifier: Apache-2.0
"""Random stances, and the conic solver clarabel that is asked the same.

`python leg_statics/test/stance_oracle.py 10000` compares so many and prints what differs.
"""

from __future__ import annotations

import sys
from functools import lru_cache

import clarabel
import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from leg_kinematics import load_robot
from leg_statics.stance.stances import Load, Stance, as_arrays, load_factor
from leg_statics.workspace import workspace_bounds

KINDS = (
    "plain",
    "outside",
    "frictionless",
    "rough",
    "slopes",
    "collinear",
    "one foot",
    "two feet",
    "powerless",
    "one-sided",
    "ill-conditioned",
    "singular",
    "without limits",
    "wrench",
    "bias",
    "tilted",
)


@lru_cache
def pool(robot_name):
    """Return many reachable feet (m, L, 3), their Jacobians and limits, in the base frame."""
    rng = np.random.default_rng(7)
    feet, jacobians, limits = [], [], []
    for leg in load_robot(robot_name).legs.values():
        low, high = workspace_bounds(leg.mechanism).T
        posture = leg.mechanism.inverse(rng.uniform(low, high, (4000, 3)))
        found = np.flatnonzero(posture.status == 0)[:300]
        feet.append(leg.mount.to_base(posture.foot_position[found]))
        jacobians.append(leg.mount.rotation @ leg.mechanism.jacobian(posture)[found])
        limits.append(leg.effort_limits)
    return np.stack(feet, 1), np.stack(jacobians, 1), np.stack(limits)


def random_stance(rng, kind):
    """Return a stance and a load of a kind."""
    if rng.random() < 0.3:  # legs of no robot of ours, as of a model file
        legs, n = int(rng.integers(3, 7)), int(rng.choice([2, 3, 3, 3, 4, 6]))
        feet = rng.uniform([-0.8, -0.6, -0.9], [0.8, 0.6, -0.5], (legs, 3))
        jacobian = rng.normal(0.0, 0.3, (legs, 3, n))
        upper = 10.0 ** rng.uniform(1.0, 3.0, (legs, n))
        lower = -upper
    else:
        feet, jacobian, limits = pool(str(rng.choice(["hexapod", "quadruped", "solo12"])))
        rows = rng.integers(len(feet), size=feet.shape[1])
        which = np.arange(feet.shape[1])
        feet, jacobian = feet[rows, which], jacobian[rows, which]
        lower, upper = limits[..., 0].copy(), limits[..., 1].copy()
        legs, n = jacobian.shape[0], jacobian.shape[2]
    stands = np.zeros(legs, bool)
    count = {"one foot": 1, "two feet": 2}.get(kind, int(rng.integers(3, legs + 1)))
    stands[rng.permutation(legs)[:count]] = True
    center = feet[stands].mean(0) + rng.normal(0.0, 0.1, 3)
    friction = rng.uniform(0.2, 1.0, legs)
    normal = np.tile([0.0, 0.0, 1.0], (legs, 1))
    bias = np.zeros((legs, n))
    load = {"mass": 10.0 ** rng.uniform(0.5, 2.5)}
    if kind == "outside":
        center[:2] += rng.normal(0.0, 1.0, 2)
    elif kind == "frictionless":
        friction[:] = 0.0
    elif kind == "rough":
        friction[:] = np.inf
    elif kind == "slopes":
        normal = normal + rng.normal(0.0, 0.4, (legs, 3))
        friction[rng.integers(legs)] = 0.0
    elif kind == "collinear":
        feet[:] = feet[0] + rng.uniform(-1.0, 1.0, (legs, 1)) * np.array([1.0, 0.3, 0.0])
        center = feet[stands].mean(0) * rng.uniform(0.9, 1.0)
    elif kind == "one foot":
        center = feet[stands][0] + np.array([0.0, 0.0, 0.7])
    elif kind == "two feet":
        center = feet[stands].mean(0)
    elif kind == "powerless":
        powerless = rng.random((legs, n)) < 0.2
        upper[powerless] *= 1e-9
        lower[powerless] *= 1e-9
    elif kind == "one-sided":
        lower[rng.random((legs, n)) < 0.3] = 0.0
    elif kind == "ill-conditioned":
        u, size, v = np.linalg.svd(jacobian, full_matrices=False)
        size[..., -1] *= 10.0 ** rng.uniform(-6.0, 0.0, legs)
        jacobian = u * size[..., None, :] @ v
    elif kind == "singular":
        jacobian[..., 0] = jacobian[..., 1]
    elif kind == "without limits":
        upper[:], lower[:] = np.inf, -np.inf
    elif kind == "wrench":
        load |= {"force": rng.normal(0.0, 100.0, 3), "moment": rng.normal(0.0, 30.0, 3)}
    elif kind == "bias":
        bias = rng.uniform(-0.6, 0.6, (legs, n)) * np.minimum(upper, -lower)
    elif kind == "tilted":
        load["gravity"] = Rotation.random(random_state=rng).as_matrix()[2] * 9.80665
        if load["gravity"][2] > 0.0:
            load["gravity"] = -load["gravity"]
    stance = Stance(feet, jacobian, lower, upper, friction, normal, bias, stands)
    return stance, Load(center_of_mass=center, **load)


def conic_rows(stance):
    """Return equations, rows, rooms and cones of the legs that stand, of a stance of arrays.

    Unknowns are forces in newtons, x, y, z of each leg.
    """
    legs = np.flatnonzero(stance.stands)
    size = 3 * len(legs)
    balance, rows, rooms, cones = np.zeros((6, size)), [], [], []
    for k, i in enumerate(legs):
        own = slice(3 * k, 3 * k + 3)
        x, y, z = stance.position[i]
        balance[:3, own] = np.eye(3)
        balance[3:, own] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
        for j in range(stance.jacobian.shape[-1]):
            for sign, room in (
                (1.0, stance.bias_efforts[i, j] - stance.effort_lower[i, j]),
                (-1.0, stance.effort_upper[i, j] - stance.bias_efforts[i, j]),
            ):
                if np.isfinite(room):
                    row = np.zeros(size)
                    row[own] = sign * stance.jacobian[i, :, j]
                    rows.append(row)
                    rooms.append(room)
        normal = stance.normal[i] / np.linalg.norm(stance.normal[i])
        across = np.linalg.svd(normal[None])[2][1:]
        if stance.friction[i] in (0.0, np.inf):  # a cone of 0 would admit pull
            row = np.zeros(size)
            row[own] = -normal
            rows.append(row)
            rooms.append(0.0)
        if np.isfinite(stance.friction[i]):
            cone = np.zeros((3, size))
            cone[:, own] = -np.array([stance.friction[i] * normal, *across])
            cones.append(cone)
    return balance, np.reshape(rows, (-1, size)), np.array(rooms), cones


def greatest_by_clarabel(stance, fixed, growing, free=None):
    """Return (status, greatest multiple) of a growing wrench beside a fixed one, by clarabel."""
    balance, rows, rooms, cones = conic_rows(as_arrays(stance))
    unit = max(np.linalg.norm(growing[:3]), np.linalg.norm(fixed[:3]), 1.0)
    extra = [growing / unit]
    if free is not None:
        extra.append(np.concatenate([np.zeros(3), free]))
    equations = np.column_stack([balance, *extra])
    n = equations.shape[1]
    objective = np.zeros(n)
    objective[balance.shape[1]] = -1.0
    wide = [np.pad(block, ((0, 0), (0, len(extra)))) for block in [rows, *cones]]
    # in units of force, so that rows and unknowns are of magnitude 1
    length = np.maximum(np.linalg.norm(wide[0], axis=1) * unit, np.abs(rooms))
    length[length == 0.0] = 1.0
    wide[0] = wide[0] * (unit / length)[:, None]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 200
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    settings.tol_infeas_abs = settings.tol_infeas_rel = 1e-11
    kinds = [clarabel.ZeroConeT(6)]
    kinds += [clarabel.NonnegativeConeT(len(rooms))] if len(rooms) else []
    kinds += [clarabel.SecondOrderConeT(3)] * len(cones)
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((n, n)),
        objective,
        sparse.csc_matrix(np.vstack([equations, *wide])),
        np.concatenate([-fixed / unit, rooms / length, np.zeros(3 * len(cones))]),
        kinds,
        settings,
    ).solve()
    return str(solution.status), -solution.obj_val


def compare(count, seed=0, kinds=KINDS, tell=print):
    """Compare load factors of random stances; return how many clarabel solved and which differ."""
    rng = np.random.default_rng(seed)
    solved, different = 0, []
    for k in range(count):
        kind = kinds[k % len(kinds)]
        stance, load = random_stance(rng, kind)
        found = load_factor(stance, load)
        status, value = greatest_by_clarabel(stance, load.further, load.weight)
        ours = float(found.multiple)
        if status == "Solved":
            same = abs(ours - value) <= 1e-6 * max(1.0, abs(value))
        elif status in ("DualInfeasible", "AlmostDualInfeasible"):
            same = ours == np.inf
        elif status in ("PrimalInfeasible", "AlmostPrimalInfeasible"):
            same = np.isnan(ours) and int(found.status) == 2
        else:
            continue
        solved += 1
        if not same:
            different.append((k, kind, status, value, int(found.status), ours))
            tell(*different[-1])
    return solved, different


if __name__ == "__main__":
    number = int(sys.argv[1])
    solved, different = compare(number)
    print(f"{number} stances, {solved} solved by clarabel, {len(different)} differ")
    sys.exit(bool(different))
