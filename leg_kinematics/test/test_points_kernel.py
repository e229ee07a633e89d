# SPDX-License-Identifier: Apache-2.0
"""Kernels over points: any leading axes, any memory, checked lengths, the types of the layout."""

from __future__ import annotations

import math
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from leg_kinematics.kernels.points_kernel import points_kernel


@points_kernel("(n),(points,n),(points)->(points),(points,n)", "f8 f8 f8 f8 f8")
def project(axis, points, factor, along, rest):
    for i in range(len(points)):
        along[i] = 0.0
        for k in range(len(axis)):
            along[i] += factor[i] * axis[k] * points[i, k]
        for k in range(len(axis)):
            rest[i, k] = points[i, k] - along[i] * axis[k]


@pytest.mark.parametrize(
    ("points", "factor", "batch"),
    [
        ((), (), ()),
        ((5,), (), (5,)),
        ((), (5,), (5,)),
        ((2, 3), (), (2, 3)),
        ((2, 1), (3,), (2, 3)),
        ((3,), (2, 1), (2, 3)),
        ((0,), (), (0,)),
        ((0, 4), (4,), (0, 4)),
    ],
)
def test_a_kernel_over_points_takes_and_gives_back_any_leading_axes(points, factor, batch):
    random = np.random.default_rng(0)
    axis = np.array([0.0, 0.6, 0.8])
    p, f = random.normal(size=(*points, 3)), random.normal(size=factor)
    along, rest = project(axis, p, f)
    assert np.shape(along) == batch
    assert np.shape(rest) == (*batch, 3)
    np.testing.assert_allclose(along, f * (p @ axis), atol=1e-15)
    np.testing.assert_allclose(rest, p - along[..., None] * axis, atol=1e-15)


def test_points_that_do_not_broadcast_are_refused():
    with pytest.raises(ValueError, match="broadcast"):
        project(np.ones(3), np.ones((2, 3)), np.ones(3))


@pytest.mark.filterwarnings("error")
def test_points_without_an_answer_do_not_warn():
    along, _ = project(np.ones(3), np.full((3, 3), np.inf), np.zeros(3))
    assert np.isnan(along).all()


def test_points_that_are_no_row_of_memory_are_read_as_they_are():
    points = np.arange(24.0).reshape(3, 8).T  # strided
    along, _ = project(np.array([0.0, 0.0, 1.0]), points[::2], np.array(1.0))
    np.testing.assert_array_equal(along, points[::2, 2])


def test_one_length_with_a_name_must_be_the_same_everywhere():
    with pytest.raises(ValueError, match="axis 1 of points must be n"):
        project(np.ones(3), np.ones((5, 2)), np.ones(5))
    with pytest.raises(ValueError, match="axis 1 of points must be n"):
        project(np.ones(2), np.ones(3), np.float64(1.0))


def test_a_number_of_the_layout_is_the_length():
    with pytest.raises(ValueError, match="axis 1 of points must be 2"):
        first_bits(np.ones((5, 3)))
    with pytest.raises(ValueError, match="axis 1 of points must be 2"):
        first_bits(np.ones(3))


@points_kernel("(points,2)->(points)", "f8 u1")
def first_bits(points, bits):
    for i in range(len(points)):
        bits[i] = 1 if points[i, 0] > 0.0 else 0


def test_a_single_result_is_no_tuple_and_has_its_type():
    assert first_bits(np.array([1.0, 0.0])) == 1
    assert type(first_bits(np.array([1.0, 0.0]))) is np.uint8
    bits = first_bits(np.array([[[1.0, 0.0], [-1.0, 0.0]]]))
    np.testing.assert_array_equal(bits, [[1, 0]])
    assert bits.dtype == np.uint8


def test_results_of_one_point_are_those_of_a_batch():
    random = np.random.default_rng(1)
    axis, points, factor = (
        random.normal(size=3),
        random.normal(size=(40, 3)),
        random.normal(size=40),
    )
    along, rest = project(axis, points, factor)
    for i in range(40):
        one_along, one_rest = project(axis, points[i], factor[i])
        assert one_along == along[i]
        np.testing.assert_array_equal(one_rest, rest[i])


@pytest.mark.parametrize("batch", [(), (4,), (2, 2)])
def test_arrays_that_are_read_only_or_at_an_odd_address_are_read(batch):
    points = np.ones((*batch, 3))
    odd = np.frombuffer(b"-" + points.tobytes(), offset=1).reshape(points.shape)
    assert not odd.flags.aligned
    assert not odd.flags.writeable
    along, _ = project(np.array([0.0, 0.0, 1.0]), odd, np.ones(()))
    np.testing.assert_array_equal(along, np.ones(batch))


@points_kernel("(points)->(points)", "f8 f8")
def slowly_one(starts, ends):
    for i in range(len(starts)):
        x = starts[i]
        for _ in range(1000):
            x = math.sqrt(x)
        ends[i] = x


def test_other_threads_go_on_while_a_batch_is_computed():
    slowly_one(np.ones(2))  # compiled
    pause = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        work = pool.submit(slowly_one, np.full(100_000, 2.0))  # at least 0.2 s
        ticks = 0
        while not work.done():
            ticks += 1
            pause.wait(1e-4)
        np.testing.assert_allclose(work.result(), 1.0)
    assert ticks > 10
