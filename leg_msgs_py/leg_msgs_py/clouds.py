# SPDX-License-Identifier: Apache-2.0
"""Numpy in and out of `sensor_msgs/PointCloud2`, by buffer and never point by point."""

from __future__ import annotations

import array
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2, PointField

AXES = ("x", "y", "z")
NUMBER_TYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}


def to_cloud(header: Any, positions: ArrayLike, values: Mapping[str, ArrayLike]) -> Any:
    """Return points with values as a cloud of float32 fields.

    Args:
        header: Frame and time.
        positions: Points (N, 3) [m]: the fields x, y, z.
        values: Further fields by name, (N,) each.
    """
    points = np.asarray(positions, dtype=np.float64)
    names = (*AXES, *values)
    columns = [*points.T, *(np.asarray(column) for column in values.values())]
    table = np.stack(columns, axis=-1).astype("<f4")
    return PointCloud2(
        header=header,
        height=1,
        width=len(table),
        fields=[
            PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
            for k, name in enumerate(names)
        ],
        is_bigendian=False,
        point_step=4 * len(names),
        row_step=table.nbytes,
        data=array.array("B", table.tobytes()),
        is_dense=bool(np.isfinite(points).all()),
    )


def from_cloud(cloud: Any) -> tuple[NDArray[np.float64], dict[str, NDArray[Any]]]:
    """Return the points of a cloud (N, 3) and its other fields by name, (N,) each.

    Args:
        cloud: A cloud with fields x, y, z; fields of several numbers a point are (N, count).

    Raises:
        ValueError: If it has no x, y, z, or too little data.
    """
    order = ">" if cloud.is_bigendian else "<"
    kind = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [
                (order + NUMBER_TYPES[field.datatype], (field.count,) if field.count > 1 else ())
                for field in cloud.fields
            ],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    missing = set(AXES) - set(kind.names or ())
    if missing:
        raise ValueError(f"the cloud has no field {', '.join(sorted(missing))}")
    rows = [
        np.frombuffer(cloud.data, kind, cloud.width, row * cloud.row_step)
        for row in range(cloud.height if cloud.width else 0)
    ]
    table = np.concatenate(rows) if rows else np.empty(0, kind)
    if order != ("<" if sys.byteorder == "little" else ">"):
        table = table.astype(kind.newbyteorder("="))
    points = np.stack([table[axis] for axis in AXES], axis=-1).astype(np.float64)
    return points, {name: table[name] for name in kind.names or () if name not in AXES}
