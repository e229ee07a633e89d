# SPDX-License-Identifier: Apache-2.0
"""A bound on how often something is done, which what comes regularly can meet."""

from __future__ import annotations

import math
from collections.abc import Hashable


class RateLimit:
    """Lets so many of a stream through a second on average.

    Who comes up to one period late may be followed as much earlier by the next: a stream of the
    very rate that is allowed passes whole, however its messages are jostled on their way.

    Args:
        most_streams: Streams that are remembered; beyond, all are forgotten.

    Attributes:
        rate: Greatest rate of each stream [Hz]; 0 = no limit.
    """

    def __init__(self, rate: float, most_streams: int = 1) -> None:
        self.rate = rate
        self._most_streams = most_streams
        self._passed: dict[Hashable, float] = {}

    def allows(self, now: float, stream: Hashable = None) -> bool:
        """Whether one more of a stream may pass at a time [s]; if so, it has passed."""
        period = 1.0 / self.rate if self.rate > 0.0 else 0.0
        due = self._passed.get(stream, -math.inf) + period
        if now < due:
            return False
        if len(self._passed) >= self._most_streams and stream not in self._passed:
            self._passed.clear()
        self._passed[stream] = max(due, now - period)
        return True
