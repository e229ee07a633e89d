# SPDX-License-Identifier: Apache-2.0
"""Measure the suite and its peers; print a table and save the numbers."""

from __future__ import annotations

import os

# One thread unless an entry says otherwise, before anything loads a numeric library.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse  # noqa: E402
import importlib  # noqa: E402
import json  # noqa: E402
import signal  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
import traceback  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from pathlib import Path  # noqa: E402

from rich.console import Console  # noqa: E402
from rich.markup import escape  # noqa: E402

HERE = Path(__file__).resolve().parent
sys.path.insert(1, str(HERE.parent / "tools"))

import ros_domain  # noqa: E402

ros_domain.use_own_domain()  # before anything loads ROS

from harness import Row, Settings, measure, timed_row  # noqa: E402
from report import describe_machine, results_table, row_record  # noqa: E402

# Each is a module with a function `rows(settings)` that yields `Row`s.
ENTRIES = {
    "capacity": "load capacity with the true friction cone, and conic and linear solvers",
    "kinematics": "inverse kinematics, and Pinocchio",
    "model_legs": "legs of robot models, serial and with a loop, and Pinocchio",
    "stances": "load factors and support regions of stances, and conic and linear solvers",
    "footholds": "footholds from position to verdict, and Pinocchio with Clarabel",
    "single": "one point a call",
    "jansen": "Jansen's linkage, and pylinkage",
    "maps": "index map of the whole workspace",
    "terrain": "foothold maps of terrain",
    "searches": "geometry search by worker processes",
    "startup": "import and compilation",
    "growth": "time and memory by number of points",
    "services": "service round trips of the nodes",
    "stream": "joint states to leg states at 1 kHz",
}


def main() -> int:
    """Run the entries asked for; return 1 if one failed or gave other answers than its peer."""
    arguments = read_arguments()
    console = Console()
    if not console.is_terminal:  # a pipe or a file has no width
        console = Console(width=150)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` leaves it ignored
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    record = {**describe_machine(), "quick": arguments.quick, "entries": {}}
    failed = False
    try:
        for name in arguments.only or ENTRIES:
            rows, error = run_entry(name, arguments, console)
            record["entries"][name] = [row_record(row) for row in rows]
            if error:
                record["entries"][name].append({"what": "error", "note": error})
                failed = True
    except KeyboardInterrupt:
        console.print("\nInterrupted; what was complete is saved.")
        failed = True
    path = arguments.output or results_path(record)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, indent=1) + "\n")
    console.print(f"Saved to {os.path.relpath(path)}")
    return int(failed)


def read_arguments() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="entries:\n" + "\n".join(f"  {n:11} {text}" for n, text in ENTRIES.items()),
    )
    parser.add_argument(
        "--only", metavar="NAME", action="append", choices=ENTRIES, help="an entry; may be repeated"
    )
    parser.add_argument(
        "--quick", action="store_true", help="few repeats: see that everything works"
    )
    parser.add_argument(
        "--soak", metavar="SECONDS", type=float, help="duration of the stream (default: 60)"
    )
    parser.add_argument(
        "--output", metavar="FILE", type=Path, help="where to save the numbers as JSON"
    )
    arguments = parser.parse_args()
    if arguments.soak is None:
        arguments.soak = 3.0 if arguments.quick else 60.0
    return arguments


def run_entry(
    name: str, arguments: argparse.Namespace, console: Console
) -> tuple[list[Row], str | None]:
    """Run one entry and print its table; return its rows, and the error that ended it."""
    rows: list[Row] = []
    error = None
    started = time.perf_counter()
    with console.status(f"{name} ...") as status:

        def show(text: str) -> None:
            status.update(f"{name}: {escape(text)} ...")

        settings = Settings(arguments.quick, arguments.soak, show)
        rows.append(pace_row("before", settings))
        try:
            for row in entry_rows(name, settings):
                rows.append(row)
                show(row.what)
        except Exception as failure:  # the other entries shall still run
            error = f"{type(failure).__name__}: {failure}"
            console.print(escape(traceback.format_exc()), style="red")
        rows.append(pace_row("after", settings))
    console.print(results_table(f"{name}: {ENTRIES[name]}", rows))
    console.print(f"[dim]{time.perf_counter() - started:.0f} s[/dim]\n")
    return rows, error


def pace_row(when: str, settings: Settings) -> Row:
    """Return how fast the machine is at the moment: a shared one is not always the same."""

    def loop() -> None:
        for _ in range(100_000):
            pass

    note = "100,000 turns of an empty Python loop"
    return timed_row(f"pace of the machine {when}", measure(loop, settings), note=note)


def entry_rows(name: str, settings: Settings) -> Iterator[Row]:
    """Yield the rows of an entry as they are measured."""
    yield from importlib.import_module(f"entries.{name}").rows(settings)


def results_path(record: dict[str, object]) -> Path:
    """Return where results are saved by default."""
    stamp = str(record["date"])[:19].replace(":", "-")
    return HERE / "results" / f"{stamp}_{record['commit'] or 'uncommitted'}.json"


if __name__ == "__main__":
    sys.exit(main())
