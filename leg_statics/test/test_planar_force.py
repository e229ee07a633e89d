# SPDX-License-Identifier: Apache-2.0
"""`force_transmission` against singular values and the closed form of the double rhombus leg."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leg_kinematics.errors import ShapeError
from leg_kinematics.mechanisms.double_rhombus import DoubleRhombus
from leg_statics.planar_force import force_transmission


def planar_jacobian(phi, radius):
    """G_V of the default leg at swing phi [rad] and OI = radius [m]."""
    leg = DoubleRhombus()
    feet = np.stack([-radius * np.sin(phi), 0.0 * phi, -radius * np.cos(phi)], axis=-1)
    return leg.planar_jacobian(leg.inverse(feet))


def test_indices_are_the_inverse_singular_values():
    jacobian = np.random.default_rng(1).normal(size=(100_000, 2, 2))
    k_f, k_j, q = force_transmission(jacobian)
    _, sigma, vt = np.linalg.svd(jacobian)
    np.testing.assert_allclose(k_f * sigma[:, 1], 1.0, rtol=1e-9)
    np.testing.assert_allclose(k_j, 1.0 - sigma[:, 1] / sigma[:, 0], atol=1e-12)
    clear = k_j > 1e-3
    np.testing.assert_allclose(np.abs(np.sum(q * vt[:, 1], axis=-1))[clear], 1.0, atol=1e-9)


def test_the_driving_vector_exerts_the_largest_force_downwards():
    jacobian = np.random.default_rng(2).normal(size=(1000, 2, 2))
    k_f, _, q = force_transmission(jacobian)
    force = np.linalg.solve(np.swapaxes(jacobian, -1, -2), q[..., None])[..., 0]
    np.testing.assert_allclose(np.linalg.norm(force, axis=-1), k_f)
    assert np.all(force[:, 1] <= 0.0)


def test_a_singular_jacobian_has_infinite_force_and_full_imbalance():
    k_f, k_j, q = force_transmission([[1.0, 2.0], [2.0, 4.0]])
    assert (k_f, k_j) == (np.inf, 1.0)
    np.testing.assert_allclose(np.abs(q), np.array([2.0, 1.0]) / np.sqrt(5.0))


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, (3, 2, 2), elements=st.floats(width=64)))
def test_takes_any_floats(jacobian):
    k_f, k_j, q = force_transmission(jacobian)
    assert k_f.shape == k_j.shape == (3,)
    assert q.shape == (3, 2)
    assert np.all(np.isnan(k_f) | (k_f >= 0.0))


def test_a_wrong_shape_names_the_argument():
    with pytest.raises(ShapeError, match="jacobian"):
        force_transmission(np.eye(3))


def test_square_of_the_force_matrix_has_a_closed_form():
    """NᵀN = [[Lb², -cos 2theta La Lb], [., La²]] / (2 l sin 2theta)²."""
    rng = np.random.default_rng(3)
    phi, radius = rng.uniform(-0.5, 0.5, 1000), rng.uniform(0.5, 0.95, 1000)
    n = np.swapaxes(np.linalg.inv(planar_jacobian(phi, radius)), -1, -2)
    theta = np.arccos(radius / (4 * 0.260))
    psi = 1.5 * np.pi - phi
    a = 0.045 * np.exp(1j * (psi - theta - np.radians(121.33)))
    d = 0.045 * np.exp(1j * (psi + theta - np.radians(15.0)))
    b = 0.305 + 0.240 * np.exp(1j * np.radians(105.0))
    lb = -np.real(1j * a * np.conj(b - a)) / np.abs(b - a)
    la = -np.real(1j * d * np.conj(0.305 - d)) / np.abs(0.305 - d)
    coupling = -np.cos(2 * theta) * la * lb
    closed = np.array([[lb**2, coupling], [coupling, la**2]]) / (0.52 * np.sin(2 * theta)) ** 2
    np.testing.assert_allclose(np.swapaxes(n, -1, -2) @ n, np.moveaxis(closed, -1, 0), atol=1e-12)
