# SPDX-License-Identifier: Apache-2.0
"""Numpy arrays in and out of message fields, by buffer and never element by element.

A batch travels as a flat, row-major field: an array (..., k) becomes a field of k·N numbers.
"""

from __future__ import annotations

import array
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
StatusArray = NDArray[np.uint8]


def to_field(values: ArrayLike, dtype: Any = np.float64) -> array.array[Any]:
    """Return an array of any shape as the flat content of a sequence field.

    Args:
        values: Numbers of any shape; row-major order is kept, whatever the memory layout.
        dtype: Type of the field: float64, uint8 or int32.
    """
    numbers = np.asarray(values, dtype=dtype)
    return array.array(numbers.dtype.char, numbers.tobytes())


def from_field(field: Any, shape: Sequence[int] = (-1,), dtype: Any = np.float64) -> NDArray[Any]:
    """Return the content of a sequence field as an array, without copying.

    Args:
        field: A field of a received message (`array.array`), or any sequence of numbers.
        shape: Shape wanted; one axis may be -1.
        dtype: Type of the field: float64, uint8 or int32.

    Raises:
        ValueError: If the number of values does not fit the shape.
    """
    dtype = np.dtype(dtype)
    if isinstance(field, array.array) and field.typecode == dtype.char:
        flat: NDArray[Any] = np.frombuffer(field, dtype=dtype) if len(field) else np.empty(0, dtype)
    else:
        flat = np.asarray(field, dtype=dtype)
    if not flat.size and 0 in shape:  # numpy cannot tell the length of an axis -1
        shape = [0 if n == -1 else n for n in shape]
    return flat.reshape(tuple(shape))
