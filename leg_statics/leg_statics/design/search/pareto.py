# SPDX-License-Identifier: Apache-2.0
"""The Pareto front of a stream of designs."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array

Entry = TypeVar("Entry")


class ParetoFront(Generic[Entry]):
    """The entries that no other beats: none is as good in every cost and better in one.

    Of entries with the same costs the first one stays.

    Args:
        count: Number of costs of an entry; less is better.

    Attributes:
        entries: The entries of the front, the first cost ascending.
    """

    def __init__(self, count: int) -> None:
        self.entries: list[Entry] = []
        self._costs: FloatArray = np.empty((0, count))

    @property
    def costs(self) -> FloatArray:
        """Costs of the entries (M, count)."""
        return self._costs

    def add(self, costs: ArrayLike, entry: Entry) -> bool:
        """Take up an entry unless another beats it; return whether it was taken up."""
        new = as_array("costs", costs, self._costs.shape[1])
        if np.any(np.all(self._costs <= new, axis=1)):
            return False
        stays = ~np.all(new <= self._costs, axis=1)
        if not stays.all():
            self._costs = self._costs[stays]
            self.entries = [e for e, stay in zip(self.entries, stays, strict=True) if stay]
        place = int(np.searchsorted(self._costs[:, 0], new[0]))
        self._costs = np.insert(self._costs, place, new, axis=0)
        self.entries.insert(place, entry)
        return True
