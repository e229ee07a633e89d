# SPDX-License-Identifier: Apache-2.0
"""Clouds in and out."""

import array

import numpy as np
import pytest
from leg_msgs_py.clouds import from_cloud, to_cloud
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

POINTS = np.array([[0.5, -1.0, 2.0], [0.25, 0.0, -3.0]])


def test_points_and_values_come_back():
    values = {"load": [1.0, np.nan], "mu": [0.5, np.inf]}
    cloud = to_cloud(Header(frame_id="leg"), POINTS, values)
    assert (cloud.width, cloud.height, cloud.point_step) == (2, 1, 20)
    assert cloud.header.frame_id == "leg"
    assert cloud.is_dense
    points, fields = from_cloud(cloud)
    np.testing.assert_array_equal(points, POINTS)
    assert list(fields) == ["load", "mu"]
    for name, column in values.items():
        np.testing.assert_array_equal(fields[name], column)


def test_an_empty_cloud_keeps_its_fields():
    points, fields = from_cloud(to_cloud(Header(), np.empty((0, 3)), {"mu": []}))
    assert points.shape == (0, 3)
    assert fields["mu"].shape == (0,)


@pytest.mark.parametrize("bigendian", [False, True])
def test_a_foreign_cloud_with_padding_rows_and_other_types_is_read(bigendian):
    order = ">" if bigendian else "<"
    kind = np.dtype(
        {
            "names": ["x", "y", "z", "ring", "rgb"],
            "formats": [
                order + "f8",
                order + "f4",
                order + "f4",
                order + "u2",
                (order + "u4", (2,)),
            ],
            "offsets": [0, 8, 12, 20, 24],
            "itemsize": 40,
        }
    )
    table = np.zeros((2, 3), kind)
    table["x"] = np.arange(6.0).reshape(2, 3)
    table["ring"] = 700
    padded = b"".join(row.tobytes() + b"\0" * 8 for row in table)
    types = (PointField.FLOAT64, PointField.FLOAT32, PointField.FLOAT32, PointField.UINT16)
    fields = [
        PointField(name=name, offset=offset, datatype=datatype, count=count)
        for name, offset, datatype, count in zip(
            kind.names,
            [0, 8, 12, 20, 24],
            [*types, PointField.UINT32],
            [1, 1, 1, 1, 2],
            strict=True,
        )
    ]
    cloud = PointCloud2(
        height=2, width=3, fields=fields, is_bigendian=bigendian, point_step=40, row_step=128,
        data=array.array("B", padded),
    )  # fmt: skip
    points, values = from_cloud(cloud)
    np.testing.assert_array_equal(points[:, 0], np.arange(6.0))
    np.testing.assert_array_equal(values["ring"], [700] * 6)
    assert values["rgb"].shape == (6, 2)


def test_a_cloud_without_points_in_space_is_refused():
    with pytest.raises(ValueError, match="no field x, y, z"):
        from_cloud(PointCloud2(height=1, width=0, point_step=4))
