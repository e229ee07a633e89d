# SPDX-License-Identifier: Apache-2.0
"""Searches for better dimensions of a leg."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from leg_msgs.action import SearchGeometry
from leg_msgs_py.arrays import FloatArray, from_field
from leg_msgs_py.client.questions import Goal, order


class SearchedGeometry(NamedTuple):
    """Answer of `search_geometry`: the M designs that no other beats in every objective.

    Attributes:
        parameters: Names of the dimensions that were varied (P).
        best_parameters: Dimensions of these designs (M, P) [SI].
        objectives: Names of the objectives (K).
        best_objectives: Objectives of these designs (M, K) [SI].
        robot: Robot description (YAML) with the winner's dimensions; "" if no design is feasible.
        folder: Where all results are, on the machine of the node.
        evaluated: Number of designs evaluated.
        feasible: How many of them can be assembled and keep all constraints.
        elapsed: Time that the work took [s].
    """

    parameters: tuple[str, ...]
    best_parameters: FloatArray
    objectives: tuple[str, ...]
    best_objectives: FloatArray
    robot: str
    folder: str
    evaluated: int
    feasible: int
    elapsed: float


class SearchProgress(NamedTuple):
    """Progress of `search_geometry`.

    Attributes:
        evaluated: Designs evaluated so far.
        total: Designs that will be evaluated.
        rate: Designs evaluated in a second [1/s].
        elapsed: Time since the goal was accepted [s].
        remaining: Estimated time until the end [s]; NaN while it is not known.
        objectives: Names of the objectives (K).
        best: Best value of each objective so far (K,); NaN while there is none.
    """

    evaluated: int
    total: int
    rate: float
    elapsed: float
    remaining: float
    objectives: tuple[str, ...]
    best: FloatArray


@order("designs", SearchGeometry)
def search_geometry(
    study: str | os.PathLike[str],
    folder: str | os.PathLike[str] = "",
    *,
    on_progress: Callable[[SearchProgress], None] = lambda progress: None,
) -> Goal[SearchedGeometry]:
    """Search for better dimensions of a leg; the designs node does it.

    The client's timeout does not count for the work, but for the node's silence.

    Args:
        study: Text of a study file (YAML), or the file's path as a `Path`.
        folder: Where results go, on the machine of the node; a search of this study that
            stopped there goes on. "" for a new folder of the node's choice.
        on_progress: Called in the client's thread now and then; what it raises ends the work.
    """
    text = study if isinstance(study, str) else Path(study).read_text(encoding="utf-8")
    goal = SearchGeometry.Goal(study=text, folder=str(folder))

    def decode(result: Any) -> SearchedGeometry:
        parameters, objectives = tuple(result.parameters), tuple(result.objectives)
        return SearchedGeometry(
            parameters=parameters,
            best_parameters=from_field(result.best_parameters, (-1, len(parameters))),
            objectives=objectives,
            best_objectives=from_field(result.best_objectives, (-1, len(objectives))),
            robot=result.robot,
            folder=result.folder,
            evaluated=result.evaluated,
            feasible=result.feasible,
            elapsed=result.elapsed,
        )

    def tell(feedback: Any) -> None:
        on_progress(
            SearchProgress(
                evaluated=feedback.evaluated,
                total=feedback.total,
                rate=feedback.rate,
                elapsed=feedback.elapsed,
                remaining=feedback.remaining,
                objectives=tuple(feedback.objectives),
                best=from_field(feedback.best),
            )
        )

    return Goal(goal, decode, tell)
