"""Pictures of what a geometry search found."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from leg_kinematics.arrays import FloatArray
from leg_statics.design.designs import changed_mechanism, find_metric
from leg_statics.design.search.geometry_search import Numbered, Outcome
from leg_statics.drawing.plots import (
    COLOUR_MAP,
    FONT_SIZE,
    GREY,
    MILLIMETRE,
    SMALL_FONT_SIZE,
    WIDTH,
    height_title,
    initial_height,
    is_spatial_leg,
    plot_maps,
)
from leg_statics.indices import INDICES
from leg_statics.maps import plane_map

MAP_RESOLUTION = 0.005  # m


def draw_search(outcome: Outcome) -> dict[str, Figure]:
    """Return all pictures that the outcome of a search gives, by their names."""
    figures: dict[str, Figure] = {}
    if outcome.winner is None:
        return figures
    if len(outcome.study.objectives) > 1:
        figures["pareto_front"] = plot_front(outcome)
    figures["parallel_coordinates"] = plot_parallel_coordinates(outcome)
    figures["convergence"] = plot_convergence(outcome)
    return figures | plot_before_and_after(outcome)


def plot_front(outcome: Outcome) -> Figure:
    """Draw the designs over the first two objectives, a third one as colour."""
    study = outcome.study
    figure, ax = _diagram(82.0)
    sampled, front = _values(outcome.sample), _values(outcome.front)
    ax.plot(sampled[:, 0], sampled[:, 1], ".", color=GREY, alpha=0.4, markersize=2, label="designs")
    if len(study.objectives) > 2:
        dots = ax.scatter(
            front[:, 0], front[:, 1], c=front[:, 2], cmap=COLOUR_MAP, s=14, label="Pareto front"
        )
        bar = figure.colorbar(dots, ax=ax, aspect=30, pad=0.02)
        bar.set_label(metric_label(study.objectives[2]), fontsize=FONT_SIZE)
        bar.ax.tick_params(labelsize=SMALL_FONT_SIZE)
    else:
        ax.plot(front[:, 0], front[:, 1], ".-", color="black", markersize=4, label="Pareto front")
    marks = {"before": ("s", outcome.base), "winner": ("*", _winner(outcome).design.values)}
    for label, (marker, values) in marks.items():
        ax.plot(*values[:2], marker, markersize=9, mfc="white", mec="black", mew=1.0, label=label)
    ax.set_xlabel(metric_label(study.objectives[0]), fontsize=FONT_SIZE)
    ax.set_ylabel(metric_label(study.objectives[1]), fontsize=FONT_SIZE)
    _legend(figure, ax)
    return figure


def plot_parallel_coordinates(outcome: Outcome) -> Figure:
    """Draw each design of the front as a line over its dimensions and objectives."""
    study = outcome.study
    count = len(study.objectives)
    names = [*(p.symbol for p in study.parameters), *map(_words, study.objectives)]
    lines = np.array([_coordinates(entry, count) for entry in outcome.front])
    base = [getattr(study.leg.geometry, p.name) for p in study.parameters]
    before = np.array([*base, *outcome.base[:count]])
    everything = np.vstack([lines, before])
    lowest, highest = everything.min(axis=0), everything.max(axis=0)
    span = np.where(highest > lowest, highest - lowest, 1.0)
    figure, ax = _diagram(80.0)
    x = range(len(names))
    colours = mpl.colormaps[COLOUR_MAP](np.linspace(0.0, 0.9, len(lines)))
    for line, colour in zip(lines, colours, strict=True):
        ax.plot(x, (line - lowest) / span, color=colour, alpha=0.5, linewidth=0.6)
    best = (_coordinates(_winner(outcome), count) - lowest) / span
    ax.plot(x, (before - lowest) / span, "--s", color=GREY, markersize=3, label="before")
    ax.plot(x, best, "-*", color="black", markersize=6, label="winner")
    for position, low, high in zip(x, lowest, highest, strict=True):
        ax.axvline(position, color=GREY, linewidth=0.5, zorder=0)
        ax.text(position, -0.03, f"{low:.4g}", ha="center", va="top", fontsize=SMALL_FONT_SIZE)
        ax.text(position, 1.03, f"{high:.4g}", ha="center", va="bottom", fontsize=SMALL_FONT_SIZE)
    ax.set_xticks(x, names, rotation=45, ha="right", fontsize=FONT_SIZE)
    ax.set_yticks([])
    ax.set_ylim(-0.12, 1.12)
    _legend(figure, ax)
    return figure


def plot_convergence(outcome: Outcome) -> Figure:
    """Draw how the best score rose."""
    figure, ax = _diagram(60.0)
    steps = [*outcome.improvements, outcome.improvements[-1]]
    evaluated = [step.evaluated for step in outcome.improvements] + [outcome.progress.evaluated]
    ax.step(evaluated, [step.score for step in steps], where="post", color="black", linewidth=1.0)
    ax.set_xlabel("designs evaluated", fontsize=FONT_SIZE)
    ax.set_ylabel("best score", fontsize=FONT_SIZE)
    return figure


def plot_before_and_after(outcome: Outcome) -> dict[str, Figure]:
    """Draw maps of the objectives that are means of indices, before and after."""
    study, winner = outcome.study, _winner(outcome)
    before = study.leg.mechanism
    if not is_spatial_leg(before):
        return {}
    after = changed_mechanism(before, study.changes(winner.design.parameters))
    legs = {"before": before, "winner": after}
    return {
        f"map_{name}": plot_maps(
            {
                f"{label}, {height_title(initial_height(leg))}": plane_map(
                    leg, initial_height(leg), MAP_RESOLUTION, layers=[name]
                )
                for label, leg in legs.items()
            },
            name,
        )
        for name in study.objectives
        if name in INDICES
    }


def metric_label(name: str) -> str:
    """Return name and unit of a metric, and whether low or high is better."""
    metric = find_metric(name)
    return f"{_words(name)} [{metric.unit}], {metric.better} is better"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _winner(outcome: Outcome) -> Numbered:
    assert outcome.winner is not None
    return outcome.winner


def _values(entries: Sequence[Numbered]) -> FloatArray:
    return np.array([entry.design.values for entry in entries])


def _coordinates(entry: Numbered, objectives: int) -> FloatArray:
    return np.append(entry.design.parameters, entry.design.values[:objectives])


def _diagram(height: float) -> tuple[Figure, Axes]:
    """Return a figure of the usual width and a height [mm] with one diagram."""
    figure = Figure(figsize=(WIDTH * MILLIMETRE, height * MILLIMETRE), layout="constrained")
    ax = figure.subplots()
    ax.tick_params(labelsize=SMALL_FONT_SIZE, width=0.5, length=2, pad=2)
    for spine in ax.spines.values():
        spine.set_linewidth(0.5)
    return figure, ax


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=len(handles),
        fontsize=FONT_SIZE,
        frameon=False,
    )
