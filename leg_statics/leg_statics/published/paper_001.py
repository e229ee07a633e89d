# SPDX-License-Identifier: Apache-2.0
"""Wang, Jin, Li 2019: the leg that `double_rhombus` models (article 1000-1298(2019)01-0383-07).

The constants printed in the paper do not reproduce its Table 1, whatever the angle varphi = AOF is,
which it leaves out:

- no varphi gives the printed signs of the driving vector in more than 5 of the 8 rows; rows 2, 5, 7
  agree together with rows 1, 4 only for varphi in 3.3°..7.5°, where the upper cylinder passes its
  dead centre inside the table and rows 3, 6, 8 disagree;
- the K_F come nearest at varphi = 148.05°, 7.6 % rms off.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanisms.double_rhombus import DoubleRhombus
from leg_statics.planar_force import ForceTransmission, force_transmission
from leg_statics.published.comparison import (
    Comparison,
    compare_claim,
    compare_direction,
    compare_number,
)

PAPER = "001"

# varphi is not printed: the value that makes the maps symmetric, and the one nearest to Table 1.
SYMMETRIC_VARPHI = math.radians(121.33)
NEAREST_VARPHI = math.radians(148.05)

# The workspace that Table 1 samples: |phi| [rad] and OI [m].
LARGEST_PHI = math.radians(30.0)
RADII = (0.500, 0.950)


class Table1Row(NamedTuple):
    """One pose of Table 1.

    Attributes:
        phi: Swing of OI from straight down [rad].
        radius: Length of OI [m]; printed with a minus sign, as O is above I.
        driving_vector: Unit forces of the upper and lower cylinder at the largest output force.
        force_gain: K_F (27), theory; the largest output force per unit of cylinder force [1].
        force_gain_simulated: The same from the authors' finite element model [1].
    """

    phi: float
    radius: float
    driving_vector: tuple[float, float]
    force_gain: float
    force_gain_simulated: float


TABLE_1: tuple[Table1Row, ...] = tuple(
    Table1Row(math.radians(phi), 1e-3 * radius, (upper, lower), theory, simulated)
    for phi, radius, upper, lower, theory, simulated in (
        (-5, 500, -0.39248, 0.91976, 0.0655, 0.0660),
        (-5, 750, -0.18454, 0.98282, 0.0751, 0.0721),
        (-5, 950, -0.68468, -0.72884, 0.1395, 0.1406),
        (-15, 550, -0.75302, 0.65800, 0.0758, 0.0703),
        (-15, 750, -0.43687, 0.89953, 0.0773, 0.0761),
        (-15, 950, -0.67205, -0.74051, 0.1381, 0.1396),
        (-25, 750, -0.56974, 0.82182, 0.0834, 0.0839),
        (-25, 950, -0.66536, -0.74652, 0.1375, 0.1389),
    )
)

LITTLE_DEFORMED = (2, 5)  # rows, from 1, with little stress and deformation in figure 5


def transmission_at(
    phi: ArrayLike, radius: ArrayLike, varphi: float = SYMMETRIC_VARPHI
) -> ForceTransmission:
    """Return this suite's force indices of the planar mechanism.

    Args:
        phi: Swing of OI from straight down (...) [rad].
        radius: Length of OI (...) [m].
        varphi: Angle AOF [rad].
    """
    leg = DoubleRhombus(upper_crank_angle=varphi)
    x, z = np.broadcast_arrays(-np.multiply(radius, np.sin(phi)), -np.multiply(radius, np.cos(phi)))
    posture = leg.inverse(np.stack([x, np.zeros_like(x), z], axis=-1))
    return force_transmission(leg.planar_jacobian(posture))


def table_1_transmission(varphi: float) -> ForceTransmission:
    """Return this suite's force indices at the poses of Table 1."""
    phi, radius = np.array([(row.phi, row.radius) for row in TABLE_1]).T
    return transmission_at(phi, radius, varphi)


def rows_with_printed_signs(varphi: float) -> tuple[int, ...]:
    """Return the rows, from 1, whose cylinders push alike or against each other as printed."""
    printed = np.prod([row.driving_vector for row in TABLE_1], axis=-1)
    ours = np.prod(table_1_transmission(varphi).driving_vector, axis=-1)
    return tuple(int(row) + 1 for row in np.flatnonzero(printed * ours > 0.0))


def workspace_maps() -> tuple[FloatArray, FloatArray, ForceTransmission]:
    """Return phi, OI and the indices over the workspace, OI by rows: figures 3 and 4."""
    phi, radius = np.meshgrid(np.linspace(-LARGEST_PHI, LARGEST_PHI, 121), np.linspace(*RADII, 181))
    return phi, radius, transmission_at(phi, radius)


def table_1_comparisons() -> list[Comparison]:
    """Compare Table 1 with this suite for both angles varphi."""
    rows = []
    for varphi in (SYMMETRIC_VARPHI, NEAREST_VARPHI):
        ours = table_1_transmission(varphi)
        given = f"varphi {math.degrees(varphi):.2f}°"
        for i, row in enumerate(TABLE_1):
            place = f"at phi {math.degrees(row.phi):.0f}°, OI {1e3 * row.radius:.0f} mm ({given})"
            found = float(ours.largest_force[i])
            vector = ours.driving_vector[i].tolist()
            simulated = row.force_gain_simulated
            rows += [
                compare_number(PAPER, f"K_F {place}", row.force_gain, found),
                compare_number(PAPER, f"K_F by the authors' ANSYS {place}", simulated, found),
                compare_direction(PAPER, f"driving vector {place}", row.driving_vector, vector),
            ]
        agreeing = rows_with_printed_signs(varphi)
        rows.append(
            compare_claim(
                PAPER,
                f"Table 1: relative signs of the cylinder forces ({given})",
                len(agreeing) == len(TABLE_1),
                f"agree in rows {', '.join(map(str, agreeing))}",
                "no varphi makes more than 5 of the 8 rows agree",
            )
        )
    return rows


def claim_comparisons() -> list[Comparison]:
    """Compare what the paper reads from its figures 3 to 5 with this suite's maps."""
    phi, radius, maps = workspace_maps()
    k_f, k_j = maps.largest_force, maps.imbalance
    asymmetry = float(np.max(np.abs(k_f[:, ::-1] / k_f - 1.0)))
    most = np.unravel_index(np.argmax(k_f), k_f.shape)
    least = np.unravel_index(np.argmin(k_f), k_f.shape)
    best = np.unravel_index(np.argmin(k_j), k_j.shape)
    center = k_f.shape[1] // 2
    top, bottom = k_f[0, center], k_f[-1, center]
    table = table_1_transmission(SYMMETRIC_VARPHI).imbalance
    in_middle = np.isin(np.arange(1, len(TABLE_1) + 1), LITTLE_DEFORMED)
    rim = min(k_j[0].min(), k_j[-1].min(), k_j[:, 0].min(), k_j[:, -1].min())

    def place(index: tuple[np.intp, ...]) -> str:
        return f"phi {math.degrees(phi[index]):.1f}°, OI {1e3 * radius[index]:.0f} mm"

    claims = (
        ("K_F is symmetric about phi = 0", asymmetry < 0.01, f"within {100.0 * asymmetry:.2f} %"),
        (
            "K_F is largest at the bottom",
            radius[most] == RADII[1],
            f"{k_f[most]:.4f} at {place(most)}",
        ),
        (
            "K_F falls upwards and is least at the top",
            radius[least] == RADII[0],
            f"bottom {bottom:.4f}, least {k_f[least]:.4f} at {place(least)}, top {top:.4f}",
        ),
        (
            "K_J is best in the middle and worse towards the rim",
            RADII[0] < radius[best] < RADII[1] and k_j[best] < rim,
            f"{k_j[best]:.4f} at {place(best)}, at least {rim:.2f} on the rim",
        ),
        (
            "K_J is less at the poses of Table 1 that deform little in figure 5",
            table[in_middle].max() < table[~in_middle].min(),
            f"at most {table[in_middle].max():.3f} in rows 2 and 5, at least "
            f"{table[~in_middle].min():.3f} in the others",
        ),
    )
    note = f"varphi {math.degrees(SYMMETRIC_VARPHI):.2f}°"
    return [
        compare_claim(PAPER, claim, bool(holds), evidence, note)
        for claim, holds, evidence in claims
    ]


def comparisons() -> list[Comparison]:
    """Return every published number and claim beside ours."""
    return table_1_comparisons() + claim_comparisons()
