# SPDX-License-Identifier: Apache-2.0
"""One published number or claim beside ours, with the verdict computed, never typed."""

from __future__ import annotations

from typing import NamedTuple

REPRODUCED = "reproduced"
CONTRADICTED = "contradicted"


class Comparison(NamedTuple):
    """A published number or claim beside what this suite finds.

    Attributes:
        paper: Number of the paper, e.g. "000".
        item: What is compared.
        published: What the paper prints.
        ours: What we compute.
        difference: Relative difference, or "" for a claim.
        verdict: "reproduced", "reproduced within x %", "differs by x %" or "contradicted".
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
