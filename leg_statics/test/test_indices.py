# SPDX-License-Identifier: Apache-2.0
"""Indices against numpy's decompositions, brute force and the paper's statements."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics import (
    DoubleRhombus,
    Mirrored,
    NotSupportedError,
    ParallelDrive,
    ShapeError,
    Status,
    UnknownNameError,
)
from leg_statics import indices
from leg_statics.indices import INDICES, evaluate_indices, supported_indices

LEG = ParallelDrive()


@pytest.fixture(scope="module")
def postures():
    q = np.random.default_rng(1).uniform(-0.36, 0.36, (3000, 3))
    posture = LEG.forward(q)
    return LEG.forward(q[posture.status == Status.OK])


def conditioned(count, worst, seed=0):
    """Random matrices with condition numbers up to `worst`."""
    rng = np.random.default_rng(seed)
    u, v = (np.linalg.qr(rng.normal(size=(count, 3, 3)))[0] for _ in range(2))
    s = np.exp(rng.uniform(-np.log(worst) / 2, np.log(worst) / 2, (count, 3)))
    return u * s[:, None, :] @ v


@pytest.mark.parametrize("worst", [10.0, 1e6, 1e10])
def test_condition_number_equals_the_singular_values(worst):
    matrices = conditioned(2000, worst)
    singular = np.linalg.svd(matrices, compute_uv=False)
    truth = singular[:, 0] / singular[:, -1]
    error = np.abs(indices.condition_number(matrices) / truth - 1.0)
    # rounding the entries alone moves the smallest singular value by cond * eps
    assert np.all(error <= 1e-13 + 4e-16 * truth)


def test_condition_number_of_a_singular_matrix_is_infinite_and_of_nan_is_nan():
    singular = np.array([[1.0, 2, 3], [2, 4, 6], [0, 0, 1]])
    assert indices.condition_number(singular) > 1e15
    assert np.isinf(indices.condition_number(np.zeros((3, 3))))
    assert np.isnan(indices.condition_number(np.full((3, 3), np.nan)))
    assert indices.condition_number(np.eye(3)) == pytest.approx(1.0, abs=1e-15)


def test_condition_number_of_other_shapes_is_numpys():
    matrices = np.random.default_rng(0).normal(size=(50, 4, 4))
    np.testing.assert_allclose(indices.condition_number(matrices), np.linalg.cond(matrices))


def test_no_unit_effort_lifts_more_than_eta_cf(postures):
    j = LEG.jacobian(postures)
    eta = indices.unit_effort_capacity(j)
    tau = np.random.default_rng(3).normal(size=(2000, 3))
    tau /= np.linalg.norm(tau, axis=1, keepdims=True)
    force_z = np.einsum("nji,tj->nti", np.linalg.inv(j), tau)[..., 2]
    assert np.all(np.abs(force_z) <= eta[:, None] * (1 + 1e-12))
    assert np.all(np.abs(force_z).max(axis=1) > 0.98 * eta)


def test_rated_friction_is_the_slope_of_the_force_that_attains_eta_cf(postures):
    j = LEG.jacobian(postures)
    g = np.linalg.inv(j).swapaxes(-1, -2)  # F = J^-T tau, eigenvectors of G_z' G_z by (19)
    g_z = g * np.array([0.0, 0.0, 1.0])[:, None]
    values, vectors = np.linalg.eigh(g_z.swapaxes(-1, -2) @ g_z)
    force = np.einsum("nij,nj->ni", g, vectors[..., -1])
    np.testing.assert_allclose(indices.unit_effort_capacity(j), np.sqrt(values[:, -1]), rtol=1e-10)
    np.testing.assert_allclose(
        indices.rated_friction(j), np.abs(force[:, 0] / force[:, 2]), rtol=1e-8, atol=1e-10
    )
    np.testing.assert_allclose(
        indices.rated_friction_full(j),
        np.hypot(force[:, 0], force[:, 1]) / np.abs(force[:, 2]),
        rtol=1e-8,
        atol=1e-10,
    )


def test_constraint_force_index_is_one_everywhere(postures):
    jc = LEG.constraint_jacobian(postures)
    np.testing.assert_allclose(indices.constraint_force_index(jc), 1.0, atol=1e-12)
    assert np.all(np.linalg.matrix_rank(jc[..., :3]) == 2)


def test_constraint_wrenches_do_no_work_on_motions_of_the_platform(postures):
    """The rows of J_c vanish on every twist that the RU limb allows the platform at G."""
    linkage = LEG.linkage(postures)
    point = {n: linkage.points[:, i] for i, n in enumerate(linkage.names)}
    a = postures.closure[:, 0]
    y_axis = np.broadcast_to([0.0, 1.0, 0.0], point["G"].shape)
    across = np.stack([np.sin(a), 0 * a, -np.cos(a)], axis=-1)  # second axis of U3
    jc = LEG.constraint_jacobian(postures)
    for axis, through in ((y_axis, "R_D3"), (y_axis, "U3"), (across, "U3")):
        velocity = np.cross(axis, point["G"] - point[through])
        twist = np.concatenate([velocity, axis], axis=-1)
        power = np.einsum("nij,nj->ni", jc, twist)
        # the drive crank's own motion is not a constraint: it is allowed, so all three are
        np.testing.assert_allclose(power[:, :2], 0.0, atol=1e-12)


def test_evaluation_takes_names_from_the_registry(postures):
    names, values = evaluate_indices(LEG, postures)
    assert names == supported_indices(LEG)
    assert set(names) == set(INDICES) - {"planar_force", "planar_imbalance"}
    assert values.shape == (*postures.status.shape, len(names))
    assert np.isfinite(values).all()
    some, columns = evaluate_indices(LEG, postures, ["unit_moment_effort", "condition_number"])
    assert some == ("unit_moment_effort", "condition_number")
    for k, name in enumerate(some):
        np.testing.assert_array_equal(columns[:, k], values[:, names.index(name)])


def test_every_index_is_documented():
    for name, index in INDICES.items():
        assert index.name == name
        assert index.doc.endswith(".")
        assert index.symbol
        assert index.unit
        assert "paper" in index.equation
        assert index.better in ("low", "high")


def test_a_mirrored_leg_has_the_same_indices(postures):
    mirrored = Mirrored(LEG)
    foot = postures.foot_position
    _, values = evaluate_indices(LEG, LEG.inverse(foot))
    _, mirror = evaluate_indices(mirrored, mirrored.inverse(foot * [1, -1, 1]))
    np.testing.assert_allclose(mirror, values, rtol=1e-9)


def test_points_without_a_posture_have_nan_indices():
    _, values = evaluate_indices(LEG, LEG.inverse([[0.0, 0.0, 9.0], [np.nan, 0, 0], [0, 0, -0.75]]))
    assert np.isnan(values[:2]).all()
    assert np.isfinite(values[2]).all()


def test_unknown_and_unsupported_indices_are_refused(postures):
    with pytest.raises(UnknownNameError, match=r"manipulability.*condition_number"):
        evaluate_indices(LEG, postures, ["manipulability"])
    with pytest.raises(NotSupportedError, match=r"constraint_force.*double_rhombus.*planar_force"):
        evaluate_indices(DoubleRhombus(), postures, ["constraint_force"])
    with pytest.raises(ShapeError, match="jacobian"):
        indices.rated_friction(np.ones((3, 2)))


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, (4, 3, 3), elements=st.floats()))
def test_any_floats_are_taken(matrices):
    k = indices.condition_number(matrices)
    assert np.all((k >= 1.0 - 1e-9) | np.isnan(k))
    finite = np.isfinite(matrices).all(axis=(1, 2))
    assert not np.isnan(k[finite]).any()
    for values in (
        indices.unit_effort_capacity(matrices),
        indices.rated_friction(matrices),
        indices.rated_friction_full(matrices),
    ):
        assert np.all((values >= 0.0) | np.isnan(values))
