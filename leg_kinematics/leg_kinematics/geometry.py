# SPDX-License-Identifier: Apache-2.0
"""Geometry parameters of a mechanism: declared as fields of its dataclass, checked, as an array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import Field, field, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np

from leg_kinematics.arguments import as_number
from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.errors import GeometryError, LegError
from leg_kinematics.mechanism import Excursion, Joint, Mechanism

Dimension = Literal["length", "angle", "ratio"]
SI_UNITS: dict[Dimension, str] = {"length": "m", "angle": "rad", "ratio": "1"}


def parameter(doc: str, symbol: str, dimension: Dimension, default: float) -> Any:
    """Declare a geometry parameter of a mechanism dataclass.

    Args:
        doc: What it measures.
        symbol: The paper's symbol.
        dimension: "length" or "ratio" (must be > 0), or "angle".
        default: Default value in SI units.
    """
    return _parameter(doc, symbol, dimension, default, positive=dimension != "angle")


def offset(doc: str, symbol: str, default: float) -> Any:
    """Declare a geometry parameter that is a signed length (it may be zero or negative)."""
    return _parameter(doc, symbol, "length", default, positive=False)


def _parameter(
    doc: str, symbol: str, dimension: Dimension, default: float, *, positive: bool
) -> Any:
    metadata = {"doc": doc, "symbol": symbol, "dimension": dimension, "positive": positive}
    return field(default=default, metadata=metadata)


def geometry_parameters(mechanism: Any) -> tuple[Field[Any], ...]:
    """Return the fields of a mechanism (class or instance) that are geometry parameters."""
    return tuple(f for f in fields(mechanism) if "dimension" in f.metadata)


class Dimensioned(Mechanism):
    """Base of the mechanisms that are given by dimensions; a subclass is a frozen dataclass.

    Attributes:
        joint_ranges: Pairs (lower, upper), one an actuated joint [rad or m].
        passive_joint_ranges: The same of the passive joints' excursions.
    """

    joint_ranges: tuple[tuple[float, float], ...]
    passive_joint_ranges: tuple[tuple[float, float], ...]

    def check_fields(self) -> None:
        """Check every field by itself.

        Raises:
            GeometryError: If a parameter is not finite, or not positive although it must be, or a
                range is reversed, NaN or missing.
        """
        for f in geometry_parameters(self):
            try:
                value = as_number(f"{f.name} ({f.metadata['symbol']})", getattr(self, f.name))
            except LegError as error:
                raise GeometryError(str(error)) from None
            if f.metadata["positive"] and value <= 0.0:
                unit = SI_UNITS[f.metadata["dimension"]]
                raise GeometryError(
                    f"{f.name} ({f.metadata['symbol']}) must be > 0 [{unit}], got {value}"
                )
        check_ranges("joint_ranges", self.joint_ranges, self.joints)
        check_ranges("passive_joint_ranges", self.passive_joint_ranges, self.excursions)

    @cached_property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""
        return _pairs("joint_ranges", self.joint_ranges)

    @cached_property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the excursions of the passive joints (e, 2) [rad or m]."""
        return _pairs("passive_joint_ranges", self.passive_joint_ranges)

    @cached_property
    def _geometry(self) -> FloatArray:
        """Geometry parameters in the order of declaration (g,) [SI]."""
        return np.array([getattr(self, f.name) for f in geometry_parameters(self)], np.float64)


def _pairs(name: str, ranges: Any) -> FloatArray:
    array = as_array(name, ranges)
    return array if array.size else np.empty((0, 2))


def check_ranges(name: str, ranges: Any, joints: Sequence[Joint | Excursion]) -> None:
    """Raise a GeometryError unless there is a range (lower, upper) for each joint."""
    array = _pairs(name, ranges)
    if array.shape != (len(joints), 2):
        raise GeometryError(
            f"{name} must be {len(joints)} pairs (lower, upper), got shape {array.shape}"
        )
    for joint, (lower, upper) in zip(joints, array, strict=True):
        if not lower <= upper:
            raise GeometryError(
                f"{name} of {joint.name}: lower {lower} must be <= upper {upper} [{joint.unit}]"
            )
