# SPDX-License-Identifier: Apache-2.0
"""What the view says in numbers and words."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Reading(NamedTuple):
    """One line of what is said.

    Attributes:
        label: What it is.
        text: The number with its unit, or words.
    """

    label: str
    text: str


def quantity(value: float, unit: str, digits: int = 1) -> str:
    """Return a number with its unit; words where it is not finite."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "any" if value > 0.0 else "none"
    return f"{value:.{digits}f} {unit}".rstrip()


def percent(share: float) -> str:
    """Return a share as a percentage."""
    return quantity(100.0 * share, "%")


def place_text(place: ArrayLike) -> str:
    """Return a place (3,) [m] as text, to the millimetre."""
    rounded = np.round(np.asarray(place, dtype=np.float64), 3) + 0.0  # no negative zeros
    return ", ".join(f"{value:.3f}" for value in rounded) + " m"


def words(name: str) -> str:
    """Return a name of a member of an enumeration as words."""
    return name.lower().replace("_", " ")


def table(readings: Iterable[Reading]) -> str:
    """Return readings as a table of Markdown."""
    rows = [f"| {label} | {text} |" for label, text in readings]
    return "\n".join(["| | |", "|---|---|", *rows])
