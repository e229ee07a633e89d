# SPDX-License-Identifier: Apache-2.0
"""The ground of the view: heights and normals of its triangles, and where one looks at it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leg_kinematics.errors import UnknownNameError
from leg_statics.view.terrain import SHAPES, make_terrain

ROUGH = make_terrain("rough", 2.0, 0.7)
inside = st.floats(-1.9, 1.9)


@given(inside, inside)
def test_heights_are_those_of_the_triangle_around_a_point(x, y):
    vertices, faces = ROUGH.triangles()
    corners = vertices[faces]
    # barycentric coordinates of the point in every triangle
    edges = np.swapaxes(corners[:, 1:, :2] - corners[:, :1, :2], -1, -2)
    shares = np.linalg.solve(edges, (np.array([x, y]) - corners[:, 0, :2])[..., None])[..., 0]
    around = np.flatnonzero((shares >= -1e-12).all(axis=1) & (shares.sum(axis=1) <= 1.0 + 1e-12))
    a, b, c = corners[around[0]]
    height = a[2] + shares[around[0]] @ [b[2] - a[2], c[2] - a[2]]
    assert ROUGH.height([x, y]) == pytest.approx(height, abs=1e-12)
    normal = ROUGH.normal([x, y])
    assert any(
        abs(normal @ (corners[k, 1] - corners[k, 0])) < 1e-12
        and abs(normal @ (corners[k, 2] - corners[k, 0])) < 1e-12
        for k in around
    )
    assert normal[2] > 0.0
    assert np.linalg.norm(normal) == pytest.approx(1.0)


@given(inside, inside, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_line_of_sight_from_above_meets_the_ground_where_it_is_aimed_at(x, y, ahead, aside):
    aim = ROUGH.on_ground([x, y])
    eye = aim + np.array([2.0 * ahead, 2.0 * aside, 3.0])  # steeper than the ground is anywhere
    assert ROUGH.seen(eye, aim - eye) == pytest.approx(aim, abs=1e-6)


def test_who_looks_up_or_aside_sees_no_ground():
    assert ROUGH.seen([0.0, 0.0, 1.0], [0.1, 0.0, 1.0]) is None
    assert ROUGH.seen([5.0, 0.0, 1.0], [0.0, 1.0, -0.1]) is None


@pytest.mark.parametrize("name", SHAPES)
def test_terrains_grow_with_the_robot(name):
    small, large = (make_terrain(name, 3.0 * unit, unit) for unit in (0.1, 1.0))
    assert large.z == pytest.approx(10.0 * small.z)
    assert np.ptp(large.z) <= 1.6


def test_a_terrain_that_is_not_known_is_told_with_those_that_are():
    with pytest.raises(UnknownNameError, match=r"swamp.*level.*rough"):
        make_terrain("swamp", 1.0, 1.0)
