# SPDX-License-Identifier: Apache-2.0
"""Geometry searches as jobs in a thread, with progress and cancellation."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from leg_statics.design.search.geometry_search import GeometrySearch, Outcome, Progress
from leg_statics.design.search.report import write_results
from leg_statics.design.search.study import Study
from leg_statics.design.search.workers import Workers


class SearchJob:
    """A search that runs in a thread and leaves its results in a folder.

    Args:
        study: What to search for.
        folder: Where the results go.
        open_workers: Starts the workers, when it is this job's turn.
        pool: Where the thread comes from.

    Attributes:
        outcome: What was found; None before the end.
    """

    def __init__(
        self,
        study: Study,
        folder: Path,
        open_workers: Callable[[], Workers],
        pool: ThreadPoolExecutor,
    ) -> None:
        self.outcome: Outcome | None = None
        self._folder = folder
        self._open_workers = open_workers
        self._search = GeometrySearch(study, folder)
        self._future: Future[None] = pool.submit(self._run)

    @property
    def over(self) -> bool:
        """Whether the job has ended, one way or another."""
        return self._future.done()

    @property
    def complete(self) -> bool:
        """Whether the whole search is done."""
        return self.over and self.outcome is not None and self.outcome.complete

    @property
    def progress(self) -> Progress:
        """How far the job is."""
        return self.outcome.progress if self.outcome else self._search.progress

    def cancel(self) -> None:
        """End after the designs that are being evaluated."""
        self._search.stop()
        self._future.cancel()

    def check(self) -> None:
        """Raise what the search raised, if it did."""
        if not self._future.cancelled():
            self._future.result()

    def _run(self) -> None:
        with self._open_workers() as workers:
            self.outcome = self._search.run(workers)
        write_results(self.outcome, self._folder)
