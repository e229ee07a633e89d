# SPDX-License-Identifier: Apache-2.0
"""Any chain of a leg: where its bodies are, how joints move points of them, and what they weigh.

Rows of a chain (N, 8) and of its coincidences (L, 8) are those of `LegTree.chain` and `.loops`.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import numpy as np

from leg_kinematics.kernels.kernel import scalar
from leg_kinematics.kernels.scalars import direction

PARENT, PRISMATIC, AXIS, OFFSET = 0, 1, 2, 5


@scalar
def place_bodies(chain, q, rotations, origins, axes):
    """Fill rotations (N + 1, 3, 3) and origins (N + 1, 3) of the bodies and axes (N, 3) of joints.

    Body 0, the base, is at the origin of the leg frame; its first joint's offset counts from there.
    """
    for r in range(3):
        origins[0, r] = 0.0
        for c in range(3):
            rotations[0, r, c] = 1.0 if r == c else 0.0
    for k in range(len(chain)):
        parent = int(chain[k, PARENT])
        ax, ay, az = chain[k, AXIS], chain[k, AXIS + 1], chain[k, AXIS + 2]
        slide = q[k] if chain[k, PRISMATIC] == 1.0 else 0.0
        ox, oy, oz = chain[k, OFFSET], chain[k, OFFSET + 1], chain[k, OFFSET + 2]
        ox, oy, oz = ox + slide * ax, oy + slide * ay, oz + slide * az
        c, s = direction(0.0 if chain[k, PRISMATIC] == 1.0 else q[k])
        v = 1.0 - c
        for r in range(3):
            x, y, z = rotations[parent, r, 0], rotations[parent, r, 1], rotations[parent, r, 2]
            along = x * ax + y * ay + z * az
            axes[k, r] = along
            origins[k + 1, r] = origins[parent, r] + x * ox + y * oy + z * oz
            # (x, y, z) Rot(axis, q): the row turned back by q
            rotations[k + 1, r, 0] = c * x + v * along * ax + s * (y * az - z * ay)
            rotations[k + 1, r, 1] = c * y + v * along * ay + s * (z * ax - x * az)
            rotations[k + 1, r, 2] = c * z + v * along * az + s * (x * ay - y * ax)


@scalar
def point_of(rotations, origins, body, x, y, z):
    """Return a point of a body, given from its origin, in the leg frame."""
    r = rotations[body]
    return (
        origins[body, 0] + r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
        origins[body, 1] + r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
        origins[body, 2] + r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
    )


@scalar
def joint_moves(chain, k, origins, axes, x, y, z):
    """Return the velocity that a unit speed of joint k gives a point that it carries."""
    ax, ay, az = axes[k, 0], axes[k, 1], axes[k, 2]
    if chain[k, PRISMATIC] == 1.0:
        return ax, ay, az
    x, y, z = x - origins[k + 1, 0], y - origins[k + 1, 1], z - origins[k + 1, 2]
    return ay * z - az * y, az * x - ax * z, ax * y - ay * x


@scalar
def fill_foot_columns(chain, foot, rotations, origins, axes, columns):
    """Fill the twist of the foot's body (6, N) by joint speeds and return the foot."""
    body = int(foot[0])
    x, y, z = point_of(rotations, origins, body, foot[1], foot[2], foot[3])
    columns[:, :] = 0.0
    while body > 0:
        k = body - 1
        columns[0, k], columns[1, k], columns[2, k] = joint_moves(chain, k, origins, axes, x, y, z)
        if chain[k, PRISMATIC] != 1.0:
            columns[3, k], columns[4, k], columns[5, k] = axes[k, 0], axes[k, 1], axes[k, 2]
        body = int(chain[k, PARENT])
    return x, y, z


@scalar
def fill_weights(chain, masses, gravity, rotations, origins, axes, weights):
    """Fill the efforts of gravity at all joints (N,): what it adds to each joint's motion.

    Mass and moment of what a joint carries are summed from the ends of the chain to the base.
    """
    n = len(chain)
    carried = np.zeros((n + 1, 4))
    for k in range(n - 1, -1, -1):
        mass = masses[k, 0]
        x, y, z = point_of(rotations, origins, k + 1, masses[k, 1], masses[k, 2], masses[k, 3])
        here, parent = carried[k + 1], carried[int(chain[k, PARENT])]
        here[0] += mass
        here[1] += mass * x
        here[2] += mass * y
        here[3] += mass * z
        gx, gy, gz = gravity[0], gravity[1], gravity[2]
        ax, ay, az = axes[k, 0], axes[k, 1], axes[k, 2]
        if chain[k, PRISMATIC] == 1.0:
            weights[k] = here[0] * (ax * gx + ay * gy + az * gz)
        else:
            x = here[1] - here[0] * origins[k + 1, 0]
            y = here[2] - here[0] * origins[k + 1, 1]
            z = here[3] - here[0] * origins[k + 1, 2]
            weights[k] = ax * (y * gz - z * gy) + ay * (z * gx - x * gz) + az * (x * gy - y * gx)
        for r in range(4):
            parent[r] += here[r]
