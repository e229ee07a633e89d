# SPDX-License-Identifier: Apache-2.0
"""Evaluates many footholds and prints how much memory that took at most [B].

Arguments: number of points, points in one call.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

sys.path.insert(1, str(Path(__file__).resolve().parent.parent))

from workload import BATCH, CONTACT, hexapod_leg, reachable_positions

from leg_statics.footholds import evaluate_footholds

STATUS, CLEAR_PEAK = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def main() -> None:
    """Keep the load capacities of all points and print the growth of the peak."""
    count, chunk = map(int, sys.argv[1:3])
    leg = hexapod_leg()
    few = reachable_positions(leg.mechanism)
    evaluate_footholds(leg, few, CONTACT)
    CLEAR_PEAK.write_text("5")
    before = resident("VmRSS")
    capacities = np.empty(count)
    for start in range(0, count, chunk):
        size = min(chunk, count - start)
        feet = np.resize(few, (size, 3)) if size > BATCH else few[:size]
        found = evaluate_footholds(leg, feet, CONTACT)
        capacities[start : start + size] = found.load_capacity
    print(resident("VmHWM") - before)


def resident(field: str) -> int:
    """Return the resident memory of this process [B]: "VmRSS" is it now, "VmHWM" its peak."""
    line = re.search(rf"{field}:\s+(\d+) kB", STATUS.read_text())
    assert line
    return 1024 * int(line.group(1))


if __name__ == "__main__":
    main()
