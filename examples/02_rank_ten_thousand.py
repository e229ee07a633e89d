# SPDX-License-Identifier: Apache-2.0
"""Rank 10,000 candidate footholds of a leg in one call, and see why the others fail.

Start the nodes with `make run`; then, in another terminal:

    ./leg python examples/02_rank_ten_thousand.py
"""

import sys
import time

import numpy as np
from leg_msgs.msg import FootholdVerdict
from leg_msgs_py.client import LegClient
from leg_msgs_py.errors import ServerUnavailableError

LEG = "left_middle"
LOAD = 500.0  # N
LOW, HIGH = [-0.4, -0.3, -0.75], [0.2, 0.3, -0.5]  # box of candidates in the leg's own frame [m]
REASONS = ("REACH", "JOINT_RANGE", "PASSIVE_JOINT", "SINGULAR", "FRICTION", "EFFORT")

candidates = np.random.default_rng(1).uniform(LOW, HIGH, size=(10_000, 3))
with LegClient(timeout=10.0) as client:
    try:
        client.query_footholds(LEG, candidates[:1], ground="wood", load=LOAD)  # connects
        started = time.perf_counter()
        answer = client.query_footholds(LEG, candidates, ground="wood", load=LOAD)
        duration = time.perf_counter() - started
    except ServerUnavailableError as error:
        sys.exit(f"{error}\nStart the nodes first: make run")

print(f"{len(candidates)} candidates on wood in {1e3 * duration:.1f} ms")
print(f"{len(answer.ranking)} carry {LOAD:g} N; the best five:")
for k in answer.ranking[:5]:
    x, y, z = candidates[k]
    carries, margin = answer.load_capacity[k], answer.margin[k]
    print(f"  ({x:6.3f}, {y:6.3f}, {z:6.3f}) m carries {carries:5.0f} N, margin {margin:.2f}")
for reason in REASONS:
    count = np.count_nonzero(answer.verdict == getattr(FootholdVerdict, reason))
    print(f"  {reason.lower().replace('_', ' '):14} {count:5d} candidates")
