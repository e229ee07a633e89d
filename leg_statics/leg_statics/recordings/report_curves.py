# SPDX-License-Identifier: Apache-2.0
"""The curves of a judged recording over time: of a leg, and of the queries of a service."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from leg_kinematics.arrays import FloatArray
from leg_kinematics.nodes.service import Service
from leg_statics.recordings.findings import NOT_OK, Envelope

# Okabe and Ito's colours, told apart by colour-blind readers too; every curve has its own dashes.
STYLES = (("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", "-."), ("#CC79A7", ":"))
BEYOND = "#B00020"  # what marks values beyond a limit
FRICTIONS = {
    "rated_friction": "rated friction mu_e",
    "rated_friction_full": "rated friction mu_e,xy",
    "friction_used": "friction used by the foot",
}
RANGES = {"range_use": "actuated joints", "passive_range_use": "passive joints"}
BREAK = 20  # a pause of so many usual bins interrupts a curve


def draw_queries(curves: Envelope, start: int, service: Service) -> Figure:
    """Draw what a service was asked and answered over time.

    Args:
        curves: The curves of `QueryFindings`.
        start: Time that counts as 0 [ns].
        service: The service.
    """
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    bands = _Bands(curves, start)
    best = f"best answer [{service.best_unit}]" if service.best_unit else "no best answer"
    labels = ("feasible share", best, "time to response [ms]")
    rows = figure.subplots(len(labels), 1, sharex=True)
    for axes, name, label in zip(rows, curves.names, labels, strict=True):
        bands.draw(axes, name, label, (STYLES[0][0], ""), marker=".")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.grid(color="0.9")
    rows[-1].set_xlabel("time [s]")
    figure.suptitle(service.name)
    return figure


def draw_leg(curves: Envelope, start: int, friction: float, *, title: str = "") -> Figure:
    """Draw the curves of a leg over time.

    Args:
        curves: The curves of `Findings`.
        start: Time that counts as 0 [ns].
        friction: Friction coefficient of the ground.
        title: Title of the figure.
    """
    figure = Figure(figsize=(9.0, 10.0), layout="constrained")
    effort, load, slope, used, condition = figure.subplots(5, 1, sharex=True)
    bands = _Bands(curves, start)

    measured = bands.known("joint_utilisation ")
    source = "joint_utilisation " if measured else "required_utilisation "
    for style, name in zip(_styles(), bands.known(source), strict=False):
        bands.draw(effort, name, name.removeprefix(source), style)
        bands.mark(effort, name, 1.0)
    effort.axhline(1.0, color="black", linewidth=0.8)
    effort.set_ylabel("effort / limit" if measured else "effort needed / limit")

    bands.draw(load, "load_capacity", "load capacity", STYLES[0])
    bands.draw(load, "force_z", "vertical ground reaction", STYLES[1])
    bands.mark_where(load, "force_z", "load_share", 1.0)
    load.set_ylabel("load [N]")

    for style, (name, label) in zip(STYLES, FRICTIONS.items(), strict=False):
        bands.draw(slope, name, label, style)
        bands.mark(slope, name, friction)
    slope.axhline(friction, color="black", linewidth=0.8, label="the ground's friction")
    slope.set_ylabel("friction")

    for style, (name, label) in zip(STYLES, RANGES.items(), strict=False):
        bands.draw(used, name, label, style)
        bands.mark(used, name, 1.0)
    bands.mark_where(used, NOT_OK, NOT_OK, 0.0, label=NOT_OK, marker="x")
    used.axhline(1.0, color="black", linewidth=0.8)
    used.set_ylim(bottom=0.0)
    used.set_ylabel("range used")

    bands.draw(condition, "condition_number", "condition number", STYLES[0])
    condition.set_yscale("log")
    for ticks in (condition.yaxis.set_major_formatter, condition.yaxis.set_minor_formatter):
        ticks(LogFormatter(labelOnlyBase=False, minor_thresholds=(1.0, 0.5)))
    condition.set_ylabel("condition number")
    condition.set_xlabel("time [s]")
    for axes in (effort, load, slope, used, condition):
        axes.grid(color="0.9")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    figure.suptitle(title)
    return figure


def _styles() -> list[tuple[str, str]]:
    """Return styles for as many curves as a leg can have joints."""
    return [*STYLES, ("black", "-"), ("#E69F00", "--"), ("#56B4E9", "-."), ("0.5", ":")]


class _Bands:
    """Draws the curves of an envelope, interrupted by its pauses."""

    def __init__(self, curves: Envelope, start: int) -> None:
        pauses = curves.begin[1:] - curves.end[:-1]
        usual = float(np.median(pauses)) if len(pauses) else 0.0
        breaks = np.flatnonzero(pauses > BREAK * usual) + 1
        self._names = curves.names
        self._times = np.insert((curves.begin - start) / 1e9, breaks, np.nan)
        self._low = np.insert(_finite(curves.low), breaks, np.nan, axis=0)
        self._high = np.insert(_finite(curves.high), breaks, np.nan, axis=0)

    def known(self, prefix: str) -> list[str]:
        """Return the names of the curves with this prefix that have values."""
        known = np.any(~np.isnan(self._low), axis=0)
        return [name for k, name in enumerate(self._names) if known[k] and name.startswith(prefix)]

    def draw(
        self, axes: Axes, name: str, label: str, style: tuple[str, str], marker: str = ""
    ) -> None:
        """Draw a curve if it has values."""
        if name not in self.known(name):
            return
        k = self._names.index(name)
        low, high = self._low[:, k], self._high[:, k]
        colour, dashes = style
        axes.fill_between(self._times, low, high, color=colour, alpha=0.35, linewidth=0.0)
        for values, text in ((low, label), (high, None)):
            axes.plot(
                self._times,
                values,
                color=colour,
                linestyle=dashes,
                linewidth=1.0,
                marker=marker,
                label=text,
            )

    def mark(self, axes: Axes, name: str, limit: float) -> None:
        """Mark where a curve is above a limit."""
        self.mark_where(axes, name, name, limit)

    def mark_where(
        self,
        axes: Axes,
        name: str,
        judged: str,
        limit: float,
        label: str = "beyond the limit",
        marker: str = "v",
    ) -> None:
        """Mark a curve where another one is above a limit."""
        values = self._high[:, self._names.index(name)]
        with np.errstate(invalid="ignore"):
            beyond = self._high[:, self._names.index(judged)] > limit
        if not np.any(beyond):
            return
        known = axes.get_legend_handles_labels()[1]
        axes.plot(
            self._times[beyond],
            values[beyond],
            color=BEYOND,
            linestyle="",
            marker=marker,
            markersize=4.0,
            label=None if label in known else label,
        )


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, np.nan)
