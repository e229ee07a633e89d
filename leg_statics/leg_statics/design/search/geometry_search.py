# SPDX-License-Identifier: Apache-2.0
"""Geometry search: work a study off on many processes, and go on where it stopped.

The results are a table that only grows: its line i is the i-th design that the method drew. What a
method draws follows from the study and from the designs before, so a search that stopped, however
that happened, is resumed by running it again, with the designs of the table answered from it. For
the same reason the number of workers does not change the results.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.documents import Document
from leg_kinematics.errors import LegError
from leg_statics.design.search.design_table import Design, DesignTable
from leg_statics.design.search.methods import INFEASIBLE, METHODS, Trial
from leg_statics.design.search.pareto import ParetoFront
from leg_statics.design.search.study import DesignTask, Study
from leg_statics.design.search.workers import Workers

Entry = TypeVar("Entry")

# Files of a results folder; the last holds the friction of the ground that the study names.
TABLE, STUDY, ROBOT, GROUND = "designs.csv", "study.yaml", "robot.yaml", "ground.yaml"
CHUNK = 8  # designs that a worker is given at once
MOST_SAMPLED = 4000  # designs for the pictures
NUMBERS = re.compile(r"(?<!\w)-?\d[\d.e+-]*")


class SearchError(LegError):
    """A search cannot begin, or go on, in its folder."""


class Numbered(NamedTuple):
    """A design and its place in the table.

    Attributes:
        number: Its place, from 0.
        design: The design.
    """

    number: int
    design: Design


class Progress(NamedTuple):
    """How far a search is.

    Attributes:
        evaluated: Designs evaluated, those recalled from an earlier run included.
        recalled: Those recalled.
        total: Designs that the search will evaluate.
        feasible: Designs that keep all constraints.
        elapsed: Time since this run began [s].
        rate: Designs evaluated in a second by this run.
        remaining: Estimated time to the end [s]; NaN while it is not known.
        best: Best value of each objective (K,); NaN while there is none.
    """

    evaluated: int
    recalled: int
    total: int
    feasible: int
    elapsed: float
    rate: float
    remaining: float
    best: FloatArray


class Improvement(NamedTuple):
    """A moment at which the best score rose.

    Attributes:
        evaluated: Designs evaluated by then.
        score: The new best score.
    """

    evaluated: int
    score: float


class Outcome(NamedTuple):
    """What a search found.

    Attributes:
        study: What was searched for.
        base: Metrics of the leg as it is now (K,).
        front: The feasible designs that no other beats in every objective.
        winner: The design of the front with the best score; None if none is feasible.
        sample: Some of the feasible designs, at even distances in the table.
        problems: How many designs are not feasible, by the reason without its details.
        improvements: How the best score rose.
        progress: How far the search came.
        complete: Whether it was not stopped.
    """

    study: Study
    base: FloatArray
    front: list[Numbered]
    winner: Numbered | None
    sample: list[Numbered]
    problems: Mapping[str, int]
    improvements: list[Improvement]
    progress: Progress
    complete: bool


class EvenSample(Generic[Entry]):
    """Entries of a stream at even distances, few however long the stream is.

    Attributes:
        entries: The entries kept.
    """

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self._seen, self._distance = 0, 1

    def add(self, entry: Entry) -> None:
        """Take up the next entry of the stream if it is its turn."""
        if self._seen % self._distance == 0:
            self.entries.append(entry)
        self._seen += 1
        if len(self.entries) > MOST_SAMPLED:
            self.entries = self.entries[::2]
            self._distance *= 2


class _Stopped(Exception):  # noqa: N818  no error
    """The search was told to stop."""


class GeometrySearch:
    """A search of a study, in a folder.

    Args:
        study: What to search for.
        folder: Where the results are, and go; made if it does not exist.
        on_design: Called after each design, in the thread that runs the search.
    """

    def __init__(
        self,
        study: Study,
        folder: Path,
        on_design: Callable[[GeometrySearch], None] = lambda search: None,
    ) -> None:
        self._study = study
        self._folder = folder
        self._on_design = on_design
        self._stopped = threading.Event()
        self._front: ParetoFront[Numbered] = ParetoFront(len(study.objectives))
        self._sample: EvenSample[Numbered] = EvenSample()
        self._problems: Counter[str] = Counter()
        self._improvements: list[Improvement] = []
        self._evaluated = self._recalled = self._feasible = 0
        self._began = self._fresh_since = time.monotonic()

    @property
    def progress(self) -> Progress:
        """How far the search is now."""
        now = time.monotonic()
        fresh = self._evaluated - self._recalled
        rate = fresh / max(now - self._fresh_since, 1e-9)
        left = self._study.total - self._evaluated
        costs = self._front.costs
        return Progress(
            self._evaluated,
            self._recalled,
            self._study.total,
            self._feasible,
            now - self._began,
            rate,
            left / rate if rate else (math.nan if left else 0.0),
            self._study.signs * (np.min(costs, axis=0) if len(costs) else np.nan),
        )

    def stop(self) -> None:
        """Let the search end soon; what it has found is kept."""
        self._stopped.set()

    def run(self, workers: Workers) -> Outcome:
        """Search, or go on with a search that stopped; once for each `GeometrySearch`.

        Args:
            workers: Who evaluates the designs.

        Raises:
            SearchError: If the folder cannot be used or holds another search.
            TableError: If the table cannot be read or written, or is in use.
            WorkerError: If the workers are lost.
        """
        study, self._workers = self._study, workers
        self._base = evaluate_base(study)
        with open_table(study, self._folder) as self._table:
            self._recorded = self._table.read()
            try:
                METHODS[study.method].search(study.draw, self._evaluate)
                complete = True
            except _Stopped:
                complete = False
        return Outcome(
            study,
            self._base,
            self._front.entries,
            max(self._front.entries, key=self._score, default=None),
            self._sample.entries,
            self._problems,
            self._improvements,
            self.progress,
            complete,
        )

    def _evaluate(self, points: Iterable[FloatArray]) -> Iterator[Trial]:
        """Yield what became of each design, from the table or from the workers."""
        wanted: Iterator[FloatArray] = map(self._study.parameters_at, points)
        for parameters in wanted:
            design = next(self._recorded, None)
            if design is None:
                wanted = itertools.chain([parameters], wanted)
                break
            if not np.array_equal(parameters, design.parameters):
                raise SearchError(
                    f"{self._table.path}:{self._evaluated + 2}: holds another design than this "
                    "search draws there, so another version of it was at work; use a new folder"
                )
            if self._stopped.is_set():
                raise _Stopped
            self._recalled += 1
            self._fresh_since = time.monotonic()
            yield self._note(design)
        evaluate = partial(evaluate_designs, self._study.task)
        for designs in self._workers.map(evaluate, _chunks(wanted)):
            for design in designs:
                if self._stopped.is_set():
                    raise _Stopped
                judged = design._replace(
                    problem=design.problem or self._study.complaint(design.values)
                )
                self._table.append(judged)
                yield self._note(judged)

    def _note(self, design: Design) -> Trial:
        """Count a design and return what the method learns of it."""
        study = self._study
        entry = Numbered(self._evaluated, design)
        self._evaluated += 1
        if design.feasible:
            self._feasible += 1
            costs, score = study.costs(design.values), self._score(entry)
            self._front.add(costs, entry)
            self._sample.add(entry)
            if not self._improvements or score > self._improvements[-1].score:
                self._improvements.append(Improvement(self._evaluated, score))
            trial = Trial(costs, score, 0.0)
        else:
            violation = study.violation(design.values) or INFEASIBLE
            self._problems[NUMBERS.sub("…", design.problem).partition(":")[0]] += 1
            trial = Trial(np.zeros(len(study.objectives)), 0.0, min(violation, INFEASIBLE))
        self._on_design(self)
        return trial

    def _score(self, entry: Numbered) -> float:
        return self._study.score(entry.design.values, self._base)


def evaluate_base(study: Study) -> FloatArray:
    """Return the metrics (K,) of the leg as it is now.

    Raises:
        SearchError: If they are not known, so that no design can be compared with them.
    """
    task = study.task._replace(parameters=())
    base = task.evaluate(())
    if base.problem:
        raise SearchError(f"the leg to be improved cannot be evaluated: {base.problem}")
    return np.array([base.values[name] for name in study.metrics])


def evaluate_designs(task: DesignTask, designs: Sequence[FloatArray]) -> list[Design]:
    """Evaluate designs; this is what workers do."""
    evaluations = [task.evaluate(design) for design in designs]
    return [
        Design(design, np.array(list(found.values.values())), found.change, found.problem)
        for design, found in zip(designs, evaluations, strict=True)
    ]


def open_table(study: Study, folder: Path) -> DesignTable:
    """Open the results of a study, new or begun.

    The folder keeps the study, the robot and the friction that the results belong to.

    Raises:
        SearchError: If the folder cannot be written, or holds the results of another study.
        TableError: If the table cannot be used.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for document, path in ((study.document, folder / STUDY), (study.robot, folder / ROBOT)):
            if path.exists():
                _check_same(Document(path), document)
            write_text(path, document.text)
        if study.ground:
            _keep_friction(study, folder)
    except OSError as error:
        raise SearchError(f"{folder}: cannot be written: {error.strerror}") from None
    return DesignTable(folder / TABLE, [p.name for p in study.parameters], study.metrics)


def write_text(path: Path, text: str) -> None:
    """Write a file so that it is there as a whole or not at all.

    Raises:
        OSError: If it cannot be written.
    """
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def _keep_friction(study: Study, folder: Path) -> None:
    """Check that results were made with the friction that the study's ground has now, and keep it.

    The study names the ground only, whose file may have been changed meanwhile.
    """
    path, text = folder / GROUND, f"friction: {study.conditions.friction}\n"
    if path.exists():
        kept = path.read_text(encoding="utf-8")
        made_with = f"with {kept.strip()}"
    else:
        kept = "" if (folder / TABLE).exists() else text
        made_with = f"and does not tell the friction they were made with ({GROUND})"
    if kept != text:
        raise SearchError(
            f"{folder}: holds results {made_with}; ground {study.ground!r} has {text.strip()} now; "
            "use another folder"
        )
    write_text(path, text)


def _check_same(kept: Document, new: Document) -> None:
    """Check that results belong to a document; only the budget of a study may grow."""
    old, given = _parts(kept), _parts(new)
    differing = [
        key
        for key in {**old, **given}
        if json.dumps(old.get(key)) != json.dumps(given.get(key))  # the order of keys counts
        and not (key == "method" and _has_grown(old[key], given[key]))
    ]
    if differing:
        raise SearchError(
            f"{kept.path.parent}: holds results of another {kept.path.stem}, which differs from "
            f"{new.path} in: {', '.join(differing)}; use another folder"
        )


def _parts(document: Document) -> dict[str, Any]:
    root = document.root
    return dict(root) if isinstance(root, Mapping) else {"document": root}


def _has_grown(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Whether a method differs only in a larger number of designs."""
    keys = ("name", "population")
    same = [old.get(key) for key in keys] == [new.get(key) for key in keys]
    return same and old.get("designs", 0) < new.get("designs", 0)


def _chunks(designs: Iterator[FloatArray]) -> Iterator[list[FloatArray]]:
    while chunk := list(itertools.islice(designs, CHUNK)):
        yield chunk
