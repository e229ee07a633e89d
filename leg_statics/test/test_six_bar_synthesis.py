# SPDX-License-Identifier: Apache-2.0
"""The paper's synthesis, what it states of its optimum, and the direct search."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from leg_kinematics.errors import GeometryError, ValueRangeError
from leg_kinematics.gait_curve import gait_curve
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_statics.commands import synthesize_six_bar
from leg_statics.design.synthesis import (
    JANSEN,
    PAPER_PHI_MAX,
    Design,
    angle_deviations,
    fit,
    jansen_phi,
    jansen_points,
    limit_positions,
    search,
    sweep,
    synthesize,
)
from leg_statics.published import paper_003

OPTIMUM = synthesize(PAPER_PHI_MAX)


@pytest.fixture(scope="module")
def direct():
    return search(seed=0)


def phi_of(design, angles):
    """Angle from CF to CB in the six-bar leg."""
    mechanism = design.mechanism()
    posture = mechanism.forward(angles[:, None], design.assembly_mode)
    linkage = mechanism.linkage(posture)
    points = -linkage.points[..., 0] + 1j * linkage.points[..., 2]
    b, c, f = (points[:, linkage.names.index(n)] for n in "BCF")
    return np.angle((b - c) / (f - c)) % (2 * math.pi)


def test_phi_of_jansen_turns_back_as_published():
    limits = limit_positions()
    phi, angles = np.degrees(limits.phi), np.degrees(limits.crank_angles)
    np.testing.assert_allclose(phi, [181.69, 103.96], atol=0.005)
    np.testing.assert_allclose(angles, [348.40, 168.40], atol=0.005)
    assert phi[0] - phi[1] == pytest.approx(77.73, abs=0.005)
    published = np.degrees([paper_003.PHI_LARGEST, paper_003.PHI_SMALLEST])
    np.testing.assert_allclose(phi, published, atol=0.015)
    published = np.degrees([paper_003.PHI_LARGEST_AT, paper_003.PHI_SMALLEST_AT])
    np.testing.assert_allclose(angles, published, atol=0.5)


def test_limit_positions_are_the_extremes_of_phi():
    limits = limit_positions()
    phi = jansen_phi(np.linspace(0.0, 2 * math.pi, 20_001))
    assert phi.max() == pytest.approx(limits.phi[0], abs=1e-6)
    assert phi.max() <= limits.phi[0] + 1e-12
    assert phi.min() == pytest.approx(limits.phi[1], abs=1e-6)
    assert phi.min() >= limits.phi[1] - 1e-12


def test_dimensions_at_168_degrees():
    found = [*OPTIMUM[:3], OPTIMUM.rod_crank, OPTIMUM.foot_brace]
    np.testing.assert_allclose(found, [0.8240, 5.5456, 2.2750, 1.8169, 4.6480], atol=5e-5)
    assert OPTIMUM.assembly_mode == "walking"
    leg = SixBar()
    default = [leg.pin_spacing, leg.rod, leg.foot_lever, leg.rod_crank, leg.foot_brace]
    np.testing.assert_allclose(found, default, rtol=1e-12)


@pytest.mark.parametrize("degrees", [90.0, 120.0, 150.0, 168.0, 175.0])
def test_design_turns_back_where_jansen_does(degrees):
    design, limits = synthesize(math.radians(degrees)), limit_positions()
    phi = phi_of(design, limits.crank_angles)
    wanted = [math.radians(degrees), math.radians(degrees) - (limits.phi[0] - limits.phi[1])]
    np.testing.assert_allclose(phi, wanted, atol=1e-7)
    turn = phi_of(design, np.linspace(0.0, 2 * math.pi, 3601))
    assert turn.max() <= wanted[0] + 1e-7
    assert turn.min() >= wanted[1] - 1e-7
    # in the limit positions the feet are the same
    assert foot_deviations(design, limits.crank_angles).max() < 1e-6


def foot_deviations(design, angles):
    mechanism = design.mechanism()
    foot = mechanism.forward(angles[:, None], design.assembly_mode).foot_position
    jansen = JANSEN.forward(angles[:, None]).foot_position
    return np.linalg.norm(foot - jansen, axis=-1)


def test_fit_of_the_optimum():
    found = fit(OPTIMUM)
    assert np.degrees(found.rms) == pytest.approx(1.908, abs=5e-4)
    assert found.largest_deviation == pytest.approx(0.2444, abs=5e-5)
    assert found.largest_deviation < paper_003.LARGEST_DEVIATION


def test_fit_agrees_with_the_gait_curves():
    deviation = gait_curve(OPTIMUM.mechanism(), 200).deviation(gait_curve(JANSEN, 200))
    assert fit(OPTIMUM, 200).largest_deviation == pytest.approx(deviation.max(), abs=1e-9)


def test_angle_deviation_is_that_of_the_foot_bar():
    deviation = angle_deviations(OPTIMUM, 8)
    angles = np.arange(8) * (math.pi / 4)
    points = jansen_points(angles)
    foot = OPTIMUM.mechanism().forward(angles[:, None]).foot_position
    bar = -foot[:, 0] + 1j * foot[:, 2] - points["C"]
    turned = (points["G"] - points["C"]) * np.exp(1j * deviation)
    np.testing.assert_allclose(turned, bar, atol=1e-9)


def test_gait_of_the_optimum_beats_jansens():
    jansen, ours = gait_curve(JANSEN), gait_curve(OPTIMUM.mechanism())
    assert ours.step_height == pytest.approx(1.4942, abs=5e-5)
    assert ours.body_fluctuation == pytest.approx(0.0795, abs=5e-5)
    assert jansen.body_fluctuation == pytest.approx(0.1158, abs=5e-5)


def test_sweep_has_its_optimum_near_but_not_at_168_degrees():
    curve = sweep(np.radians(np.arange(78.0, 180.0, 0.5)))
    best = [np.degrees(curve.phi_max[np.nanargmin(values)]) for values in curve.fits]
    assert best == pytest.approx([161.0, 164.0, 158.5], abs=0.01)
    assert np.isfinite(curve.fits.rms).all()


def test_sweep_leaves_gaps_where_no_design_exists():
    curve = sweep(np.radians([168.0, 180.0]))
    assert np.isfinite(curve.fits.rms[0])
    assert np.isnan(curve.fits.rms[1])


def test_phi_max_out_of_range_is_refused():
    for degrees in (77.0, 181.0):
        with pytest.raises(ValueRangeError, match="phi_max must be"):
            synthesize(math.radians(degrees))
    with pytest.raises(GeometryError):
        synthesize(math.pi)


def test_direct_search_fits_best(direct):
    found = fit(direct)
    assert np.degrees(found.rms) == pytest.approx(0.736, abs=5e-4)
    assert 0.06 < found.largest_deviation < 0.09
    curve = gait_curve(direct.mechanism(), assembly_mode=direct.assembly_mode)
    assert curve.body_fluctuation == pytest.approx(0.124, abs=5e-4)


def test_search_repeats_itself_and_reports():
    reports = []
    first = search(seed=3, generations=5, callback=reports.append)
    assert [report.generation for report in reports] == [1, 2, 3, 4, 5]
    assert all(a.rms >= b.rms for a, b in pairwise(reports))
    second = search(seed=3, generations=5)
    np.testing.assert_array_equal(np.array(first), np.array(second))


def test_search_stops_when_the_callback_says_so():
    reports = []

    def stop(progress):
        reports.append(progress)
        return len(reports) == 2

    search(seed=0, generations=50, callback=stop)
    assert len(reports) == 2


def test_search_refuses_an_empty_population():
    with pytest.raises(ValueRangeError, match="population"):
        search(population=0)


def test_flipped_designs_are_assembled_in_their_mode():
    design = synthesize(math.radians(90.0))
    assert design.assembly_mode == "flipped_crank+foot"
    foot = design.mechanism().forward([0.7], design.assembly_mode).foot_position
    jansen = jansen_points([0.7])
    distance = np.linalg.norm(foot - [-jansen["G"][0].real, 0.0, jansen["G"][0].imag])
    assert distance == pytest.approx(foot_deviations(design, np.array([0.7]))[0], abs=1e-12)
    assert distance < fit(design, 3600).largest_deviation + 1e-9


def test_open_designs_fit_nothing():
    open_ = Design(*map(np.asarray, (0.5, 20.0, 2.0, 3.0, -2.0)))
    assert np.isnan(fit(open_).rms)


def test_paper_is_compared():
    rows = paper_003.comparisons()
    contradicted = [row.item for row in rows if not row.holds]
    assert contradicted == [
        "eta is least at phi_max = 168°",
        "rise and fall of the frame, 140 to 142.2 mm",
    ]
    legs = paper_003.legs()
    assert paper_003.crank_length_of_speed(legs.optimum_curve) == pytest.approx(0.0147, abs=1e-4)


def test_command_prints_a_table_and_draws(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    folder = tmp_path / "figures"
    arguments = ["--generations", "3", "--crank-length", "15", "--figures", str(folder)]
    assert synthesize_six_bar.main(arguments) == 0
    assert "l_BE [mm]" in capsys.readouterr().out
    assert len(list(folder.glob("*.png"))) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--phi-max", "20"], "phi_max must be"),
        (["--phi-max", "nan"], "phi_max must be"),
        (["--crank-length", "-1"], "--crank-length must be > 0"),
        (["--samples", "0"], "--samples must be"),
        (["--generations", "0"], "generations must be"),
    ],
)
def test_command_tells_what_is_wrong(arguments, message, capsys):
    assert synthesize_six_bar.main(arguments) == 1
    assert message in capsys.readouterr().err
