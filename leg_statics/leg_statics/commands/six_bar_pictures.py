# SPDX-License-Identifier: Apache-2.0
"""Pictures of six-bar legs beside Theo Jansen's: each is computed, then drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from leg_kinematics.gait_curve import GaitCurve, gait_curve
from leg_statics.design.synthesis import (
    JANSEN,
    PAPER_PHI_MAX,
    SAMPLES,
    Design,
    angle_deviations,
    fit,
    jansen_foot_link,
    jansen_phi,
    limit_positions,
    sweep,
)
from leg_statics.drawing.crank_legs import (
    Measure,
    Scale,
    plot_body_paths,
    plot_foot_curves,
    plot_foot_link,
    plot_jansen_phi,
    plot_postures,
    plot_sweep,
)

JANSEN_LABEL = "Theo Jansen"
SWEPT = np.radians(np.arange(78.0, 180.25, 0.25))
POSTURES = range(0, 360, 36)  # crank angles [deg]
LINK_SAMPLES = 360  # crank angles of the picture of the foot link


def gait_curves(designs: Mapping[str, Design]) -> dict[str, GaitCurve]:
    """Return the foot curves of Jansen's leg and of designs, by name, in cranks."""
    return {
        JANSEN_LABEL: gait_curve(JANSEN),
        **{
            label: gait_curve(design.mechanism(), assembly_mode=design.assembly_mode)
            for label, design in designs.items()
        },
    }


def six_bar_pictures(
    synthesized: tuple[str, Design],
    direct: tuple[str, Design],
    scale: Scale,
    samples: int = SAMPLES,
) -> dict[str, Callable[[], Figure]]:
    """Return what draws figures 2, 5, 7, 8, 9 and 12 of paper 003, by the names of their files.

    Args:
        synthesized: Label and design of the leg by the paper's equations.
        direct: Label and design of the leg that a direct search found.
        scale: Unit of lengths.
        samples: Number of crank angles of equation (8).
    """
    designs = dict((synthesized, direct))
    curves = gait_curves(designs)
    return {
        "figure_2_postures": partial(_postures, *synthesized, curves[synthesized[0]], scale),
        "figure_5_jansen_phi": _jansen_phi,
        "figure_7_sweep": partial(_sweep, direct[1], samples),
        "figure_8_angles": partial(_foot_link, designs),
        "figure_9_foot_curves": partial(plot_foot_curves, curves, scale),
        "figure_12_body_paths": partial(plot_body_paths, curves, scale),
    }


def _postures(label: str, design: Design, curve: GaitCurve, scale: Scale) -> Figure:
    leg, mode = design.mechanism(), design.assembly_mode
    linkages = {
        degrees: leg.linkage(leg.forward([math.radians(degrees)], mode)) for degrees in POSTURES
    }
    return plot_postures(linkages, curve, label, scale)


def _jansen_phi() -> Figure:
    angles = np.radians(np.arange(0.0, 360.5, 0.5))
    limits = limit_positions()
    return plot_jansen_phi(angles, jansen_phi(angles), limits.crank_angles, limits.phi)


def _sweep(direct: Design, samples: int) -> Figure:
    swept = sweep(SWEPT, samples)
    names = "root mean square", "mean of |φ5 - φ5'|", "largest foot deviation"
    rms, mean_absolute, foot = (
        Measure(name, values, float(value))
        for name, values, value in zip(names, swept.fits, fit(direct, samples), strict=True)
    )
    return plot_sweep(swept.phi_max, rms, mean_absolute, foot, PAPER_PHI_MAX)


def _foot_link(designs: Mapping[str, Design]) -> Figure:
    angles = np.arange(LINK_SAMPLES) * (2.0 * np.pi / LINK_SAMPLES)
    deviations = {name: angle_deviations(d, LINK_SAMPLES) for name, d in designs.items()}
    return plot_foot_link((JANSEN_LABEL, jansen_foot_link(angles)), deviations)
