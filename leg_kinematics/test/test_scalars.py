# SPDX-License-Identifier: Apache-2.0
"""Scalar functions of kernels: as exact as the library's."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from leg_kinematics.kernels.scalars import LARGEST_ANGLE, arctan2, cosine_sine


@numba.njit(error_model="numpy")
def of_all(angles):
    result = np.empty((len(angles), 3))
    for i in range(len(angles)):
        c, s = cosine_sine(angles[i])
        result[i] = c, s, arctan2(s, c)
    return result


@pytest.mark.parametrize("largest", [1.0, 10.0, LARGEST_ANGLE])
def test_cosine_sine_and_arctan2_are_those_of_the_library_within_rounding(largest):
    angles = np.random.default_rng(0).uniform(-largest, largest, 100_000)
    cosine, sine, angle = of_all(angles).T
    np.testing.assert_allclose(cosine, np.cos(angles), rtol=0.0, atol=2.3e-16)
    np.testing.assert_allclose(sine, np.sin(angles), rtol=0.0, atol=2.3e-16)
    expected = np.arctan2(np.sin(angles), np.cos(angles))
    np.testing.assert_allclose(angle, expected, rtol=0.0, atol=1e-15)


def test_cosine_sine_of_whole_quarter_turns_and_of_no_angle():
    for quarter in range(-9, 10):
        expected = math.cos(0.5 * math.pi * quarter), math.sin(0.5 * math.pi * quarter)
        assert cosine_sine(0.5 * math.pi * quarter) == pytest.approx(expected, abs=2.3e-16)
    assert all(map(math.isnan, cosine_sine(math.nan)))
