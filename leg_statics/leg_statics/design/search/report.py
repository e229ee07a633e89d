# SPDX-License-Identifier: Apache-2.0
"""What a geometry search leaves besides its table: the winner as a robot, and a report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from leg_statics.design.designs import find_metric
from leg_statics.design.search.geometry_search import TABLE, Numbered, Outcome, write_text
from leg_statics.design.search.improved_robot import improved_robot
from leg_statics.design.search.pictures import search_pictures

REPORT, WINNER = "report.md", "winner.yaml"
RESOLUTION = 200  # dots per inch
MOST_PROBLEMS = 8  # reasons that are listed

SCORE = (
    "The winner is the design of the Pareto front with the best score: the product of its relative "
    "gains over the leg before, as in equation (33) of Zhang, Jin, Zhang 2017, if it is better in "
    "every objective, else its worst gain."
)


def write_results(outcome: Outcome, folder: Path) -> list[Path]:
    """Write the winner's robot description and the report into the folder of a search.

    Returns:
        The files, the report last.

    Raises:
        OSError: If they cannot be written.
    """
    paths = []
    if outcome.winner is not None:
        paths.append(folder / WINNER)
        write_text(paths[-1], winner_robot(outcome))
    pictures = []
    for name, figure in search_pictures(outcome).items():
        pictures.append(folder / f"{name}.png")
        figure.savefig(pictures[-1], dpi=RESOLUTION)
    report = "\n".join(_report(outcome, pictures)) + "\n"
    write_text(folder / REPORT, report)
    return [*paths, *pictures, folder / REPORT]


def winner_robot(outcome: Outcome) -> str:
    """Return the robot description (YAML) with the winner's dimensions; "" without a winner."""
    study, winner = outcome.study, outcome.winner
    if winner is None:
        return ""
    values = (
        f"{name} = {value:.6g} {find_metric(name).unit}"
        for name, value in zip(study.metrics, winner.design.values, strict=True)
    )
    comment = f"Found by the study {study.name}, design {winner.number}: " + ", ".join(values)
    return improved_robot(
        study.robot,
        study.leg.leg_type,
        study.changes(winner.design.parameters),
        study.name,
        comment,
    )


def summary(outcome: Outcome) -> Iterator[str]:
    """Yield the lines of a table of the winner beside the leg before (Markdown)."""
    study, winner = outcome.study, outcome.winner
    after = winner.design if winner else None
    yield "| | unit | before | winner | change |"
    yield "|---|---|---|---|---|"
    for k, name in enumerate(study.metrics):
        yield _row(name, find_metric(name).unit, outcome.base[k], after and after.values[k])
    for k, p in enumerate(study.parameters):
        before = getattr(study.leg.geometry, p.name)
        yield _row(f"{p.name} ({p.symbol})", p.unit, before, after and after.parameters[k])


def _row(label: str, unit: str, before: float, after: float | None) -> str:
    if after is None:
        return f"| {label} | {unit} | {before:.5g} | - | - |"
    change = 100.0 * (after / before - 1.0) if before else math.nan
    return f"| {label} | {unit} | {before:.5g} | {after:.5g} | {change:+.2f} % |"


def _report(outcome: Outcome, pictures: Sequence[Path]) -> Iterator[str]:
    study, progress = outcome.study, outcome.progress
    yield f"# Study {study.name}"
    yield ""
    yield (
        f"{progress.evaluated} designs by {study.method}, {progress.feasible} of them feasible, "
        f"{len(outcome.front)} on the Pareto front; all are in `{TABLE}`, in SI units."
    )
    fresh = progress.evaluated - progress.recalled
    if fresh:
        yield f"{fresh} of them took {progress.elapsed:.1f} s: {progress.rate:.1f} designs/s."
    if not outcome.complete:
        yield f"The search was stopped before all of its {progress.total} designs."
    yield ""
    yield from summary(outcome)
    yield ""
    yield SCORE if len(study.objectives) > 1 else "The winner is the best in the one objective."
    for constraint in study.constraints:
        limits = [
            f"{sign} {limit:g} {find_metric(constraint.metric).unit}"
            for sign, limit in ((">=", constraint.lower), ("<=", constraint.upper))
            if math.isfinite(limit)
        ]
        yield f"Feasible designs have {constraint.metric} {' and '.join(limits)}."
    yield from _best_ones(outcome)
    if outcome.problems:
        yield ""
        yield "| designs that are not feasible | reason |"
        yield "|---|---|"
        ordered = sorted(outcome.problems.items(), key=lambda item: -item[1])
        for problem, count in ordered[:MOST_PROBLEMS]:
            yield f"| {count} | {problem.replace('|', '/')} |"
    for picture in pictures:
        title = picture.stem.replace("_", " ")
        yield ""
        yield f"![{title}]({picture.name})"


def _best_ones(outcome: Outcome) -> Iterator[str]:
    """Yield a table of the designs of the front that are best in one objective."""
    study = outcome.study
    if outcome.winner is None or len(study.objectives) < 2:
        return
    yield ""
    columns = [*study.metrics, *(p.symbol for p in study.parameters)]
    yield f"| best | design | {' | '.join(columns)} |"
    yield "|---|---|" + "---|" * len(columns)
    rows: dict[str, Numbered] = {"winner": outcome.winner}
    best = np.argmin([study.costs(entry.design.values) for entry in outcome.front], axis=0)
    rows |= {name: outcome.front[k] for name, k in zip(study.objectives, best, strict=True)}
    for label, (number, design) in rows.items():
        numbers = [f"{x:.5g}" for x in (*design.values, *design.parameters)]
        yield f"| {label} | {number} | {' | '.join(numbers)} |"
