# SPDX-License-Identifier: Apache-2.0
"""What a node does and what goes wrong with it, counted for its diagnostics."""

from __future__ import annotations

import time
from collections import Counter
from typing import NamedTuple

OK, WARN, ERROR = range(3)  # levels of diagnostic_msgs/DiagnosticStatus


class Report(NamedTuple):
    """Health since the last report.

    Attributes:
        level: 0 for ok, 1 for a warning, 2 for an error.
        message: What is wrong, "ok" if nothing is.
        values: All values by name.
    """

    level: int
    message: str
    values: dict[str, str]


class Health:
    """Counts what a node does.

    Attributes:
        received: Messages of the input stream.
        figures: Numbers to tell that are no warnings, by name.
        notes: Conditions that last, such as a leg that is not updated, by what they concern.
    """

    def __init__(self) -> None:
        self.received = 0
        self.figures: dict[str, str] = {}
        self.notes: dict[str, str] = {}
        self._callbacks = 0
        self._refused: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._disordered: Counter[str] = Counter()
        self._faults = 0
        self._last_error = ""
        self._worst = 0.0
        self._begin_period()

    def timed(self) -> Stopwatch:
        """Measure a callback: `with health.timed():`."""
        return Stopwatch(self)

    def observe(self, seconds: float) -> None:
        """Count a callback and its duration."""
        self._callbacks += 1
        self._worst = max(self._worst, seconds)

    def refuse(self, source: str, reason: str) -> None:
        """Count an input that cannot be used."""
        self._refused[source] += 1
        self._last_error = f"{source}: {reason}"
        self._warning = f"refused input: {self._last_error}"

    def drop(self, source: str, reason: str, count: int = 1) -> None:
        """Count inputs that were lost on their way or left out."""
        self._dropped[source] += count
        self._last_error = f"{source}: {reason}"
        self._warning = f"dropped input: {self._last_error}"

    def disorder(self, source: str) -> None:
        """Count an input whose stamp is not after that of the one before."""
        self._disordered[source] += 1
        self._warning = f"{source}: stamps do not increase"

    def fault(self, source: str, reason: str) -> None:
        """Count a fault of the node itself."""
        self._faults += 1
        self._last_error = f"{source}: {reason}"
        self._fault = f"internal fault: {self._last_error}"

    def report(self) -> Report:
        """Return what there is to tell since the last report, and begin a new period."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        values = {
            "input rate [Hz]": f"{(self.received - self._received_before) / elapsed:.1f}",
            "worst callback latency [ms]": f"{1e3 * self._worst:.3f}",
            "callbacks": str(self._callbacks),
            **_counts("refused", self._refused),
            **_counts("dropped", self._dropped),
            **_counts("out of order", self._disordered),
            "internal faults": str(self._faults),
            **self.figures,
            **self.notes,
            "last error": self._last_error,
        }
        warning = self._warning or "; ".join(self.notes.values())
        level = ERROR if self._fault else WARN if warning else OK
        message = self._fault or warning or "ok"
        self._begin_period()
        return Report(level, message, values)

    def _begin_period(self) -> None:
        self._began = time.monotonic()
        self._received_before = self.received
        self._worst = 0.0
        self._warning = ""
        self._fault = ""


class Stopwatch:
    """Reports the duration of a block to a `Health`."""

    def __init__(self, health: Health) -> None:
        self._health = health

    def __enter__(self) -> None:
        self._start = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._health.observe(time.perf_counter() - self._start)


def _counts(kind: str, counter: Counter[str]) -> dict[str, str]:
    """Return the total of a counter and its parts by source."""
    parts = {f"{kind}: {source}": str(count) for source, count in counter.items()}
    return {f"{kind} inputs": str(counter.total()), **parts}
