# SPDX-License-Identifier: Apache-2.0
"""Geometry search: designs a second by number of worker processes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from harness import Goal, Row, Settings

from leg_kinematics.documents import Document
from leg_statics.design.search.geometry_search import GeometrySearch
from leg_statics.design.search.study_file import study_from_document
from leg_statics.design.search.workers import LocalWorkers

PROCESSES = (1, 2)
STUDY = """\
version: 1
name: scaling
units: {length: mm, angle: deg}
base: {robot: hexapod, leg_type: initial}
parameters:
  drive_lever: {from: 100, to: 160}
  parallelogram_link: {from: 250, to: 350}
  shank_length: {from: 320, to: 520}
objectives: [condition_number, unit_effort_capacity, unit_moment_effort]
constraints:
  step_length: {min: 300}
conditions: {ground: cement, criterion: rated_friction}
method: {name: samples, designs: DESIGNS}
tolerance: 0.02
"""


def rows(settings: Settings) -> Iterator[Row]:
    """Yield designs a second for one process and for two."""
    count = settings.count(1000, 100)
    rates = {}
    for processes in PROCESSES:
        with LocalWorkers(processes) as workers:
            search(workers, 32 * processes)  # starts the processes and loads what they call
            rates[processes] = count / search(workers, count)
        yield Row(
            f"designs a second, {processes} {'process' if processes == 1 else 'processes'}",
            rates[processes],
            "Hz",
            note=f"{count} designs: three means to 2 %, step length, table on disk",
        )
    one, several = (rates[processes] for processes in PROCESSES)
    goal = None if settings.quick else Goal(1.6, at_least=True)
    yield Row("speed-up by the second process", several / one, "x", goal=goal)


def search(workers: LocalWorkers, count: int) -> float:
    """Return the time of a search in a new folder [s]."""
    study = study_from_document(Document(Path("study"), STUDY.replace("DESIGNS", str(count))))
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        GeometrySearch(study, Path(folder)).run(workers)
        return time.perf_counter() - started
