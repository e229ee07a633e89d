"""Put every published number, claim and figure beside what this suite computes.

Prints one table a paper and writes a report with the pictures. Nothing in it is typed by hand.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import pkgutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

import leg_statics.published
from leg_statics.commands import plot_index_map, synthesize_six_bar
from leg_statics.drawing.designs import plot_designs
from leg_statics.drawing.style import write_figure
from leg_statics.published import paper_000, plot_gantry_example
from leg_statics.published.comparison import Comparison

COLUMNS = ("item", "paper", "ours", "difference", "verdict", "note")


def draw_paper_000(folder: Path) -> None:
    """Draw what figures 2 and 5 to 8 show, of the leg before and after the optimisation."""
    plot_index_map.main(["--type", "initial", "--all", str(folder)])
    plot_index_map.main(["--type", "optimised", "--all", str(folder)])
    plot_index_map.main(["--figure", "8", "--output", str(folder / "hexapod_both_8.png")])
    found = paper_000.paper_search()
    marked = {
        "initial": found.before,
        "paper's optimum": found.means[found.find(tuple(paper_000.OPTIMISED_LENGTHS.values()))],
        "best by (33)": found.means[np.argmax(found.objective)],
    }
    figure = plot_designs(found.means[found.known], marked, before=found.before)
    write_figure(figure, folder / "hexapod_initial_7.png")


def draw_paper_001(folder: Path) -> None:
    """Draw the maps of the quadruped's leg; figures 3 and 4 are those of K_F and K_J."""
    plot_index_map.main(["--robot", "quadruped", "--all", str(folder)])
    for name in ("planar_force", "planar_imbalance"):
        path = folder / f"{name}.png"
        plot_index_map.main(["--robot", "quadruped", "--index", name, "--output", str(path)])


# What draws the figures of a paper into a folder.
FIGURES: dict[str, Callable[[Path], object]] = {
    "paper_000": draw_paper_000,
    "paper_001": draw_paper_001,
    "paper_003": lambda folder: synthesize_six_bar.main(["--figures", str(folder)]),
    "paper_004": plot_gantry_example.write_figures,
}


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
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.redirect_stdout(io.StringIO()):  # the commands print what they wrote
        FIGURES[name](folder)
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
    modules = [m.name for m in pkgutil.iter_modules(leg_statics.published.__path__)]
    papers = []
    with Progress(console=console, transient=True) as progress:
        for name in progress.track([m for m in modules if m in FIGURES], description="computing"):
            papers.append(evaluate(name, output))
    for paper in papers:
        print_paper(console, paper)
    report = output / "report.md"
    report.write_text(markdown(papers, output), encoding="utf-8")
    console.print(f"Report with pictures: {report}")


if __name__ == "__main__":
    main()
