# SPDX-License-Identifier: Apache-2.0
"""Command `search_geometry`: find better dimensions of a leg, as a study file tells."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from leg_kinematics.documents import shared_files
from leg_kinematics.errors import LegError
from leg_statics.commands.command_line import print_on_any_terminal
from leg_statics.design.search.geometry_search import GeometrySearch
from leg_statics.design.search.study import Study
from leg_statics.design.search.study_file import load_study
from leg_statics.design.search.workers import open_workers

BAR_FORMAT = "{percentage:3.0f}% |{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"
PERIOD, LOG_PERIOD = 0.1, 10.0  # of the progress in a terminal and in a log [s]

DESCRIPTION = """\
Find better dimensions of a leg: vary parameters of its geometry as a study file tells, and leave a
table of all designs, the winner as a robot description, and a report with pictures in a folder.
Stop it by Ctrl-C; the same command goes on where it stopped, however it was stopped.
"""

EXAMPLES = """\
examples:
  # the three lengths that the paper varies, on all processor cores
  %(prog)s paper_three_lengths

  # a study of your own, into a folder of your choice, with two processes
  %(prog)s my_study.yaml --output found --workers 2

  # the same on a cluster, with the address of its Dask scheduler
  %(prog)s my_study.yaml --output found --scheduler tcp://head:8786

  # look at what was found
  plot_index_map --robot found/winner.yaml --index condition_number
"""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="search_geometry",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "study",
        help=f"study file, or name of a shipped study: {', '.join(sorted(_shipped())) or 'none'}",
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: NAME_results, by the name of the study)",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="worker processes on this machine (default: one a processor core)",
    )
    where.add_argument(
        "--scheduler", default="", metavar="ADDRESS", help="use the workers of a Dask scheduler"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns:
        0, or 130 if Ctrl-C stopped it. Mistakes and faults end with exit code 1 and a message.
    """
    options = make_parser().parse_args(arguments)
    print_on_any_terminal()
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's `&` leaves SIGINT ignored
        signal.signal(number, signal.default_int_handler)
    try:
        _run(options)
    except KeyboardInterrupt:
        print(
            "search_geometry: stopped; what was found is kept, the same command goes on",
            file=sys.stderr,
        )
        return 130
    except ModuleNotFoundError as error:  # optimisers and Dask are imported when they are asked for
        print(f"search_geometry: this needs the Python package {error.name!r}", file=sys.stderr)
        return 1
    except (LegError, OSError) as error:
        print(f"search_geometry: {error}", file=sys.stderr)
        return 1
    return 0


def _run(options: argparse.Namespace) -> None:
    study = load_study(_shipped().get(options.study, options.study))
    folder = options.output or Path(f"{study.name}_results")
    with open_workers(options.workers, options.scheduler) as workers:
        print(
            f"{study.name}: {study.total} designs by {study.method}, {workers.count} workers, "
            f"results in {folder}",
            flush=True,
        )
        with ProgressBar(study) as bar:
            outcome = GeometrySearch(study, folder, bar.show).run(workers)
    from leg_statics.design.search.report import summary, write_results  # slow to import

    print("\n".join(summary(outcome)))
    if outcome.winner is None:
        print("No design is feasible; the report tells why.")
    for path in write_results(outcome, folder):
        print(path)


class ProgressBar:
    """Shows how far a search is: rate, remaining time, the best of each objective so far."""

    def __init__(self, study: Study) -> None:
        self._objectives = study.objectives
        self._period = PERIOD if sys.stderr.isatty() else LOG_PERIOD
        self._shown = time.monotonic()
        self._search: GeometrySearch | None = None
        # tqdm would count designs that are recalled from the table as fast ones
        self._bar = tqdm(total=study.total, bar_format=BAR_FORMAT, dynamic_ncols=True)

    def __enter__(self) -> ProgressBar:
        """Return the bar."""
        return self

    def __exit__(self, *_: object) -> None:
        """Show the last state."""
        self._draw()
        self._bar.close()

    def show(self, search: GeometrySearch) -> None:
        """Show a search now and then."""
        self._search = search
        if time.monotonic() > self._shown + self._period:
            self._draw()

    def _draw(self) -> None:
        self._shown = time.monotonic()
        if self._search is None:
            return
        progress = self._search.progress
        left = tqdm.format_interval(progress.remaining) if progress.rate else "?"
        best = ", ".join(
            f"{name} {value:.4g}"
            for name, value in zip(self._objectives, progress.best, strict=True)
        )
        self._bar.n = progress.evaluated
        self._bar.set_postfix_str(
            f"{progress.rate:.1f} designs/s, {left} left, {progress.feasible} feasible, "
            f"best: {best}"
        )


def _shipped() -> dict[str, Path]:
    """Return the studies that ship with the suite, by name."""
    return shared_files("leg_bringup", "studies", ".yaml")


if __name__ == "__main__":
    sys.exit(main())
