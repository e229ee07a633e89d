# SPDX-License-Identifier: Apache-2.0
"""Blocks of points: what lets the compiler compute several points with one instruction.

A kernel that runs over points copies them, a block at a time, into the rows of an array: row k
of a block holds number k of each point. The loop over a block then reads and writes nothing but
rows of one array of known shape, so the compiler sees that no point depends on another:

    block = np.empty((ROWS, BLOCK))
    for start in range(0, len(points), BLOCK):
        end = min(start + BLOCK, len(points))
        load(block, X, points, start, end, 3)
        for i in range(end - start):
            block[Y, i] = formula(block[X, i])    # without branches, see `inlined`
        store(block, Y, results, start, end, 1)
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from leg_kinematics.kernels.kernel import inlined

BLOCK = 64  # points; some fifty rows then fit into the first cache


@inlined
def put(block, row, point, values):
    """Write numbers of a point below each other, from `row` on."""
    for k in range(len(values)):
        block[row + k, point] = values[k]


@inlined
def get3(block, row, point):
    """Return three numbers of a point that stand below each other, from `row` on."""
    return block[row, point], block[row + 1, point], block[row + 2, point]


@inlined
def load(block, row, points, start, end, width):
    """Copy numbers of points start to end of an array (m, width) into rows of a block.

    What is the same for all points is copied with the first block only.
    """
    if start == 0 or points.strides[0] != 0:
        for i in range(end - start):
            for k in range(width):
                block[row + k, i] = points[start + i, k]


@inlined
def load_numbers(block, row, points, start, end):
    """Copy one number of each point (m,) into a row of a block; see `load`."""
    if start == 0 or points.strides[0] != 0:
        for i in range(end - start):
            block[row, i] = points[start + i]


@inlined
def load_columns(block, row, points, start, end, columns):
    """Copy matrices (m, 3, columns) into rows of a block, column below column; see `load`."""
    for i in range(end - start):
        for column in range(columns):
            for r in range(3):
                block[row + 3 * column + r, i] = points[start + i, r, column]


@inlined
def store(block, row, points, start, end, width):
    """Copy rows of a block to points start to end of an array (m, width)."""
    for i in range(end - start):
        for k in range(width):
            points[start + i, k] = block[row + k, i]


@inlined
def store_columns(block, row, points, start, end, columns):
    """Copy rows of a block, column below column, to matrices (m, 3, columns)."""
    for i in range(end - start):
        for column in range(columns):
            for r in range(3):
                points[start + i, r, column] = block[row + 3 * column + r, i]
