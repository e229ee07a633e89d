# SPDX-License-Identifier: Apache-2.0
"""What a geometry is worth: global means, workspace, step and load capacity of a changed mechanism.

A design is a mechanism with some of its dimensions changed. What is wanted of it is named by
metrics; a design that has no answer says why, so that a search over thousands goes on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np

from leg_kinematics.arrays import as_array, as_non_negative
from leg_kinematics.errors import GeometryError, UnknownNameError, ValueRangeError
from leg_kinematics.geometry import geometry_parameters
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.mirrored import Mirrored
from leg_kinematics.robot import Leg
from leg_statics.design.averages import (
    FEWEST_POINTS,
    MOST_POINTS,
    Averages,
    average,
    heights_by_volume,
)
from leg_statics.footholds import Contact
from leg_statics.indices import INDICES, Index, supported_indices
from leg_statics.maps import CAPACITY_LAYER, layer_values
from leg_statics.step_length import Criterion, longest_step
from leg_statics.workspace import is_spatial_leg

STEP_HEIGHTS = 6  # heights that are tried for the longest step

WORKSPACE_VOLUME = "workspace_volume"
USABLE_SHARE = "usable_share"
STEP_LENGTH = "step_length"
LOAD_CAPACITY = CAPACITY_LAYER


@dataclass(frozen=True)
class Metric:
    """One number that tells what a design is worth.

    Attributes:
        name: Name in studies and tables.
        unit: SI unit, per unit effort where it says so.
        better: Whether a low or a high value is better.
        doc: What it tells.
        supports: Whether a mechanism has it.
    """

    name: str
    unit: str
    better: Literal["low", "high"]
    doc: str
    supports: Callable[[Mechanism], bool]


def _index_metric(index: Index) -> Metric:
    """Return the mean of an index over the workspace: equations (4), (29), (32)."""
    doc = f"Mean over the workspace. {index.doc}"
    return Metric(
        index.name, index.unit, index.better, doc, lambda m: index.name in supported_indices(m)
    )


def _has_point_foot(mechanism: Mechanism) -> bool:
    return mechanism.has_point_foot


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *map(_index_metric, INDICES.values()),
        Metric(WORKSPACE_VOLUME, "m3", "high", "Volume that the foot can reach.", is_spatial_leg),
        Metric(
            USABLE_SHARE,
            "1",
            "high",
            "Share of the actuator ranges whose poses the leg can take.",
            lambda m: True,
        ),
        Metric(
            STEP_LENGTH,
            "m",
            "high",
            "Longest step straight ahead on level ground at the best of the heights.",
            _has_point_foot,
        ),
        Metric(
            LOAD_CAPACITY,
            "N",
            "high",
            "Mean over the workspace of the largest load on level ground within the effort limits.",
            _has_point_foot,
        ),
    )
}


@dataclass(frozen=True)
class Conditions:
    """Under which a design is evaluated.

    Attributes:
        friction: Friction coefficient mu of the ground, for steps and load capacity.
        load: Normal load that every point of a step must bear [N].
        heights: Heights z of the foot in the leg frame among which the best is taken for the step
            [m]; none for six that stand for equal shares of each design's workspace.
        criterion: What makes a point of the step feasible.
        tolerance: Error to which means, volume and usable share are wanted, as the relative
            half-width of a 95 % confidence interval.
        most_points: Poses to evaluate at most for that.
    """

    friction: float | None = None
    load: float = 0.0
    heights: tuple[float, ...] = ()
    criterion: Criterion = Criterion.CAPACITY
    tolerance: float = 0.005
    most_points: int = MOST_POINTS

    def __post_init__(self) -> None:
        """Check the fields; heights may come as an array.

        Raises:
            ValueRangeError: If a field is out of range.
        """
        if self.friction is not None:
            as_non_negative("friction", self.friction)
        if not 0.0 <= self.load < np.inf:
            raise ValueRangeError(f"load must be finite and >= 0 N, got {self.load}")
        if not 0.0 < self.tolerance < 1.0:
            raise ValueRangeError(f"tolerance must be > 0 and < 1, got {self.tolerance}")
        if self.most_points < FEWEST_POINTS:
            raise ValueRangeError(f"most_points must be >= {FEWEST_POINTS}, got {self.most_points}")
        heights = as_array("heights", self.heights)
        if not np.isfinite(heights).all():
            raise ValueRangeError(f"heights must be finite, got {self.heights}")
        object.__setattr__(self, "heights", tuple(heights.ravel().tolist()))


@dataclass(frozen=True)
class Evaluation:
    """What a design is worth.

    Attributes:
        values: Value of each metric that was asked for; NaN where there is none.
        change: Error that means, volume and usable share have reached, the largest of them, as the
            relative half-width of a 95 % confidence interval; NaN if the design cannot be built, 0
            if nothing of that kind was asked for.
        problem: Why the design is of no use or not all its values are known; "" if all is well.
        points: Poses that were evaluated for means, volume and usable share.
    """

    values: dict[str, float]
    change: float
    problem: str = ""
    points: int = 0


def find_metric(name: str) -> Metric:
    """Return a registered metric.

    Raises:
        UnknownNameError: If there is none of that name.
    """
    try:
        return METRICS[name]
    except KeyError:
        raise UnknownNameError("metric", name, METRICS) from None


def changed_mechanism(base: Mechanism, changes: Mapping[str, float]) -> Mechanism:
    """Return a mechanism with some of its dimensions changed [SI].

    Raises:
        UnknownNameError: If a name is not one of the mechanism's geometry parameters.
        GeometryError: If the dimensions do not make a leg.
    """
    design: Any = base
    if isinstance(base, Mirrored):
        design = Mirrored(changed_mechanism(base.original, changes))
        return cast(Mechanism, design)
    allowed = [f.name for f in geometry_parameters(base)]
    for name in changes:
        if name not in allowed:
            raise UnknownNameError("geometry parameter", name, allowed)
    return cast(Mechanism, dataclasses.replace(design, **changes))


def missing_condition(name: str, conditions: Conditions) -> str:
    """Return the name of a field of the conditions that a metric needs and does not have, or ""."""
    on_ground = name in (STEP_LENGTH, LOAD_CAPACITY)
    return "friction" if on_ground and conditions.friction is None else ""


def supported_metrics(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the metrics that a mechanism has."""
    return tuple(name for name, metric in METRICS.items() if metric.supports(mechanism))


def evaluate_design(
    base: Leg,
    changes: Mapping[str, float],
    metrics: Sequence[str],
    conditions: Conditions | None = None,
) -> Evaluation:
    """Evaluate a design.

    Means and volume are those of `workspace_averages.average`. The step runs straight ahead,
    through the origin of the leg frame as seen from above. It is found to a micrometre at each
    height; the longest of several heights may fall short of the longest of all.

    Args:
        base: The leg whose other dimensions and effort limits the design has.
        changes: New values of geometry parameters by their names [SI].
        metrics: Names of the metrics.
        conditions: Ground, load and accuracy.

    Returns:
        The values. What is wrong with the design is told, not raised.

    Raises:
        UnknownNameError: If a metric or a geometry parameter does not exist.
        ValueRangeError: If the conditions lack what a metric needs.
        ShapeError: If there is not one pair of effort limits an actuator.
    """
    asked = conditions or Conditions()
    for name in metrics:
        missing = missing_condition(find_metric(name).name, asked)
        if missing:
            raise ValueRangeError(f"metric {name!r} needs the condition {missing}")
    values = dict.fromkeys(metrics, float("nan"))
    try:
        mechanism = changed_mechanism(base.mechanism, changes)
    except GeometryError as error:
        return Evaluation(values, float("nan"), str(error))
    leg = dataclasses.replace(base, mechanism=mechanism)
    defined = [name for name in metrics if _is_defined(mechanism, name, asked)]
    undefined = ", ".join(name for name in metrics if name not in defined)
    problems = [f"mechanism {mechanism.name!r} has no {undefined}"] if undefined else []
    if STEP_LENGTH in defined:
        values[STEP_LENGTH] = _longest_step(leg, asked)
    averaged = [name for name in defined if name != STEP_LENGTH]
    if not averaged:
        return Evaluation(values, 0.0, "; ".join(problems))
    means = [name for name in averaged if name not in (WORKSPACE_VOLUME, USABLE_SHARE)]
    contact = _contact(asked) if LOAD_CAPACITY in means else None
    found = average(
        mechanism,
        lambda posture: layer_values(leg, posture, means, contact),
        asked.tolerance,
        asked.most_points,
    )
    known = dict(zip(means, found.values.tolist(), strict=True))
    known |= {WORKSPACE_VOLUME: found.volume, USABLE_SHARE: found.usable}
    values |= {name: known[name] for name in averaged}
    problems += _problems(means, found, asked.tolerance)
    return Evaluation(values, found.error, "; ".join(problems), found.points)


def _is_defined(mechanism: Mechanism, name: str, conditions: Conditions) -> bool:
    """Tell whether a mechanism has a metric, and what the step is judged by."""
    by_rated_friction = name == STEP_LENGTH and conditions.criterion == Criterion.RATED_FRICTION
    needed = (name, "rated_friction") if by_rated_friction else (name,)
    return all(METRICS[n].supports(mechanism) for n in needed)


def _longest_step(leg: Leg, conditions: Conditions) -> float:
    heights = conditions.heights or heights_by_volume(leg.mechanism, STEP_HEIGHTS)
    if not len(heights):
        return 0.0
    step = longest_step(leg, heights, _contact(conditions), criterion=conditions.criterion)
    return float(np.max(step.length))


def _contact(conditions: Conditions) -> Contact:
    """Return the ground, for metrics that `missing_condition` has nothing against."""
    return Contact(cast(float, conditions.friction), load=conditions.load)


def _problems(means: Sequence[str], found: Averages, tolerance: float) -> list[str]:
    """Tell what is wrong with a workspace or unknown of it."""
    if found.usable == 0.0:
        return [f"none of {found.points} poses within the joint ranges can be taken"]
    infinite = [name for name, v in zip(means, found.values, strict=True) if not np.isfinite(v)]
    if infinite:
        return [f"infinite somewhere in the workspace: {', '.join(infinite)}"]
    errors = [*found.errors.tolist(), found.volume_error, found.usable_error]
    names = [*means, WORKSPACE_VOLUME, USABLE_SHARE]
    unknown = [
        f"{name} to {100.0 * error:.2g} %"
        for name, error in zip(names, errors, strict=True)
        if not error <= tolerance
    ]
    if not unknown:
        return []
    return [f"not known closely enough after {found.points} poses: {', '.join(unknown)}"]
