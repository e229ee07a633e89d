# SPDX-License-Identifier: Apache-2.0
"""Masses on bars of the papers' linkages: what holds them is the slope of the potential energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mechanism_zoo import chosen, random_joints

from leg_kinematics import (
    MECHANISMS,
    DescriptionError,
    GeometryError,
    Mirrored,
    NotSupportedError,
    Status,
    load_robot,
)
from leg_kinematics.description import find_robot_file, load_leg_types
from leg_kinematics.mechanisms.weighed import BarMass

GRAVITY = np.array([0.9, -2.0, -9.3])
STEP = 1e-5
MASSES = {
    "parallel_drive": (
        *(BarMass(("R_D1", "U1"), 1.5), BarMass(("U1", "S1"), 0.7, 0.4), BarMass(("U3", "G"), 2.0)),
        *(BarMass(("G", "S"), 0.5), BarMass(("H", "R3"), 3.0), BarMass(("R1", "R2"), 1.0, 0.2)),
        *(BarMass(("R5", "C"), 2.5), BarMass(("S",), 0.3), BarMass(("R3", "R5"), 0.6)),
    ),
    "double_rhombus": (
        *(BarMass(("O", "F"), 1.0), BarMass(("F", "J"), 0.8), BarMass(("H", "I"), 0.5)),
        *(BarMass(("A",), 0.4), BarMass(("B",), 0.6), BarMass(("C", "B"), 2.0)),
        BarMass(("L",), 1.0),
    ),
    "six_bar": (BarMass(("A", "B"), 0.1), BarMass(("C", "G"), 0.2), BarMass(("E", "F"), 0.3, 0.9)),
    "theo_jansen": (BarMass(("B", "U"), 0.1), BarMass(("D", "L"), 0.2), BarMass(("G",), 0.3)),
    "gantry_hybrid": (
        *(BarMass(("A''", "A'"), 1.0), BarMass(("C''", "C'"), 0.5, 0.3), BarMass(("O''",), 4.0)),
        BarMass(("O'", "F"), 7.0),
    ),
}  # fmt: skip


def weighed(name):
    return replace(MECHANISMS[name](), bar_masses=MASSES[name])


def potential(mechanism, masses, q, mode):
    """Return the potential energy (m,), by the points of the linkage."""
    linkage = mechanism.linkage(mechanism.forward(q, mode))
    total = np.zeros(len(q))
    for bar in masses:
        first, last = (linkage.points[:, linkage.names.index(bar.points[k])] for k in (0, -1))
        total -= bar.mass * (first + bar.at * (last - first)) @ GRAVITY
    return total


@pytest.mark.parametrize("name", MASSES)
@pytest.mark.parametrize("make", [lambda m: m, Mirrored], ids=["plain", "mirrored"])
def test_holding_efforts_are_the_slope_of_the_potential_energy(name, make):
    mechanism = weighed(name)
    if make is Mirrored and not mechanism.has_point_foot:
        pytest.skip("a manipulator has no mirror image")
    mechanism = make(mechanism)
    modes = mechanism.assembly_modes[:: max(1, len(mechanism.assembly_modes) // 4)]
    tried = 0
    for mode in modes if len(mechanism.joints) == 1 else modes[:1]:
        posture = mechanism.forward(random_joints(mechanism, 300), mode)
        posture = chosen(posture, posture.status == Status.OK)
        held = mechanism.holding_efforts(posture, GRAVITY)
        steep = np.abs(mechanism.jacobian(posture)).max(axis=(1, 2))
        for k in range(len(mechanism.joints)):
            dq = STEP * np.eye(len(mechanism.joints))[k]
            ends = [
                potential(mechanism, MASSES[name], posture.joint_positions + way, mode)
                for way in (-dq, dq)
            ]
            slope = (ends[1] - ends[0]) / (2.0 * STEP)
            known = np.isfinite(slope) & (steep < 20.0)
            tried += known.sum()
            np.testing.assert_allclose(held[known, k], slope[known], rtol=1e-5, atol=1e-5)
    assert tried > 100


def test_without_masses_no_weight_is_told():
    mechanism = MECHANISMS["six_bar"]()
    assert not mechanism.has_masses
    with pytest.raises(NotSupportedError, match="masses"):
        mechanism.holding_efforts(mechanism.initial_posture, GRAVITY)


WRONG = {
    "U1-S4: 1": "unknown point 'S4'.*U1",
    "U1-H: 1": "U1-H is no bar",
    "U1-S1: -1": "masses",
    "U1-S1: {mass: 1, at: 2}": "masses",
    "U1-S1: heavy": "masses",
}


def hexapod(folder, masses):
    text = find_robot_file("hexapod").read_text()
    line = "    effort_limits: &effort_limits\n"
    assert text.count(line) == 1
    (folder / "r.yaml").write_text(text.replace(line, f"    masses: {{{masses}}}\n{line}"))
    return folder / "r.yaml"


@pytest.mark.parametrize(("masses", "message"), WRONG.items())
def test_a_mistake_in_masses_is_told_with_its_line(tmp_path, masses, message):
    with pytest.raises(DescriptionError, match=rf"(?s)r.yaml:\d+: .*{message}"):
        load_robot(hexapod(tmp_path, masses))


def test_masses_of_a_description_count(tmp_path):
    leg = load_leg_types(hexapod(tmp_path, "H-R3: 2, R5-C: {mass: 1, at: 0.4}"))["initial"]
    assert leg.mechanism.has_masses
    assert leg.mechanism.mass == pytest.approx(3.0)


def test_impossible_masses_are_refused():
    with pytest.raises(GeometryError, match="mass"):
        replace(MECHANISMS["six_bar"](), bar_masses=(BarMass(("A", "B"), -1.0),))
