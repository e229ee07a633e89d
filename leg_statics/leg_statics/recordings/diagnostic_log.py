# SPDX-License-Identifier: Apache-2.0
"""Diagnostics in a recording, told in a few lines whatever their number."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
LEVELS = ("OK", "WARN", "ERROR", "STALE")  # by their number in diagnostic_msgs/DiagnosticStatus
MOST_STATUSES = 200  # that are remembered; names beyond it are counted only
MOST_VALUES = 50  # of a status


@dataclass
class StatusHistory:
    """What a component told of itself.

    Attributes:
        levels: How often it told which level.
        worst: The worst level it told.
        since: When it told that level first [ns].
        complaint: The message that came with it.
        last: The last message.
        values: The last values by key.
    """

    levels: Counter[int] = field(default_factory=Counter)
    worst: int = -1
    since: int = 0
    complaint: str = ""
    last: str = ""
    values: dict[str, str] = field(default_factory=dict)

    def add(self, time: int, status: Any) -> None:
        """Take up a diagnostic_msgs/DiagnosticStatus recorded at a time [ns]."""
        level = int(status.level)
        self.levels[level] += 1
        if level > self.worst:
            self.worst, self.since, self.complaint = level, time, status.message
        self.last = status.message
        for value in status.values:
            if value.key in self.values or len(self.values) < MOST_VALUES:
                self.values[value.key] = value.value


class DiagnosticLog:
    """Histories of all components.

    Attributes:
        statuses: Histories by the components' names.
        others: Statuses of components that are not remembered.
    """

    def __init__(self) -> None:
        self.statuses: dict[str, StatusHistory] = {}
        self.others = 0

    def add(self, time: int, array: Any) -> None:
        """Take up a diagnostic_msgs/DiagnosticArray recorded at a time [ns]."""
        for status in array.status:
            if status.name not in self.statuses and len(self.statuses) >= MOST_STATUSES:
                self.others += 1
                continue
            self.statuses.setdefault(status.name, StatusHistory()).add(time, status)


def level_name(level: int) -> str:
    """Return the name of a level."""
    return LEVELS[level] if 0 <= level < len(LEVELS) else str(level)
