# SPDX-License-Identifier: Apache-2.0
"""Index maps: what they hold at a point is what the point itself gives."""

from __future__ import annotations

import numpy as np
import pytest

from leg_kinematics import Leg, Status, UnknownNameError, ValueRangeError
from leg_kinematics.mirrored import Mirrored
from leg_statics.footholds import Contact, evaluate_footholds
from leg_statics.indices import evaluate_indices, supported_indices
from leg_statics.maps import line_map, plane_map, supported_layers, volume_map
from leg_statics.published.paper_000 import legs

MECHANISM = legs()["optimised"]
LEG = Leg.of(MECHANISM, (-60.0, 60.0))
CONTACT = Contact(0.4)


def test_a_plane_holds_the_indices_of_its_points():
    plane = plane_map(LEG, -0.6, 0.02, contact=CONTACT)
    assert plane.layers == supported_layers(MECHANISM)
    assert plane.values.shape == (len(plane.y), len(plane.x), len(plane.layers))
    rng = np.random.default_rng(0)
    for _ in range(50):
        i, k = rng.integers(len(plane.y)), rng.integers(len(plane.x))
        point = [plane.x[k], plane.y[i], -0.6]
        posture = MECHANISM.inverse(point)
        assert plane.status[i, k] == posture.status
        _, values = evaluate_indices(MECHANISM, posture)
        np.testing.assert_array_equal(plane.values[i, k, :-1], values)
        footholds = evaluate_footholds(LEG, point, CONTACT)
        np.testing.assert_allclose(
            plane.layer("load_capacity")[i, k], footholds.load_capacity, rtol=1e-12
        )


def test_a_map_is_nan_outside_the_workspace_and_only_there():
    plane = plane_map(LEG, -0.6, 0.01)
    inside = plane.status == Status.OK
    assert 0.1 < inside.mean() < 0.9
    assert np.isfinite(plane.values[inside]).all()
    assert np.isnan(plane.values[~inside]).all()
    edge = np.concatenate([inside[0], inside[-1], inside[:, 0], inside[:, -1]])
    assert not edge.any()  # the frame leaves a margin around the workspace


def test_the_grid_is_regular_and_contains_the_axis():
    plane = plane_map(LEG, -0.6, 0.01)
    for axis in (plane.x, plane.y):
        np.testing.assert_allclose(np.diff(axis), 0.01)
    assert np.min(np.abs(plane.y)) == 0.0
    k = plane.layer("condition_number")
    np.testing.assert_allclose(k, k[::-1], rtol=1e-9)  # symmetric in y


def test_a_volume_is_filled_plane_by_plane():
    planes = list(volume_map(LEG, 0.05, layers=["condition_number", "unit_moment_effort"]))
    whole = planes[-1]
    assert len(planes) == len(whole.height)
    for k in (0, len(whole.height) // 2, len(whole.height) - 1):
        plane = plane_map(LEG, whole.height[k], 0.05, layers=whole.layers)
        np.testing.assert_array_equal(whole.values[k], plane.values)
        np.testing.assert_array_equal(whole.status[k], plane.status)
    first = next(volume_map(LEG, 0.05))
    assert np.isnan(first.values[1:]).all()


def test_a_line_holds_what_the_plane_through_it_does():
    plane = plane_map(LEG, -0.6, 0.01)
    k = int(np.argmin(np.abs(plane.y - 0.05)))
    line = line_map(LEG, plane.y[k], -0.6, 0.01)
    np.testing.assert_array_equal(line.x, plane.x)
    np.testing.assert_array_equal(line.values[0], plane.values[k])
    np.testing.assert_array_equal(line.status[0], plane.status[k])
    with pytest.raises(ValueRangeError, match="must be finite"):
        line_map(LEG, np.nan, -0.6, 0.01)


def test_a_mirrored_leg_has_the_mirrored_map():
    a, b = plane_map(LEG, -0.6, 0.02), plane_map(Leg.of(Mirrored(MECHANISM)), -0.6, 0.02)
    np.testing.assert_allclose(a.values, b.values[::-1], rtol=1e-9)


def test_layers_are_chosen_by_name():
    plane = plane_map(LEG, -0.6, 0.05, layers=["rated_friction"])
    assert plane.layers == ("rated_friction",)
    assert (plane.symbols, plane.units) == (("mu_e",), ("1",))
    assert plane_map(LEG, -0.6, 0.05).layers == supported_indices(MECHANISM)
    with pytest.raises(UnknownNameError, match="stiffness"):
        plane_map(LEG, -0.6, 0.05, layers=["stiffness"])
    with pytest.raises(UnknownNameError, match="stiffness"):
        plane.layer("stiffness")
    with pytest.raises(ValueRangeError, match="contact"):
        plane_map(LEG, -0.6, 0.05, layers=["load_capacity"])


@pytest.mark.parametrize("resolution", [0.0, -0.01, np.nan, np.inf, 1e-6])
def test_a_bad_resolution_is_refused(resolution):
    with pytest.raises(ValueRangeError, match="resolution"):
        plane_map(LEG, -0.6, resolution)
    with pytest.raises(ValueRangeError, match="resolution"):
        next(volume_map(LEG, resolution))


def test_a_plane_may_be_finer_than_the_volume():
    with pytest.raises(ValueRangeError, match="points"):
        next(volume_map(LEG, 0.002))
    assert plane_map(LEG, -0.6, 0.002, layers=["condition_number"]).values.size > 100_000


def test_a_bad_height_is_refused():
    with pytest.raises(ValueRangeError, match="height"):
        plane_map(LEG, np.nan, 0.05)
