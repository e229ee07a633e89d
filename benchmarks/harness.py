# SPDX-License-Identifier: Apache-2.0
"""What every entry measures with: timing, medians with p95, goals, rows of the table."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]

Unit = Literal["s", "Hz", "x", "%", "B", "count"]


class Timing(NamedTuple):
    """Durations of repeated runs, divided by the points of a run [s]."""

    median: float
    p95: float


@dataclass(frozen=True)
class Goal:
    """What a value should be.

    Attributes:
        limit: The goal, in the unit of its row.
        at_least: Whether the value should be as large as the limit, not as small.
        accepted: A weaker limit that still does; None if there is none.
    """

    limit: float
    at_least: bool = False
    accepted: float | None = None

    def verdict(self, value: float) -> Literal["pass", "accepted", "fail"]:
        """Return how a value compares with the goal; NaN fails."""
        if self._meets(value, self.limit):
            return "pass"
        if self.accepted is not None and self._meets(value, self.accepted):
            return "accepted"
        return "fail"

    def _meets(self, value: float, limit: float) -> bool:
        return value >= limit if self.at_least else value <= limit


@dataclass(frozen=True)
class Row:
    """One measured value.

    Attributes:
        what: What was measured; unique within its entry, since a comparison goes by it.
        value: The value, a median if it was measured repeatedly; NaN if it could not be.
        unit: Its SI unit, "x" for a ratio.
        p95: 95th percentile; None if there is none.
        goal: The goal, if one is set.
        note: What a reader must know to read the value.
    """

    what: str
    value: float
    unit: Unit = "s"
    p95: float | None = None
    goal: Goal | None = None
    note: str = ""

    @property
    def larger_is_better(self) -> bool:
        """Whether a larger value is better; a ratio without a goal is a speed-up."""
        return self.goal.at_least if self.goal else self.unit == "x"


@dataclass(frozen=True)
class Settings:
    """How long to measure.

    Attributes:
        quick: Whether to check that everything works rather than to measure well.
        soak: Duration of the stream entry [s].
        show: Tells the user what is going on.
    """

    quick: bool = False
    soak: float = 60.0
    show: Callable[[str], None] = lambda text: None

    @property
    def repeats(self) -> int:
        """Runs of each measurement."""
        return 7 if self.quick else 41

    @property
    def budget(self) -> float:
        """Time after which a slow measurement stops short of its repeats [s]."""
        return 0.5 if self.quick else 5.0

    @property
    def peer_points(self) -> int:
        """Points on which peers are checked and timed."""
        return 20 if self.quick else 200

    def count(self, full: int, quick: int) -> int:
        """Return a number of points, calls or repeats."""
        return quick if self.quick else full


SHORTEST_RUN = 1e-3  # shorter ones are repeated in a loop, for the clock [s]
FEWEST_RUNS = 3


def measure(
    function: Callable[[], Any], settings: Settings, points: int = 1, *, warm_up: bool = True
) -> Timing:
    """Time a function.

    Args:
        function: What to time.
        settings: How often.
        points: Points that one call handles; times are given per point.
        warm_up: Whether to call it once before; not needed if it is slow and warm already.
    """
    if warm_up:
        function()
    deadline = time.perf_counter() + settings.budget
    first = _duration(function, 1)
    loops = max(1, math.ceil(SHORTEST_RUN / max(first, 1e-9)))
    durations = [first] if loops == 1 else []
    while len(durations) < settings.repeats:
        durations.append(_duration(function, loops) / loops)
        if len(durations) >= FEWEST_RUNS and time.perf_counter() > deadline:
            break
    return summary(np.array(durations) / points)


def measure_beside(
    theirs: Callable[[Any], Any],
    inputs: Sequence[Any] | FloatArray,
    ours: Callable[[], Any],
    points: int,
    settings: Settings,
) -> tuple[Timing, Timing]:
    """Time a peer and the suite in turn, so that both meet the same disturbances.

    Args:
        theirs: The peer, which takes one point at a time.
        inputs: The points it is given.
        ours: The suite's function, warm.
        points: Points that one call of `ours` handles.
        settings: How often.

    Returns:
        Times per point of the peer and of the suite.
    """

    def over_all() -> None:
        for item in inputs:
            theirs(item)

    over_all()
    loops = max(1, math.ceil(SHORTEST_RUN / max(_duration(ours, 1), 1e-9)))
    deadline = time.perf_counter() + settings.budget
    durations: list[tuple[float, float]] = []
    while len(durations) < settings.repeats:
        durations.append((_duration(over_all, 1), _duration(ours, loops) / loops))
        if len(durations) >= FEWEST_RUNS and time.perf_counter() > deadline:
            break
    peer, suite = np.array(durations).T
    return summary(peer / len(inputs)), summary(suite / points)


def summary(durations: Sequence[float] | FloatArray) -> Timing:
    """Return median and p95 of durations."""
    median, p95 = np.percentile(durations, [50.0, 95.0])
    return Timing(float(median), float(p95))


def _duration(function: Callable[[], Any], loops: int) -> float:
    start = time.perf_counter()
    for _ in range(loops):
        function()
    return time.perf_counter() - start


def timed_row(what: str, timing: Timing, goal: Goal | None = None, note: str = "") -> Row:
    """Return the row of a timing."""
    return Row(what, timing.median, "s", timing.p95, goal, note)


def ratio_row(what: str, times: tuple[Timing, Timing], goal: Goal | None = None) -> Row:
    """Return how many times longer a peer takes than the suite, from runs taken in turn."""
    theirs, ours = times
    return Row(what, theirs.median / ours.median, "x", goal=goal)


def missing_row(what: str, reason: object) -> Row:
    """Return the row of what could not be measured here."""
    return Row(what, math.nan, "s", note=f"missing: {reason}")
