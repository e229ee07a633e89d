# SPDX-License-Identifier: Apache-2.0
"""Time per point and memory by the number of points in a call.

    ./leg python benchmarks/entries/growth.py RESULT.json PICTURE.png

draws the picture of a saved run.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from harness import Row, Settings, measure, timed_row
from workload import BATCH, CONTACT, FRICTION, hexapod_leg, reachable_positions

from leg_statics.capacity.problem import load_capacity
from leg_statics.footholds import evaluate_footholds

HERE = Path(__file__).resolve().parent.parent
PICTURE = HERE / "results" / "growth.png"
CHUNK = 100_000


def rows(settings: Settings) -> Iterator[Row]:
    """Yield times per point, draw them, and yield peaks of memory."""
    leg = hexapod_leg()
    mechanism = leg.mechanism
    lower, upper = leg.effort_limits.T
    few = reachable_positions(mechanism)
    counts = [10**k for k in range(settings.count(7, 5))]
    times: dict[str, float] = {}
    for count in counts:
        feet = np.resize(few, (count, 3)) if count > BATCH else few[:count]
        jacobian = mechanism.inverse_with_twist(feet)[1][..., :3, :]
        for name, function in (
            ("inverse", lambda feet=feet: mechanism.inverse(feet)),
            ("load_capacity", lambda j=jacobian: load_capacity(j, lower, upper, FRICTION)),
            (
                "evaluate_footholds",
                lambda feet=feet: evaluate_footholds(leg, feet, CONTACT),
            ),
        ):
            timing = measure(function, settings, count)
            row = timed_row(f"{name}, N = {count:,}", timing, note="per point")
            times[row.what] = row.value
            yield row
    draw(times, PICTURE)

    once, many = settings.count(1_000_000, 100_000), settings.count(10_000_000, 1_000_000)
    yield Row(
        f"memory, {once:,} footholds in one call",
        memory(once, once),
        "B",
        note="peak beyond that before",
    )
    yield Row(
        f"memory, {many:,} footholds, {CHUNK:,} a call",
        memory(many, CHUNK),
        "B",
        note=f"cut by the caller, not by the function; {8e-6 * many:.0f} MB of it are kept",
    )


def memory(count: int, chunk: int) -> float:
    """Return by how much the peak of memory grows in a fresh process [B]."""
    program = HERE / "children" / "memory.py"
    answer = subprocess.run(
        [sys.executable, program, str(count), str(chunk)],
        capture_output=True,
        text=True,
        check=True,
    )
    return float(answer.stdout)


def draw(times: Mapping[str, float], picture: Path) -> None:
    """Save time per point by number of points as a picture.

    Args:
        times: Medians [s] by what the rows of a result call them: "inverse, N = 1,000".
        picture: File to write.
    """
    from matplotlib.figure import Figure

    curves: dict[str, list[tuple[int, float]]] = {}
    for what, seconds in times.items():
        if found := re.fullmatch(r"(\w+), N = ([\d,]+)", what):
            point = int(found[2].replace(",", "")), 1e6 * seconds
            curves.setdefault(found[1], []).append(point)
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    for name, points in curves.items():
        axes.loglog(*zip(*points, strict=True), marker="o", label=name)
    axes.set(xlabel="points in one call", ylabel="time per point [µs]")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    picture.parent.mkdir(exist_ok=True)
    figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    result, picture = map(Path, sys.argv[1:])
    entry = json.loads(result.read_text())["entries"]["growth"]
    draw({row["what"]: row["value"] for row in entry}, picture)
