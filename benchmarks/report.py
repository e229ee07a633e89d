# SPDX-License-Identifier: Apache-2.0
"""Rows as a table and as JSON, and what a result must carry to be understood later."""

from __future__ import annotations

import math
import os
import platform
import subprocess
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from harness import Goal, Row, Unit
from rich.markup import escape
from rich.table import Table

PACKAGES = (
    *("numpy", "scipy", "numba", "ros-jazzy-rclpy"),
    *("clarabel", "highspy", "pycapacity", "pin", "pylinkage"),
)
SCALES = {
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")),
    "B": ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"), (1.0, "B")),
}
STYLES = {"pass": "green", "accepted": "yellow", "fail": "red", "": ""}


def results_table(title: str, rows: list[Row]) -> Table:
    """Return the rows of an entry as a table."""
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("measured", overflow="fold")
    for column in ("median", "p95", "goal", ""):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("note", overflow="fold")
    for row in rows:
        verdict = verdict_of(row)
        table.add_row(
            escape(row.what),
            text(row.value, row.unit),
            "" if row.p95 is None else text(row.p95, row.unit),
            goal_text(row.goal, row.unit),
            f"[{STYLES[verdict]}]{verdict}[/]" if verdict else "",
            escape(row.note),
        )
    return table


def verdict_of(row: Row) -> str:
    """Return how a row meets its goal; "" without one."""
    return row.goal.verdict(row.value) if row.goal else ""


def text(value: float, unit: Unit) -> str:
    """Return a value with three digits in a unit that suits its size."""
    if math.isnan(value):
        return "-"
    for scale, name in SCALES.get(unit, ()):
        if abs(value) >= scale:
            return f"{value / scale:.3g} {name}"
    if unit == "count":
        return f"{value:,.0f}"
    number = f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
    return f"{number} {unit}"


def goal_text(goal: Goal | None, unit: Unit) -> str:
    """Return a goal as "≤ 80 ns"."""
    if goal is None:
        return ""
    sign = "≥" if goal.at_least else "≤"
    accepted = f" ({sign} {text(goal.accepted, unit)})" if goal.accepted is not None else ""
    return f"{sign} {text(goal.limit, unit)}{accepted}"


def row_record(row: Row) -> dict[str, Any]:
    """Return a row for JSON; a value that could not be measured is null."""
    return {
        "what": row.what,
        "value": row.value if math.isfinite(row.value) else None,
        "unit": row.unit,
        "p95": row.p95,
        "goal": row.goal.limit if row.goal else None,
        "verdict": verdict_of(row) or None,
        "larger_is_better": row.larger_is_better,
        "note": row.note,
    }


def describe_machine() -> dict[str, Any]:
    """Return what the numbers depend on."""
    return {
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "commit": _commit(),
        "machine": {
            "cpu": _cpu(),
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "system": platform.platform(),
        },
        "versions": {
            "python": platform.python_version(),
            **{package: _version(package) for package in PACKAGES},
        },
    }


def _cpu() -> str:
    """Return the name of the processor."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Return the commit measured, with "+" if files differ from it; "" without one."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str:
        try:
            answer = subprocess.run(
                ["git", *arguments], cwd=here, capture_output=True, text=True, check=False
            )
        except OSError:
            return ""
        return answer.stdout.strip() if answer.returncode == 0 else ""

    commit = git("rev-parse", "--short", "HEAD")
    return commit + "+" if commit and git("status", "--porcelain") else commit


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
