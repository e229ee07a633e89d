# SPDX-License-Identifier: Apache-2.0
"""Figures 4 and 5 of paper 004: the drives and the output shaft in its example of 5 s."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from leg_kinematics.arrays import FloatArray
from leg_statics.drawing.style import outside_legend, write_figure
from leg_statics.published.paper_004 import (
    DURATION,
    drive_motion,
    example_manipulator,
    example_motion,
    example_times,
    output_motions,
)

# Okabe and Ito's colours, told apart by all kinds of colour vision; the dashes tell them in grey.
BLUE, VERMILION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
Dashes = tuple[int, tuple[float, ...] | None]
SOLID: Dashes = (0, None)
DASHED: Dashes = (0, (6, 2))
DOTTED: Dashes = (0, (1.5, 1.5))
MIXED: Dashes = (0, (7, 2, 1.5, 2))
DRIVES = {
    "s1, slide A": (BLUE, SOLID),
    "s2, carriage E": (VERMILION, DASHED),
    "s3, slide B": (GREEN, MIXED),
    "s4, slide C": (PURPLE, DOTTED),
}
AXES = {
    "about X": (GREEN, MIXED),
    "about Y": (VERMILION, DASHED),
    "about Z": (BLUE, SOLID),
}


def displacement_figure() -> Figure:
    """Draw the displacements of the drives: figure 4."""
    time = example_times()
    drives = drive_motion(example_manipulator(), example_motion(time))
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    _draw(axes, time, drives.posture.joint_positions, DRIVES)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("displacement [m]")
    axes.set_title("Displacements of the drives", loc="left")
    axes.legend(loc="lower left", frameon=False, handlelength=3.5)
    return figure


def output_figure() -> Figure:
    """Draw the output shaft's angular velocity and acceleration: figure 5."""
    time = example_times()
    exact, approximate = output_motions(example_motion(time))
    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    rows = (
        (upper, exact.angular_velocity, approximate.angular_velocity, "velocity [rad/s]"),
        (
            *(lower, exact.angular_acceleration, approximate.angular_acceleration),
            "acceleration [rad/s²]",
        ),
    )
    for axes, values, by_27, quantity in rows:
        _draw(axes, time, values, AXES)
        axes.plot(time, by_27[:, 2], "k--", linewidth=1.0, label="about Z by (27)")
        axes.set_ylabel(f"angular {quantity}")
    figure.align_ylabels()
    upper.set_title("Output shaft of the auxiliary chain", loc="left")
    lower.set_xlabel("time [s]")
    handles, labels = upper.get_legend_handles_labels()
    outside_legend(figure, handles, labels, 4, fontsize=10.0, below=True, handlelength=3.5)
    return figure


def _draw(
    axes: Axes, time: FloatArray, values: FloatArray, styles: Mapping[str, tuple[str, Dashes]]
) -> None:
    """Draw the columns of `values` over time, in the order of `styles`."""
    for column, (name, (color, dashes)) in enumerate(styles.items()):
        axes.plot(time, values[:, column], color=color, linestyle=dashes, linewidth=2.0, label=name)
    axes.set_xlim(0.0, DURATION)
    axes.set_xticks(np.arange(0.0, DURATION + 0.5))
    axes.axhline(0.0, color="0.6", linewidth=0.8, zorder=0)
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def draw(folder: Path) -> None:
    """Draw the figures into a folder."""
    write_figure(displacement_figure(), folder / "gantry_displacements.png")
    write_figure(output_figure(), folder / "gantry_output_shaft.png")
