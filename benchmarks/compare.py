# SPDX-License-Identifier: Apache-2.0
"""Show how measured values changed against a saved baseline."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from report import text
from rich.console import Console
from rich.markup import escape
from rich.table import Table

HERE = Path(__file__).resolve().parent
NOISE = 0.10  # relative change that a repeated run may show by itself


def main() -> int:
    """Print the comparison; return 1 if there is nothing to compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "result", nargs="?", type=Path, help="results to look at (default: the newest in results/)"
    )
    parser.add_argument("--baseline", type=Path, default=HERE / "baseline.json")
    arguments = parser.parse_args()
    saved = sorted((HERE / "results").glob("*.json"), key=lambda path: path.stat().st_mtime)
    result = arguments.result or (saved[-1] if saved else HERE / "results")
    for path, remedy in (
        (result, "`make bench` makes one"),
        (arguments.baseline, "copy a result there"),
    ):
        if not path.is_file():
            print(f"There is no {path}: {remedy}.", file=sys.stderr)
            return 1
    new, old = json.loads(result.read_text()), json.loads(arguments.baseline.read_text())
    console = Console()
    if not console.is_terminal:
        console = Console(width=130)
    console.print(f"new:      {_origin(new)}\nbaseline: {_origin(old)}", highlight=False)
    if new["machine"]["cpu"] != old["machine"]["cpu"] or new["quick"] or old["quick"]:
        console.print("[yellow]Different machines, or a quick run: compare the ratios only.[/]")
    console.print(_table(new, old))
    return 0


def _origin(record: dict[str, Any]) -> str:
    machine = record["machine"]
    commit = record["commit"] or "no commit"
    return f"{record['date']}, {commit}, {machine['cpu']}, {machine['cores']} cores"


def _table(new: dict[str, Any], old: dict[str, Any]) -> Table:
    """Return all values that both have, side by side."""
    table = Table()
    table.add_column("entry")
    table.add_column("measured", overflow="fold")
    for column in ("baseline", "new", "change"):
        table.add_column(column, justify="right", no_wrap=True)
    before = {(n, row["what"]): row for n, rows in old["entries"].items() for row in rows}
    for name, rows in new["entries"].items():
        for row in rows:
            was = before.get((name, row["what"]), {}).get("value")
            now = row.get("value")
            if was is None or now is None:
                continue
            change = now / was - 1.0 if was else 0.0
            better = (change > 0.0) == row["larger_is_better"]
            style = "dim" if abs(change) < NOISE else ("green" if better else "red")
            table.add_row(
                name,
                escape(row["what"]),
                text(was, row["unit"]),
                text(now, row["unit"]),
                f"[{style}]{change:+.0%}[/]",
            )
    return table


if __name__ == "__main__":
    sys.exit(main())
