# SPDX-License-Identifier: Apache-2.0
"""The pictures that the outcome of a geometry search gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Leg
from leg_statics.design.designs import changed_mechanism, find_metric
from leg_statics.design.search.geometry_search import Numbered, Outcome
from leg_statics.drawing.designs import plot_convergence, plot_front, plot_parallel_coordinates
from leg_statics.drawing.maps import plot_maps
from leg_statics.drawing.style import height_title
from leg_statics.indices import INDICES
from leg_statics.maps import plane_map
from leg_statics.workspace import initial_height, is_spatial_leg

MAP_RESOLUTION = 0.005  # m


def search_pictures(outcome: Outcome) -> dict[str, Figure]:
    """Return all pictures of an outcome by their names; none without a winner."""
    winner = outcome.winner
    if winner is None:
        return {}
    figures = {}
    if len(outcome.study.objectives) > 1:
        figures["pareto_front"] = _front(outcome, winner)
    figures["parallel_coordinates"] = _parallel_coordinates(outcome, winner)
    figures["convergence"] = _convergence(outcome)
    return figures | _before_and_after(outcome, winner)


def metric_label(name: str) -> str:
    """Return name and unit of a metric, and whether low or high is better."""
    metric = find_metric(name)
    return f"{_words(name)} [{metric.unit}], {metric.better} is better"


def _front(outcome: Outcome, winner: Numbered) -> Figure:
    count = len(outcome.study.objectives)
    marked = {"before": outcome.base[:count], "winner": winner.design.values[:count]}
    return plot_front(
        _values(outcome.sample)[:, :count],
        _values(outcome.front)[:, :count],
        marked,
        [metric_label(name) for name in outcome.study.objectives],
    )


def _parallel_coordinates(outcome: Outcome, winner: Numbered) -> Figure:
    study = outcome.study
    count = len(study.objectives)
    base = [getattr(study.leg.geometry, p.name) for p in study.parameters]
    return plot_parallel_coordinates(
        np.array([_coordinates(entry, count) for entry in outcome.front]),
        np.array([*base, *outcome.base[:count]]),
        _coordinates(winner, count),
        [*(p.symbol for p in study.parameters), *map(_words, study.objectives)],
    )


def _convergence(outcome: Outcome) -> Figure:
    steps = outcome.improvements
    return plot_convergence(
        [*(step.evaluated for step in steps), outcome.progress.evaluated],
        [*(step.score for step in steps), steps[-1].score],
    )


def _before_and_after(outcome: Outcome, winner: Numbered) -> dict[str, Figure]:
    """Return maps of the objectives that are means of indices, before and after."""
    study = outcome.study
    before = study.leg.mechanism
    if not is_spatial_leg(before):
        return {}
    after = changed_mechanism(before, study.changes(winner.design.parameters))
    mechanisms = {"before": before, "winner": after}
    return {
        f"map_{name}": plot_maps(
            {
                f"{label}, {height_title(initial_height(mechanism))}": plane_map(
                    Leg.of(mechanism), initial_height(mechanism), MAP_RESOLUTION, layers=[name]
                )
                for label, mechanism in mechanisms.items()
            },
            name,
        )
        for name in study.objectives
        if name in INDICES
    }


def _words(name: str) -> str:
    return name.replace("_", " ")


def _values(entries: Sequence[Numbered]) -> FloatArray:
    return np.array([entry.design.values for entry in entries])


def _coordinates(entry: Numbered, objectives: int) -> FloatArray:
    return np.append(entry.design.parameters, entry.design.values[:objectives])
