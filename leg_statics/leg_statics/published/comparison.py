# SPDX-License-Identifier: Apache-2.0
"""One published number or claim beside ours, with the verdict computed, never typed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

REPRODUCED = "reproduced"
CONTRADICTED = "contradicted"
NO_VALUE = "has no value"


class Comparison(NamedTuple):
    """A published number or claim beside what this suite finds.

    Attributes:
        paper: Number of the paper, e.g. "000".
        item: What is compared.
        published: What the paper prints.
        ours: What we compute.
        difference: Relative difference, or "" for a claim.
        verdict: "reproduced", "reproduced within x %", "differs by x %", "contradicted", or "has no
            value" for a number that ours does not converge to.
        note: Reason or condition.
    """

    paper: str
    item: str
    published: str
    ours: str
    difference: str
    verdict: str
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether our computation confirms the paper."""
        return self.verdict.startswith(REPRODUCED)


def compare_number(
    paper: str,
    item: str,
    published: float,
    ours: float,
    *,
    unit: str = "",
    exact: float = 0.001,
    acceptable: float = 0.05,
    note: str = "",
) -> Comparison:
    """Compare a published number with ours.

    Args:
        paper: Number of the paper.
        item: What the number is.
        published: The printed value.
        ours: Our value.
        unit: Unit of both.
        exact: Relative difference up to which the number counts as reproduced.
        acceptable: Relative difference up to which it counts as reproduced within a percentage.
        note: Reason or condition.
    """
    difference = ours / published - 1.0 if published else ours
    percent = f"{abs(100.0 * difference):.1f} %"
    if abs(difference) <= exact:
        verdict = REPRODUCED
    elif abs(difference) <= acceptable:
        verdict = f"{REPRODUCED} within {percent}"
    else:
        verdict = f"differs by {percent}"
    suffix = f" {unit}" if unit else ""
    return Comparison(
        paper,
        item,
        f"{published:g}{suffix}",
        f"{ours:.5g}{suffix}",
        f"{100.0 * difference:+.2f} %",
        verdict,
        note,
    )


def compare_direction(
    paper: str,
    item: str,
    published: Sequence[float],
    ours: Sequence[float],
    *,
    exact: float = 0.5,
    acceptable: float = 5.0,
    note: str = "",
) -> Comparison:
    """Compare a published vector with ours by the angle between their lines: its sign is free.

    Args:
        paper: Number of the paper.
        item: What the vector is.
        published: The printed vector.
        ours: Our vector.
        exact: Angle up to which the direction counts as reproduced [deg].
        acceptable: Angle up to which it counts as reproduced within an angle [deg].
        note: Reason or condition.
    """
    inner = sum(a * b for a, b in zip(published, ours, strict=True))
    cosine = abs(inner) / (math.hypot(*published) * math.hypot(*ours))
    degrees = math.degrees(math.acos(min(1.0, cosine)))
    angle = f"{degrees:.1f}°"
    if degrees <= exact:
        verdict = REPRODUCED
    elif degrees <= acceptable:
        verdict = f"{REPRODUCED} within {angle}"
    else:
        verdict = f"differs by {angle}"
    sign = math.copysign(1.0, inner)
    printed = ", ".join(f"{value:.3f}" for value in published)
    found = ", ".join(f"{sign * value:.3f}" for value in ours)
    return Comparison(paper, item, printed, found, angle, verdict, note)


def compare_claim(paper: str, claim: str, holds: bool, evidence: str, note: str = "") -> Comparison:
    """Compare a claim made in words with what the computation shows.

    Args:
        paper: Number of the paper.
        claim: What the paper states.
        holds: Whether the computation confirms it.
        evidence: The numbers that decide.
        note: Reason or condition.
    """
    return Comparison(
        paper, claim, "stated", evidence, "", REPRODUCED if holds else CONTRADICTED, note
    )


def no_value(paper: str, item: str, published: float, reason: str) -> Comparison:
    """Compare a published number with a computation that has no result.

    Args:
        paper: Number of the paper.
        item: What the number is.
        published: The printed value.
        reason: Why there is none.
    """
    return Comparison(paper, item, f"{published:g}", "none", "", NO_VALUE, reason)
