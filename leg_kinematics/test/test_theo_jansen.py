# SPDX-License-Identifier: Apache-2.0
"""`TheoJansen` against pylinkage, an independent simulator, and the paper's numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.gait_curve import gait_curve
from leg_kinematics.mechanisms.parallel_drive import ParallelDrive
from leg_kinematics.mechanisms.six_bar import SixBar
from leg_kinematics.mechanisms.theo_jansen import TheoJansen

LEG = TheoJansen(crank_length=1.0)
STEPS = 360


def simulated_feet():
    """Feet of Jansen's linkage by pylinkage at crank angles 1°, 2° ... 360°."""
    pl = pytest.importorskip("pylinkage")
    from pylinkage.simulation import Linkage

    start = dict(zip(LEG.point_names, LEG.linkage(LEG.forward([0.0])).points, strict=True))

    def at(name):
        return {"x": -start[name][0], "y": start[name][2], "name": name}

    a, d = pl.Ground(0.0, 0.0, name="A"), pl.Ground(38 / 15, -7.8 / 15, name="D")
    crank = pl.Crank(anchor=a, radius=1.0, angular_velocity=2 * math.pi / STEPS, name="B")
    b = crank.output

    def dyad(name, p, q, first, second):
        return pl.RRRDyad(p, q, distance1=first / 15, distance2=second / 15, **at(name))

    c = dyad("C", b, d, 61.9, 39.3)
    u = dyad("U", b, d, 50.0, 41.5)
    l_ = dyad("L", d, u, 40.1, 55.8)
    f = dyad("F", l_, c, 39.4, 36.7)
    g = dyad("G", c, f, 49.0, 65.7)
    linkage = Linkage([a, d, crank, c, u, l_, f, g])
    return np.array([positions[-1] for positions in linkage.step(iterations=STEPS)], dtype=float)


def test_foot_agrees_with_pylinkage():
    simulated = simulated_feet()
    q = np.arange(1, STEPS + 1)[:, None] * (2 * math.pi / STEPS)
    foot = LEG.forward(q).foot_position
    np.testing.assert_allclose(simulated[:, 0], -foot[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(simulated[:, 1], foot[:, 2], rtol=0, atol=1e-9)


def test_gait_of_jansen():
    curve = gait_curve(LEG)
    assert curve.step_height == pytest.approx(1.4971, abs=5e-5)
    assert curve.body_fluctuation == pytest.approx(0.1158, abs=5e-5)


def test_the_leg_walks_forwards_when_the_crank_does():
    curve = gait_curve(LEG)
    assert (np.diff(curve.support[:, 0]) < 0.0).all()
    assert (np.diff(curve.body_path[:, 0]) > 0.0).all()


def test_gait_scales_with_the_crank():
    small, large = gait_curve(LEG), gait_curve(TheoJansen(crank_length=3.0))
    for name in ("step_height", "length", "stride", "flatness", "body_fluctuation"):
        assert getattr(large, name) == pytest.approx(3.0 * getattr(small, name), rel=1e-12)


def test_gait_does_not_depend_on_the_crank_zero():
    shifted = gait_curve(TheoJansen(crank_length=1.0, crank_zero=1.0))
    for name in ("step_height", "stride", "flatness", "body_fluctuation"):
        assert getattr(shifted, name) == pytest.approx(getattr(gait_curve(LEG), name), abs=1e-4)


def test_support_ends_with_both_feet_on_the_ground():
    support = gait_curve(LEG).support
    assert support[0, 2] == pytest.approx(support[-1, 2], abs=1e-6)
    assert support[1:-1, 2].max() < support[0, 2]


def test_gait_curve_refuses_what_it_cannot_describe():
    with pytest.raises(NotSupportedError, match="one revolute actuator"):
        gait_curve(ParallelDrive())
    with pytest.raises(NotSupportedError, match="all the way round"):
        gait_curve(SixBar(coupler=1.9, rocker=1.4, rod=3.5))
    with pytest.raises(ValueRangeError, match="samples"):
        gait_curve(LEG, samples=7)
    with pytest.raises(ValueRangeError, match="same crank angles"):
        gait_curve(LEG).deviation(gait_curve(LEG, samples=100))
