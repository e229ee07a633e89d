# SPDX-License-Identifier: Apache-2.0
"""What is asked of solved postures of a chain: Jacobians, efforts of the weight, joints' places."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

import math
from typing import Any

import numpy as np

from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.model.chain import fill_weights, place_bodies
from leg_kinematics.model.equations import Equations, eliminate, evaluate, fill_loops, new_room


@points_kernel(
    "(n,8),(l,8),(4),(r),(a),(p),(a),(3),(2),(points,n)->(points,6,a)",
    "f8 f8 f8 f8 f8 f8 f8 f8 f8 f8 f8",
)
def twist_jacobian(
    chain: Any, loops: Any, foot: Any, rows: Any, actuated: Any, passive: Any, rest: Any,
    normal: Any, signs: Any, q: Any, twist: Any,
) -> None:  # fmt: skip
    """J above J_omega of postures (n,)."""
    leg = Equations(chain, loops, foot, rows, actuated, passive, rest, normal, signs)
    room = new_room(len(chain), len(loops), len(actuated))
    for i in range(len(q)):
        evaluate(leg, q[i], room)
        twist[i] = room.twist


@points_kernel(
    "(n,8),(l,8),(n,4),(r),(a),(p),(points,n),(points,3)->(points,a)",
    "f8 f8 f8 f8 f8 f8 f8 f8 f8",
)
def holding_efforts(
    chain: Any, loops: Any, masses: Any, rows: Any, actuated: Any, passive: Any, q: Any,
    gravity: Any, efforts: Any,
) -> None:  # fmt: skip
    """Efforts of the actuators that hold the links' weight in postures (n,).

    A passive joint bears nothing, so what gravity does to it reaches the actuators: Xᵀ of it.
    """
    n, m = len(actuated), len(passive)
    room, weights = new_room(len(chain), len(loops), n), np.empty(len(chain))
    for i in range(len(q)):
        place_bodies(chain, q[i], room.rotations, room.origins, room.axes)
        fill_weights(chain, masses, gravity[i], room.rotations, room.origins, room.axes, weights)
        sign = 1.0
        if m:
            fill_loops(chain, loops, room)
            sign = eliminate(rows, actuated, passive, room)
        for c in range(n):
            total = -weights[int(actuated[c])]
            for k in range(m):
                total += weights[int(passive[k])] * room.work[k, m + c]
            efforts[i, c] = total if sign != 0.0 else math.nan


@points_kernel("(n,8),(points,n)->(points,n,3)", "f8 f8 f8")
def joint_places(chain: Any, q: Any, places: Any) -> None:
    """Origins of the joints in the leg frame."""
    n = len(chain)
    rotations, origins, axes = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n, 3))
    for i in range(len(q)):
        place_bodies(chain, q[i], rotations, origins, axes)
        places[i] = origins[1:]
