# SPDX-License-Identifier: Apache-2.0
"""Press a leg of every mechanism in MuJoCo until it gives way, beside what is predicted.

Random postures, random friction. The prediction is that of the posture in which the leg gave way:
motors yield a little before.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pressed_leg import predicted, press
from rich.console import Console
from rich.table import Table

from leg_kinematics import Leg, Posture, Status, TheoJansen, load_robot
from leg_statics.drawing.style import FONT_SIZE, new_figure, plain, with_legend

FRICTIONS = (0.3, 0.5, 0.8)
STEEPEST = 2.5  # load capacity relative to that on ice, above which a posture locks itself
SLIPS = 0.97  # ratio of tangential to normal force relative to friction, at which a foot slips


class Trial(NamedTuple):
    """One leg pressed in one posture.

    Attributes:
        mechanism: Name of the mechanism.
        friction: Friction coefficient of the ground.
        predicted: Load capacity of the posture in which it gave way [N].
        reason: What limits that.
        simulated: The load at which it gave way [N]; NaN if it held twice the prediction.
        seen: What gave way.
    """

    mechanism: str
    friction: float
    predicted: float
    reason: str
    simulated: float
    seen: str


def pressed_legs() -> dict[str, Leg]:
    """Return a leg of every mechanism that has a point foot."""
    return {
        "parallel_drive": load_robot("hexapod").leg("left_front"),
        "double_rhombus": load_robot("quadruped").leg("left_front"),
        "six_bar": load_robot("walker").leg("left_front_inner"),
        "theo_jansen": Leg.of(TheoJansen(), (-1.0, 1.0)),
        "solo12": load_robot("solo12").leg("FL"),
    }


def trials(name: str, leg: Leg, count: int, seed: int = 1) -> Iterator[Trial]:
    """Press a leg in so many random postures and yield what came of it."""
    rng = np.random.default_rng(seed)
    for posture in _postures(leg, rng):
        friction = float(rng.choice(FRICTIONS))
        tried, _ = predicted(leg, posture, friction)
        if not 0.0 < tried < STEEPEST * predicted(leg, posture, 0.0)[0]:
            continue
        found = press(leg, posture, friction, tried)
        if np.isfinite(found.load):
            posture = leg.mechanism.forward(found.joint_positions)
        capacity, reason = predicted(leg, posture, friction)
        seen = "friction" if found.slip > SLIPS * friction else "effort"
        yield Trial(name, friction, capacity, reason, found.load, seen)
        count -= 1
        if count == 0:
            return


def _postures(leg: Leg, rng: np.random.Generator) -> Iterator[Posture]:
    lower, upper = np.clip(leg.mechanism.joint_limits, -np.pi, np.pi).T
    while True:
        posture = leg.mechanism.forward(rng.uniform(lower, upper))
        if posture.status == Status.OK:
            yield posture


def print_trials(console: Console, results: list[Trial]) -> None:
    """Print one row a mechanism."""
    columns = ("mechanism", "trials", "gave way", "simulated / predicted", "range", "same reason")
    table = Table(*columns, title="Pressed until something gives")
    for name in dict.fromkeys(trial.mechanism for trial in results):
        own = [trial for trial in results if trial.mechanism == name]
        given = [trial for trial in own if np.isfinite(trial.simulated)]
        ratios = np.array([trial.simulated / trial.predicted for trial in given])
        same = sum(trial.reason == trial.seen for trial in given)
        spread = f"{ratios.min():.2f} .. {ratios.max():.2f}"
        counts = str(len(own)), str(len(given))
        table.add_row(name, *counts, f"{np.median(ratios):.3f}", spread, str(same))
    console.print(table)


def plot_trials(results: list[Trial]) -> Figure:
    """Draw simulated over predicted loads."""
    figure = new_figure(None, 80.0)
    axes = figure.subplots()
    names = list(dict.fromkeys(trial.mechanism for trial in results))
    for k, name in enumerate(names):
        own = [(t.predicted, t.simulated) for t in results if t.mechanism == name]
        axes.loglog(*np.transpose(own), "o", color=f"C{k}", markersize=3.5, label=name)
    ends = np.array([min(t.predicted for t in results), max(t.predicted for t in results)])
    axes.loglog(ends, ends, color="0.5", linewidth=0.8, zorder=0)
    axes.set_xlabel("load capacity, predicted [N]", fontsize=FONT_SIZE)
    axes.set_ylabel("load at which it gave way [N]", fontsize=FONT_SIZE)
    plain(axes)
    return with_legend(figure, axes, "", 3)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=8, help="postures of each mechanism")
    parser.add_argument("--picture", type=Path, default=Path("docs/physics.png"))
    options = parser.parse_args()
    results = [
        trial for name, leg in pressed_legs().items() for trial in trials(name, leg, options.count)
    ]
    print_trials(Console(), results)
    plot_trials(results).savefig(options.picture, dpi=150)
    print(f"wrote {options.picture}")


if __name__ == "__main__":
    main()
