# SPDX-License-Identifier: Apache-2.0
"""Arrays: checks of arguments, one place for the shape rule of the suite, and angles.

Every public function takes arrays with any leading batch axes; only the trailing axes are fixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from leg_kinematics.errors import ShapeError, ValueRangeError

FloatArray = NDArray[np.floating[Any]]
StatusArray = NDArray[np.uint8]


def as_array(name: str, value: ArrayLike, *trailing: int) -> FloatArray:
    """Return `value` as a float64 array whose trailing axes have the given lengths.

    Args:
        name: Name of the argument for the error message.
        value: Array-like of shape (..., *trailing).
        *trailing: Required lengths of the last axes; none for any shape.

    Raises:
        ShapeError: If it is not numeric or its trailing axes differ.
    """
    try:
        array: FloatArray = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ShapeError(f"{name} must be an array of numbers: {error}") from None
    shape = array.shape
    if shape != trailing and shape[len(shape) - len(trailing) :] != trailing:  # one point first
        wanted = ", ".join(["...", *map(str, trailing)])
        raise ShapeError(f"{name} must have shape ({wanted}), got {array.shape}")
    return array


def as_vectors(name: str, value: ArrayLike, length: int) -> FloatArray:
    """Return `value`, vectors (..., length) or one number for all their elements, as an array.

    Raises:
        ShapeError: If it is not numeric or has another length.
    """
    array = as_array(name, value)
    return array.repeat(length) if array.ndim == 0 else as_array(name, array, length)


def as_matching(name: str, value: ArrayLike, trailing: tuple[int, ...], batch: Any) -> FloatArray:
    """Return `value` as an array of shape (..., *trailing) that broadcasts with `batch`.

    Args:
        name: Name of the argument for the error message.
        value: Array-like of shape (..., *trailing).
        trailing: Required lengths of the last axes.
        batch: Leading shape that it has to broadcast with.

    Raises:
        ShapeError: If the trailing axes differ or the leading ones do not broadcast.
    """
    array = as_array(name, value, *trailing)
    leading = array.shape[: array.ndim - len(trailing)]
    if not leading or leading == batch:
        return array
    try:
        np.broadcast_shapes(leading, batch)
    except ValueError:
        raise ShapeError(
            f"{name} has leading shape {leading}, which does not broadcast with {tuple(batch)}"
        ) from None
    return array


def common_batch(shapes: Iterable[tuple[int, ...]]) -> tuple[int, ...]:
    """Return the shape to which shapes broadcast; quickly if at most one is not ().

    Raises:
        ValueError: If they do not broadcast.
    """
    different = set(shapes)
    different.discard(())
    if len(different) > 1:
        return np.broadcast_shapes(*different)
    return different.pop() if different else ()


def has_code(codes: Any, code: int) -> bool:
    """Tell whether a code is among those of points (...); `np.any` takes ten times as long."""
    return code in codes.tobytes() if codes.ndim else bool(codes == code)


def broadcast_error(shapes: Mapping[str, tuple[int, ...]]) -> ShapeError:
    """Return the error that tells which leading shapes do not broadcast, by argument name."""
    batch: tuple[int, ...] = ()
    for name, shape in shapes.items():
        try:
            batch = np.broadcast_shapes(batch, shape)
        except ValueError:
            return ShapeError(
                f"{name} has leading shape {shape}, which does not broadcast with {batch}"
            )
    return ShapeError(f"leading shapes do not broadcast: {dict(shapes)}")


def as_non_negative(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as an array whose elements are all ≥ 0 (infinity is allowed).

    Raises:
        ShapeError: If it is not numeric.
        ValueRangeError: If an element is negative or NaN.
    """
    array = as_array(name, value)
    bad = ~(array >= 0.0)
    if np.any(bad):
        raise ValueRangeError(f"{name} must be >= 0, got {array[bad].flat[0]}")
    return array


def combined(vectors: FloatArray, rows: FloatArray) -> FloatArray:
    """Return vectors (..., 3) times a matrix of rows (3, 3), one or many by the same bits.

    A product of matrices adds up in an order of its own for each number of vectors.
    """
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([x * a + y * b + z * c for a, b, c in rows.T.tolist()], axis=-1)


def wrapped_angles(angles: ArrayLike) -> FloatArray:
    """Return the angles (...) in [-pi, pi) that differ by whole turns [rad]."""
    array = np.asarray(angles, np.float64)
    turns = np.floor(array / (2.0 * np.pi) + 0.5)
    return array - 2.0 * np.pi * turns
