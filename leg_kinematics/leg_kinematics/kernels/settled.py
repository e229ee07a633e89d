# SPDX-License-Identifier: Apache-2.0
"""Two kernels for one question: a quick one, and a thorough one for the points it leaves open.

The quick kernel solves the common case in blocks, without branches, and marks what it leaves open.
The thorough one takes longer for a point, and its code longer to compile; it is called, and so
compiled, only if there is such a point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

UNCERTAIN = 254  # instead of a status or verdict: the quick kernel leaves this point open


def settled(
    results: tuple[Any, ...],
    uncertain: Any,
    thorough: Callable[..., Any],
    *inputs: tuple[Any, int],
) -> tuple[Any, ...]:
    """Return the results of a quick kernel, what it left open replaced by those of a thorough one.

    Args:
        results: Results of the quick kernel (..., any).
        uncertain: Which points it left open (...).
        thorough: The thorough kernel.
        *inputs: What it takes (..., any), and how many axes that of one point has.
    """
    if not uncertain.ndim:  # as points, so that the code for one is never compiled
        found = thorough(*[np.expand_dims(array, 0) for array, _ in inputs])
        return tuple(result[0] for result in found)
    chosen = [
        np.broadcast_to(array, uncertain.shape + array.shape[array.ndim - axes :])[uncertain]
        for array, axes in inputs
    ]
    for result, settled_points in zip(results, thorough(*chosen), strict=True):
        result[uncertain] = settled_points
    return results
