# SPDX-License-Identifier: Apache-2.0
"""The designs node: geometry searches as an action.

It is no part of a walking robot's nodes: a search takes all the processor cores it is given.
"""

from __future__ import annotations

import itertools
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from leg_msgs.action import SearchGeometry
from leg_msgs_py.arrays import to_field

from leg_kinematics.description import load_robot
from leg_kinematics.documents import Document
from leg_kinematics.errors import DescriptionError
from leg_kinematics.files import exists, path_below
from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import RobotNode
from leg_statics.design.search.jobs import SearchJob
from leg_statics.design.search.report import winner_robot
from leg_statics.design.search.study import Study
from leg_statics.design.search.study_file import study_from_document
from leg_statics.design.search.workers import open_workers
from leg_statics.nodes.goal_queue import GoalQueue


@dataclass(frozen=True)
class _SearchWork:
    """A search that a goal has ordered."""

    study: Study
    folder: Path
    job: SearchJob

    def feedback(self) -> Any:
        """Return how far the search is."""
        progress = self.job.progress
        return SearchGeometry.Feedback(
            evaluated=progress.evaluated,
            total=progress.total,
            rate=progress.rate,
            elapsed=progress.elapsed,
            remaining=progress.remaining,
            objectives=list(self.study.objectives),
            best=to_field(progress.best),
        )

    def result(self) -> Any:
        """Return what was found, complete or not."""
        study, progress, outcome = self.study, self.job.progress, self.job.outcome
        designs = [entry.design for entry in outcome.front] if outcome else []
        count = len(study.objectives)
        result = SearchGeometry.Result(
            elapsed=progress.elapsed,
            folder=str(self.folder),
            evaluated=progress.evaluated,
            feasible=progress.feasible,
            parameters=[parameter.name for parameter in study.parameters],
            objectives=list(study.objectives),
            best_parameters=to_field(np.array([design.parameters for design in designs])),
            best_objectives=to_field(np.array([design.values[:count] for design in designs])),
            robot=winner_robot(outcome) if outcome else "",
        )
        if not self.job.complete:
            result.error.message = (
                f"cancelled by the caller after {progress.evaluated} of {progress.total} designs"
            )
        return result


class DesignsNode(RobotNode):
    """Searches for better dimensions of legs."""

    def __init__(self) -> None:
        super().__init__("designs")
        self.declare(
            "output_root",
            "~/.ros/geometry_searches",
            "Folder below which all results go.",
            read_only=True,
        )
        self.declare_number(
            "workers", 0, "Worker processes; 0 for one a processor core.", (0, 1024), read_only=True
        )
        self.declare(
            "scheduler",
            "",
            "Address of a Dask scheduler to use its workers instead; it can run any code here.",
            read_only=True,
        )
        self._queue = GoalQueue(
            self, SearchGeometry, "search_geometry", "searches", self._begin, self.failure
        )
        self.announce()

    def destroy_node(self) -> None:
        """End the search under way, then destroy the node."""
        self._queue.destroy()
        super().destroy_node()

    def _begin(self, request: Any, pool: ThreadPoolExecutor) -> _SearchWork:
        """Order the search of a goal.

        Raises:
            LegError: If it cannot be carried out.
        """
        document = Document(Path("study"), request.study)  # messages name the field
        study = study_from_document(document, self.value("robot"), self._find_base)
        folder = self._folder(request.folder or self._new_name(study))
        workers = partial(open_workers, self.value("workers") or None, self.value("scheduler"))
        return _SearchWork(study, folder, SearchJob(study, folder, workers, pool))

    def _find_base(self, source: str) -> Path:
        """Return the description of the robot that a study names.

        Raises:
            DescriptionError: If it cannot be used; the message tells nothing of its content.
        """
        path = self.find_robot(source)
        try:
            load_robot(path)
        except DescriptionError:
            raise DescriptionError(
                f"{source!r} is no robot description; load_robot tells why on the node's machine"
            ) from None
        return path

    def _folder(self, name: str) -> Path:
        """Return the folder for the results of a goal.

        Raises:
            DescriptionError: If it, or a file of earlier results in it, is not below `output_root`.
        """
        folder = path_below(self.value("output_root"), name)
        if folder.is_dir():
            for file in folder.iterdir():
                path_below(folder, file)
        return folder

    def _new_name(self, study: Study) -> str:
        stem = f"{study.name}_{time.strftime('%Y%m%d_%H%M%S')}"
        names = itertools.chain([stem], (f"{stem}_{k}" for k in itertools.count(2)))
        return next(name for name in names if not exists(self._folder(name)))


def main() -> int:
    """Run the node."""
    return run(DesignsNode)
