# SPDX-License-Identifier: Apache-2.0
"""Wang, Liu, Huang: the six-bar leg that follows Theo Jansen's (`six_bar`, `theo_jansen`).

The copy at hand has no tables, so their dimensions cannot be compared: only what the text prints.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from leg_kinematics.gait_curve import GaitCurve, gait_curve
from leg_statics.design.synthesis import (
    JANSEN,
    PAPER_PHI_MAX,
    Design,
    fit,
    limit_positions,
    search,
    sweep,
    synthesize,
)
from leg_statics.published.comparison import Comparison, compare_claim, compare_number

PAPER = "003"

# Extremes of phi' in Jansen's linkage and the crank angles where they lie (figure 5) [rad].
PHI_LARGEST, PHI_LARGEST_AT = math.radians(181.68), math.radians(348.55)
PHI_SMALLEST, PHI_SMALLEST_AT = math.radians(103.96), math.radians(167.94)
SWING = math.radians(77.72)  # (15)

# Range of phi_max in figure 7 [rad], and the number of crank angles in (8).
PHI_MAX_RANGE = (math.radians(78.0), math.radians(180.0))
SAMPLES = 200

LARGEST_DEVIATION = 0.26  # of the foot from Jansen's: "smaller than" [cranks]

# The prototype: crank speed [rad/s], walking speed [m/s], height of its frame over the ground [m].
CRANK_SPEED = 30.0 * 2.0 * math.pi / 60.0
WALKING_SPEED = 0.06
FRAME_HEIGHTS = (0.140, 0.1422)
ASSUMED_CRANK = 0.015  # m, of the shipped walker


class Legs(NamedTuple):
    """The paper's optimum, the best of all five dimensions, and the gait curves of three legs."""

    optimum: Design
    direct: Design
    jansen_curve: GaitCurve
    optimum_curve: GaitCurve
    direct_curve: GaitCurve


def legs(seed: int = 0) -> Legs:
    """Return the legs to compare, in cranks.

    Args:
        seed: Seed of the direct search.
    """
    optimum, direct = synthesize(PAPER_PHI_MAX), search(seed)
    return Legs(
        optimum,
        direct,
        gait_curve(JANSEN),
        gait_curve(optimum.mechanism(), assembly_mode=optimum.assembly_mode),
        gait_curve(direct.mechanism(), assembly_mode=direct.assembly_mode),
    )


def crank_length_of_speed(curve: GaitCurve) -> float:
    """Return the crank length with which the prototype's two speeds agree without slip [m].

    Args:
        curve: The leg's curve in cranks.
    """
    return WALKING_SPEED / (CRANK_SPEED / (2.0 * math.pi) * 2.0 * curve.stride)


def number_comparisons() -> list[Comparison]:
    """Compare the extremes of phi' with ours."""
    limits = limit_positions()
    phi, angles = np.degrees(limits.phi), np.degrees(limits.crank_angles)
    note = "exact: B lies on the line AD there"
    rows = (
        ("largest phi'", PHI_LARGEST, phi[0], ""),
        ("crank angle of the largest phi'", PHI_LARGEST_AT, angles[0], note),
        ("smallest phi'", PHI_SMALLEST, phi[1], ""),
        ("crank angle of the smallest phi'", PHI_SMALLEST_AT, angles[1], note),
        ("swing of phi', equation (15)", SWING, phi[0] - phi[1], ""),
    )
    return [
        compare_number(PAPER, item, math.degrees(published), float(ours), unit="°", note=note)
        for item, published, ours, note in rows
    ]


def claim_comparisons() -> list[Comparison]:
    """Compare what the paper states of its optimum."""
    low, high = (round(2.0 * math.degrees(angle)) for angle in PHI_MAX_RANGE)
    curve = sweep(np.radians(0.5 * np.arange(low, high + 1)), SAMPLES)
    best = [math.degrees(curve.phi_max[np.nanargmin(values)]) for values in curve.fits]
    best_rms, best_mean, best_foot = best
    optimum = synthesize(PAPER_PHI_MAX)
    deviation = float(fit(optimum).largest_deviation)
    curves = gait_curve(JANSEN), gait_curve(optimum.mechanism())
    heights = [c.step_height for c in curves]
    waves = [c.body_fluctuation for c in curves]
    claims = (
        (
            "eta is least at phi_max = 168°",
            min(abs(angle - math.degrees(PAPER_PHI_MAX)) for angle in best) <= 1.0,
            f"{best_rms:.1f}° by rms, {best_mean:.1f}° by mean, {best_foot:.1f}° by largest foot "
            "deviation",
            "the norm of (8) is not printed",
        ),
        (
            "largest foot deviation at 168° < 0.26",
            deviation < LARGEST_DEVIATION,
            f"{deviation:.4f}",
            "in cranks",
        ),
        (
            "the optimum has Jansen's step height",
            math.isclose(heights[0], heights[1], rel_tol=0.005),
            f"{heights[1]:.4f}, Jansen {heights[0]:.4f}",
            "in cranks",
        ),
        (
            "the body of a two-leg unit fluctuates less than with Jansen's leg",
            waves[1] < waves[0],
            f"{waves[1]:.4f}, Jansen {waves[0]:.4f}",
            "(18) read as r_D - r_G, in cranks",
        ),
    )
    return [compare_claim(PAPER, *claim) for claim in claims]


def prototype_comparisons() -> list[Comparison]:
    """Compare what the text prints of the walking prototype, without slip.

    Its crank length is in a table that the copy lacks: the assumed one was chosen to suit the
    speed, which therefore confirms nothing; the rise and fall of the frame may.
    """
    curve = gait_curve(synthesize(PAPER_PHI_MAX).mechanism())
    turns = CRANK_SPEED / (2.0 * math.pi)
    low, high = FRAME_HEIGHTS
    note = f"crank of {1e3 * ASSUMED_CRANK:g} mm, assumed"
    return [
        compare_number(
            PAPER,
            "walking speed at 30 r/min",
            WALKING_SPEED,
            turns * 2.0 * curve.stride * ASSUMED_CRANK,
            unit="m/s",
            note=f"{note} to suit it",
        ),
        compare_number(
            PAPER,
            f"rise and fall of the frame, {1e3 * low:g} to {1e3 * high:g} mm",
            1e3 * (high - low),
            1e3 * ASSUMED_CRANK * curve.body_fluctuation,
            unit="mm",
            note=note,
        ),
    ]


def comparisons() -> list[Comparison]:
    """Return every published number and claim beside ours."""
    return number_comparisons() + claim_comparisons() + prototype_comparisons()
