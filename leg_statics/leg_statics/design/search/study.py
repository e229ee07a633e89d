# SPDX-License-Identifier: Apache-2.0
"""Studies: what a geometry search varies, wants and may spend."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.documents import Document
from leg_kinematics.robot import Leg
from leg_statics.design.designs import Conditions, Evaluation, evaluate_design, find_metric
from leg_statics.design.search.methods import Draw


@dataclass(frozen=True)
class Parameter:
    """A dimension that a study varies.

    Attributes:
        name: Name in the mechanism's geometry.
        symbol: The literature's symbol.
        unit: SI unit.
        lower: Least value [SI].
        upper: Greatest value [SI].
        values: The values it may have [SI]; none for all of the range.
    """

    name: str
    symbol: str
    unit: str
    lower: float
    upper: float
    values: tuple[float, ...] = ()

    def at(self, share: float) -> float:
        """Return the value at a share of the range, or of the values: 0 to 1."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        return self.lower + share * (self.upper - self.lower)


@dataclass(frozen=True)
class Constraint:
    """Limits of a metric.

    Attributes:
        metric: Name of the metric.
        lower: Least value allowed [SI].
        upper: Greatest value allowed [SI].
    """

    metric: str
    lower: float = -math.inf
    upper: float = math.inf

    def violation(self, value: float) -> float:
        """By how much a value is beyond a limit, as a share of the limit unless that is zero."""
        if math.isnan(value):
            return math.inf
        if value < self.lower:
            return (self.lower - value) / (abs(self.lower) or 1.0)
        if value > self.upper:
            return (value - self.upper) / (abs(self.upper) or 1.0)
        return 0.0

    def complaint(self, value: float) -> str:
        """Say what is wrong with a value; "" if nothing is."""
        if value < self.lower:
            return f"{self.metric} {value:.6g} < {self.lower:.6g}"
        if value > self.upper:
            return f"{self.metric} {value:.6g} > {self.upper:.6g}"
        return ""


class DesignTask(NamedTuple):
    """What it takes to evaluate designs, without the rest of their study.

    Attributes:
        base: The leg whose other dimensions and effort limits the designs have.
        parameters: Names of the dimensions that differ.
        metrics: Names of the metrics.
        conditions: What they are measured under.
    """

    base: Leg
    parameters: tuple[str, ...]
    metrics: tuple[str, ...]
    conditions: Conditions

    def evaluate(self, values: Iterable[float]) -> Evaluation:
        """Evaluate the design with these dimensions [SI]."""
        changes = dict(zip(self.parameters, map(float, values), strict=True))
        return evaluate_design(self.base, changes, self.metrics, self.conditions)


@dataclass(frozen=True)
class Study:
    """What to vary, what to want, what to spend.

    Attributes:
        document: The study file.
        robot: Description of the robot whose leg is to be improved.
        leg: The leg as it is now; its mechanism is the base of all designs.
        parameters: The dimensions that vary (P).
        objectives: Metrics to make lower or higher, as each has it (K).
        constraints: Limits that a feasible design keeps.
        record: Further metrics.
        conditions: What metrics are measured under.
        method: Name of the search method.
        draw: What the method has to go by.
    """

    document: Document
    robot: Document
    leg: Leg
    parameters: tuple[Parameter, ...]
    objectives: tuple[str, ...]
    constraints: tuple[Constraint, ...]
    record: tuple[str, ...]
    conditions: Conditions
    method: str
    draw: Draw

    @property
    def name(self) -> str:
        """Name of the study."""
        return str(self.document.root["name"])

    @property
    def ground(self) -> str:
        """Name of the ground of the conditions; "" if they give its friction, or none."""
        ground = self.document.root.get("conditions", {}).get("ground", "")
        return ground if isinstance(ground, str) else ""

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """All metrics of a design: objectives first, then constrained and recorded ones."""
        constrained = (constraint.metric for constraint in self.constraints)
        return tuple(dict.fromkeys((*self.objectives, *constrained, *self.record)))

    @property
    def total(self) -> int:
        """Number of designs that the search evaluates, if it does not run out of new ones."""
        return self.draw.generations * self.draw.population

    def parameters_at(self, point: FloatArray) -> FloatArray:
        """Return the dimensions (P,) [SI] at a point of the unit cube (P,)."""
        return np.array([p.at(x) for p, x in zip(self.parameters, point, strict=True)])

    def changes(self, values: Iterable[float]) -> dict[str, float]:
        """Return dimensions by name [SI]."""
        return {p.name: float(x) for p, x in zip(self.parameters, values, strict=True)}

    @property
    def task(self) -> DesignTask:
        """What a worker needs to evaluate designs."""
        names = tuple(parameter.name for parameter in self.parameters)
        return DesignTask(self.leg, names, self.metrics, self.conditions)

    def costs(self, values: FloatArray) -> FloatArray:
        """Return the objectives (..., K) among the metrics' values as costs: less is better."""
        return self.signs * values[..., : len(self.objectives)]

    def score(self, values: FloatArray, base: FloatArray) -> float:
        """Return how much better than the base a design is, as one number: equation (33).

        The product of the relative gains in all objectives if every one of them is better than the
        base's; else the worst gain, which is not positive. So any design that is better in
        everything comes before any that is not, and one objective gives its own order.
        """
        reference = self.costs(base)
        gains = (reference - self.costs(values)) / np.where(reference, np.abs(reference), 1.0)
        return float(np.prod(gains) if np.all(gains > 0.0) else np.min(gains))

    def violation(self, values: FloatArray) -> float:
        """By how much the metrics' values violate the constraints, 0 if they keep them."""
        return sum(c.violation(self._value(values, c.metric)) for c in self.constraints)

    def complaint(self, values: FloatArray) -> str:
        """Say which constraints are violated; "" if none is."""
        complaints = (c.complaint(self._value(values, c.metric)) for c in self.constraints)
        return "; ".join(filter(None, complaints))

    @cached_property
    def signs(self) -> FloatArray:
        """1 for each objective that is better low, -1 for each that is better high (K,)."""
        better = (find_metric(name).better for name in self.objectives)
        return np.array([1.0 if b == "low" else -1.0 for b in better])

    def _value(self, values: FloatArray, metric: str) -> float:
        return float(values[self.metrics.index(metric)])
