# SPDX-License-Identifier: Apache-2.0
"""Conversions between numpy arrays and message fields."""

import array

import numpy as np
import pytest
from leg_msgs.msg import EffortLimits
from leg_msgs.srv import ComputeEfforts, InverseKinematics
from leg_msgs_py.arrays import from_field, to_field


@pytest.mark.parametrize("shape", [(), (1,), (7, 3), (2, 0, 3), (4, 3, 5)])
def test_a_round_trip_keeps_every_value(shape):
    values = np.random.default_rng(0).normal(size=shape)
    np.testing.assert_array_equal(from_field(to_field(values), shape), values)


@pytest.mark.parametrize(("dtype", "code"), [(np.float64, "d"), (np.uint8, "B"), (np.int32, "i")])
def test_fields_have_the_type_of_the_message(dtype, code):
    field = to_field([1, 2, 3], dtype)
    assert field.typecode == code
    assert from_field(field, dtype=dtype).dtype == dtype


def test_nan_and_infinity_survive():
    values = np.array([np.nan, np.inf, -np.inf, -0.0])
    back = from_field(to_field(values))
    np.testing.assert_array_equal(back, values)
    assert np.signbit(back[3])


@pytest.mark.parametrize(
    "view",
    [
        lambda a: a.T,
        lambda a: a[::2],
        lambda a: a[:, ::-1],
        lambda a: np.asfortranarray(a),
        lambda a: np.broadcast_to(a[0], a.shape),
    ],
    ids=["transposed", "strided", "reversed", "fortran", "broadcast"],
)
def test_any_memory_layout_is_sent_row_major(view):
    values = view(np.arange(24.0).reshape(8, 3))
    assert list(to_field(values)) == list(values.ravel(order="C"))


@pytest.mark.parametrize("values", [[[1, 2, 3]], np.arange(3, dtype=np.int64), np.float32([0.5])])
def test_other_number_types_are_converted(values):
    assert list(to_field(values)) == list(np.ravel(values).astype(float))


def test_reading_a_field_does_not_copy():
    field = array.array("d", range(6))
    rows = from_field(field, (-1, 3))
    field[4] = 99.0
    assert rows[1, 1] == 99.0


def test_reading_a_plain_sequence_works():
    np.testing.assert_array_equal(from_field([1.0, 2.0], (2, 1)), [[1.0], [2.0]])


@pytest.mark.parametrize("shape", [(-1, 3), (0, 3), (0, -1, 3), (-1,)])
def test_an_empty_field_has_an_empty_shape(shape):
    assert from_field(array.array("d"), shape).size == 0


def test_a_wrong_number_of_values_is_an_error():
    with pytest.raises(ValueError, match="reshape"):
        from_field(array.array("d", range(7)), (-1, 3))


def test_writing_takes_a_buffer_not_elements():
    values = np.zeros(300_000)
    field = to_field(values)
    request = InverseKinematics.Request(positions=field)
    assert request.positions.buffer_info()[1] == values.size


def test_fields_fit_every_message():
    response = ComputeEfforts.Response(
        joint_efforts=to_field(np.ones((2, 3))),
        limiting_joint=to_field([0, -1], np.int32),
        status=to_field([0, 5], np.uint8),
    )
    assert list(response.limiting_joint) == [0, -1]
    assert list(EffortLimits(lower=to_field([-1.5])).lower) == [-1.5]
