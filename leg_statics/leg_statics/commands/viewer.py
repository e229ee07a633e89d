# SPDX-License-Identifier: Apache-2.0
"""Command `viewer`: show a robot on a terrain in the browser, and let it be played with."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Sequence

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError
from leg_statics.view.standing import Playground
from leg_statics.view.terrain import SHAPES

PORT = 8080

DESCRIPTION = """\
Show a robot in the browser: its linkages, what each joint exerts, forces that its feet can bear,
footholds on a terrain, where its centre of mass may be. Sliders move feet and body; a click on the
ground asks what the legs carry there. The page is served on this machine only.
"""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="viewer", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--robot", default="hexapod", help="YAML file or name of a shipped robot (default: hexapod)"
    )
    parser.add_argument(
        "--terrain",
        default="level",
        choices=sorted(SHAPES),
        help="the ground under it (default: level)",
    )
    parser.add_argument(
        "--port",
        type=int,
        default=PORT,
        help=f"port of the page, or the next that is free; 0 for any (default: {PORT})",
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command until Ctrl-C.

    Returns:
        0; mistakes end with exit code 1 and a message.
    """
    options = make_parser().parse_args(arguments)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's `&` leaves SIGINT ignored
        signal.signal(number, signal.default_int_handler)
    try:
        from leg_statics.view.page import Page  # without viser, the help is still told

        page = Page(Playground.of(load_robot(options.robot), options.terrain), options.port)
        try:
            print(f"Robot {page.playground.robot.name!r} is shown at {page.address}")
            print("Ctrl-C stops it.", flush=True)
            stop.wait()
        finally:
            page.close()
    except KeyboardInterrupt:
        print("\nStopped.")
    except ModuleNotFoundError as error:
        print(f"viewer: this needs the Python package {error.name!r}", file=sys.stderr)
        return 1
    except (LegError, OSError) as error:
        print(f"viewer: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
