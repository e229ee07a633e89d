# SPDX-License-Identifier: Apache-2.0
"""What a new process waits for: imports, cached machine code, or the compiler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from harness import Goal, Row, Settings, summary, timed_row

CHILDREN = Path(__file__).resolve().parent.parent / "children"


def rows(settings: Settings) -> Iterator[Row]:
    """Yield times of fresh processes."""
    times_of("first_answer")  # fills the cache
    repeats = settings.count(9, 3)
    bare = [bare_python() for _ in range(repeats)]
    warm = [times_of("first_answer") for _ in range(repeats)]
    node = [times_of("import_node") for _ in range(repeats)]
    yield timed_row("python alone", summary(bare), note="for comparison; not part of the others")
    yield timed_row("import", summary([t["import"] for t in warm]), Goal(1.0), "warm cache")
    yield timed_row("import of a node", summary([t["import"] for t in node]), Goal(1.0), "with ROS")
    yield timed_row(
        "import to first answer", summary([t["answer"] for t in warm]), note="warm cache"
    )
    settings.show("compiling everything")
    with tempfile.TemporaryDirectory() as folder:
        cold = times_of("first_answer", folder)
    yield Row("import to first answer, cold", cold["answer"], note="everything is compiled, once")


def times_of(child: str, cache: str | None = None) -> dict[str, float]:
    """Return what a fresh process measures, with a cache folder of its own if one is given."""
    environment = {**os.environ, **({"NUMBA_CACHE_DIR": cache} if cache else {})}
    answer = subprocess.run(
        [sys.executable, CHILDREN / f"{child}.py"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    times: dict[str, float] = json.loads(answer.stdout)
    return times


def bare_python() -> float:
    """Return how long Python takes to start and end."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", "pass"], check=True)
    return time.perf_counter() - start
