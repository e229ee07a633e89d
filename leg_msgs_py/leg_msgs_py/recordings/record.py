# SPDX-License-Identifier: Apache-2.0
"""Command `record`: record topics into a rosbag2 recording, without rosbag2."""

from __future__ import annotations

import argparse
import io
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import rclpy
from leg_msgs_py.recordings.durable_bag import QUEUE_SIZE, DurableBag
from leg_msgs_py.recordings.errors import RecorderError, RecordingError
from leg_msgs_py.recordings.recorder import SUITE_TOPICS, Recorder, spin
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from tqdm import tqdm

MEBIBYTE = 2**20

EXAMPLES = """\
examples:
  record                                   the suite's topics into a new folder, until Ctrl-C
  record -o walk --duration 60             for a minute, into the folder walk
  record --topics /joint_states '/foot/*'  these topics only
  record --all                             every topic

A recording that is killed keeps all but its last second.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code: 0 also when a signal ended the recording."""
    command_line = sys.argv if arguments is None else ["record", *arguments]
    options = _parser().parse_args(remove_ros_args(command_line)[1:])
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names that a terminal cannot show
    try:
        _check(options)
        rclpy.init(args=command_line, signal_handler_options=SignalHandlerOptions.NO)
        try:
            _record(options, _told_to_stop())
        finally:
            rclpy.try_shutdown()
    except RecordingError as error:
        print(f"record: {error}", file=sys.stderr)
        return 1
    return 0


def _told_to_stop() -> Callable[[], bool]:
    """Return what tells whether a signal has come; a shell's `&` would leave SIGINT ignored."""
    told: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: told.append(number))
    return lambda: bool(told)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="record",
        description="Record topics into a rosbag2 recording (mcap), without rosbag2.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--topics",
        nargs="+",
        metavar="NAME",
        default=SUITE_TOPICS,
        help="topics to record, also those that appear later; * stands for anything "
        f"(default: {' '.join(SUITE_TOPICS).replace('%', '%%')})",
    )
    which.add_argument(
        "--all", dest="topics", action="store_const", const=("*",), help="record every topic"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path(datetime.now().strftime("rosbag2_%Y_%m_%d-%H_%M_%S")),
        help="folder to make (default: rosbag2_ with the time)",
    )
    parser.add_argument(
        "--duration", type=float, help="how long to record [s]; without it, until Ctrl-C"
    )
    parser.add_argument(
        "--queue",
        type=float,
        default=QUEUE_SIZE / MEBIBYTE,
        help="memory for what waits for a slow disk [MiB]; more is dropped and counted "
        "(default: %(default)g)",
    )
    return parser


def _check(options: argparse.Namespace) -> None:
    for name in options.topics:
        if not name.startswith(("/", "*")):
            raise RecorderError(f"--topics: {name!r} must begin with / (or with *)")
    for name in ("duration", "queue"):
        value = getattr(options, name)
        if value is not None and not 0.0 < value < math.inf:
            raise RecorderError(f"--{name} must be a number > 0, got {value:g}")


def _record(options: argparse.Namespace, is_told_to_stop: Callable[[], bool]) -> None:
    """Record until a signal, the end of the time, or a failure."""
    bag = DurableBag(options.output, int(options.queue * MEBIBYTE))
    recorder: Recorder | None = None
    start = time.monotonic()
    try:
        with bag, tqdm(unit=" messages", disable=None) as bar:
            recorder = Recorder(bag, options.topics)

            def is_over() -> bool:
                bar.set_postfix_str(f"{bag.size / MEBIBYTE:.1f} MiB", refresh=False)
                bar.update(sum(topic.written for topic in bag.topics.values()) - bar.n)
                late = options.duration is not None and time.monotonic() - start > options.duration
                return late or is_told_to_stop() or bag.failure is not None

            spin(recorder, is_over)
    finally:
        if recorder is not None:
            _print_summary(bag, recorder, time.monotonic() - start)
            recorder.destroy_node()


def _print_summary(bag: DurableBag, recorder: Recorder, seconds: float) -> None:
    topics = sorted(bag.topics.values(), key=lambda topic: topic.name)
    count = sum(topic.written for topic in topics)
    print(f"{bag.path}: {count} messages in {seconds:.1f} s, {bag.size / MEBIBYTE:.1f} MiB")
    width = max((len(topic.name) for topic in topics), default=0)
    for topic in topics:
        print(f"  {topic.name:<{width}}  {topic.written:>9} of {topic.type}")
        if topic.dropped:
            print(f"  {'':<{width}}  {topic.dropped:>9} dropped: the disk was too slow, or failed")
        if lost := recorder.lost[topic.name]:
            print(f"  {'':<{width}}  {lost:>9} lost by the middleware: the machine was too busy")
    for remark in recorder.remarks:
        print(remark)


if __name__ == "__main__":
    raise SystemExit(main())
