# SPDX-License-Identifier: Apache-2.0
"""Choose body height and step length for ice, wood and cement, for all legs together.

Start the nodes with `make run`; then, in another terminal:

    ./leg python examples/03_choose_height_and_step.py
"""

import sys

import numpy as np
from leg_msgs_py.client import LegClient
from leg_msgs_py.errors import ServerUnavailableError

LOAD = 600.0  # N, on each foot
HEIGHTS = np.arange(0.50, 0.751, 0.05)  # of the base frame over the ground [m]

print("longest step [m] at body height", *(f"{height:8.2f}" for height in HEIGHTS), "m")
with LegClient(timeout=10.0) as client:
    for ground in ("ice", "wood", "cement"):
        try:
            by_load, by_friction = (
                client.query_step_length((), -HEIGHTS, ground, LOAD, by_rated_friction=rated)
                for rated in (False, True)
            )
        except ServerUnavailableError as error:
            sys.exit(f"{error}\nStart the nodes first: make run")
        # The legs carry the load, and need no rougher ground than this even at full efforts.
        steps = np.minimum(by_load.common_length, by_friction.common_length)
        best = int(np.argmax(steps))
        print(f"  {ground:7} mu = {by_load.friction_coefficient:4.2f}         ", end=" ")
        print(*(f"{step:8.3f}" for step in steps), end="   ")
        print(f"-> height {HEIGHTS[best]:.2f} m, step {steps[best]:.3f} m")
