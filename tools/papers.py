"""Print every published number and claim beside what this suite computes."""

from __future__ import annotations

import argparse
import importlib
import pkgutil
from collections.abc import Iterator

from rich.console import Console
from rich.progress import track
from rich.table import Table

import leg_statics.published
from leg_statics.published.comparison import Comparison


def all_comparisons(console: Console) -> Iterator[tuple[str, list[Comparison]]]:
    """Yield the title of each paper and its comparisons."""
    names = [m.name for m in pkgutil.iter_modules(leg_statics.published.__path__)]
    papers = [name for name in names if name.startswith("paper_")]
    for name in track(papers, "computing", console=console, transient=True):
        module = importlib.import_module(f"leg_statics.published.{name}")
        yield str(module.__doc__).splitlines()[0], module.comparisons()


def main() -> None:
    """Print one table a paper and a count of verdicts."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    console = Console()
    if not console.is_terminal:  # a pipe or a file has no width: take one that fits the tables
        console = Console(width=160)
    for title, rows in all_comparisons(console):
        table = Table(title=title, title_justify="left", title_style="bold")
        for column in ("item", "paper", "ours", "difference", "verdict", "note"):
            table.add_column(column, overflow="fold")
        for row in rows:
            style = "" if row.holds else "yellow"
            table.add_row(*row[1:], style=style)
        console.print(table)
        held = sum(row.holds for row in rows)
        console.print(f"{held} of {len(rows)} confirmed; the others are shown as they are.\n")


if __name__ == "__main__":
    main()
