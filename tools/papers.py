# SPDX-License-Identifier: Apache-2.0
"""Put every published number, claim and figure beside what this suite computes.

Prints one table a paper and writes a report with the pictures. Nothing in it is typed by hand.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import pkgutil
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

import leg_statics.published.figures
from leg_statics.published.comparison import Comparison

COLUMNS = ("item", "paper", "ours", "difference", "verdict", "note")


class Paper(NamedTuple):
    """One paper: name of its module, title, comparisons and pictures."""

    name: str
    title: str
    rows: list[Comparison]
    pictures: list[Path]

    @property
    def summary(self) -> str:
        """How many numbers and claims are confirmed."""
        held = sum(row.holds for row in self.rows)
        return f"{held} of {len(self.rows)} confirmed; the others are shown as they are."


def evaluate(name: str, output: Path) -> Paper:
    """Compute the comparisons of a paper and draw its figures."""
    module = importlib.import_module(f"leg_statics.published.{name}")
    figures = importlib.import_module(f"leg_statics.published.figures.{name}")
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.redirect_stdout(io.StringIO()):  # the commands print what they wrote
        figures.draw(folder)
    title = str(module.__doc__).splitlines()[0]
    return Paper(name, title, module.comparisons(), sorted(folder.glob("*.png")))


def print_paper(console: Console, paper: Paper) -> None:
    """Print the comparisons of a paper as a table."""
    table = Table(title=paper.title, title_justify="left", title_style="bold")
    for column in COLUMNS:
        table.add_column(column, overflow="fold")
    for row in paper.rows:
        table.add_row(*map(escape, row[1:]), style="" if row.holds else "yellow")
    console.print(table)
    console.print(paper.summary + "\n")


def markdown(papers: list[Paper], output: Path) -> str:
    """Return the report."""
    parts = ["# Published numbers, claims and figures beside ours\n"]
    for paper in papers:
        parts.append(f"## {paper.title}\n\n{paper.summary}\n")
        parts.append("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
        for row in paper.rows:
            parts.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row[1:]) + " |")
        parts.append("")
        for picture in paper.pictures:
            parts.append(f"![{picture.stem}]({picture.relative_to(output).as_posix()})")
        parts.append("")
    return "\n".join(parts)


def main() -> None:
    """Evaluate all papers, print the tables, write the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument(
        "--output", type=Path, default=Path("papers_report"), help="folder of report and pictures"
    )
    output = parser.parse_args().output
    console = Console()
    if not console.is_terminal:  # a pipe or a file has no width: take one that fits the tables
        console = Console(width=160)
    names = [module.name for module in pkgutil.iter_modules(leg_statics.published.figures.__path__)]
    papers = []
    with Progress(console=console, transient=True) as progress:
        for name in progress.track(names, description="computing"):
            papers.append(evaluate(name, output))
    for paper in papers:
        print_paper(console, paper)
    report = output / "report.md"
    report.write_text(markdown(papers, output), encoding="utf-8")
    console.print(f"Report with pictures: {report}")


if __name__ == "__main__":
    main()
