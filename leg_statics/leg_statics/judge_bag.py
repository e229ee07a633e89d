"""Command `judge_bag`: what a recording tells about the legs, without ROS running.

Every joint state of a rosbag2 recording (folder or file; mcap or sqlite3; split, compressed or
damaged) goes through the same code as in the statics node. Written are a table with a row for each
leg and joint state, a report with curves and the worst moments, and on request a copy of the
recording with the leg states added.
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Protocol

from leg_msgs_py.bags import SUFFIXES, Bag, BagError, BagMessage
from leg_msgs_py.definitions import UnknownTypeError
from tqdm import tqdm

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError, ValueRangeError
from leg_statics import judge_report, judge_table
from leg_statics.bag_judge import BagJudge, Judgement, Topics
from leg_statics.command_line import ArgumentParser
from leg_statics.diagnostic_log import DIAGNOSTICS, DiagnosticLog
from leg_statics.grounds import load_grounds
from leg_statics.judge_findings import Findings
from leg_statics.judge_report import Case, picture_files, write_report
from leg_statics.judge_table import JudgeTable
from leg_statics.judged_bag import JudgedBag

EXAMPLES = """\
examples:
  # table and report of a walk of the shipped hexapod on cement: walk_judged.parquet and .html
  %(prog)s walk --robot hexapod --ground cement

  # with the force on a foot, on wood; the table as CSV, the report in Markdown
  %(prog)s walk.mcap --wrench left_front=/left_front/wrench --ground wood \\
      --table walk.csv --report walk.md

  # a recording that shows the leg states in RViz, Foxglove or PlotJuggler
  %(prog)s walk --output-bag walk_with_leg_states
"""

INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


class Sink(Protocol):
    """What takes judgements as they come."""

    def add(self, judgements: Sequence[Judgement]) -> None:
        """Take up judgements."""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = ArgumentParser(
        prog="judge_bag",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder or file of the recording")
    which = parser.add_argument_group("robot and ground")
    which.add_argument(
        "--robot", default="hexapod", help="shipped robot or YAML file (default: %(default)s)"
    )
    ground = which.add_mutually_exclusive_group()
    ground.add_argument(
        "--ground",
        default="cement",
        metavar="NAME",
        help="ground, of which the low end of its friction counts (default: %(default)s)",
    )
    ground.add_argument(
        "--friction",
        type=float,
        metavar="MU",
        help="friction instead of a named ground",
    )
    which.add_argument(
        "--grounds", default="grounds", metavar="FILE", help="grounds file (default: the shipped)"
    )

    topics = parser.add_argument_group("topics")
    topics.add_argument(
        "--joint-states", default="/joint_states", metavar="TOPIC", help="default: %(default)s"
    )
    topics.add_argument(
        "--efforts",
        default="",
        metavar="TOPIC",
        help="joint states whose efforts count (default: those of --joint-states)",
    )
    topics.add_argument(
        "--wrench",
        action="append",
        default=[],
        type=_wrench,
        metavar="LEG=TOPIC",
        help="wrench of the ground on a foot (geometry_msgs/WrenchStamped), once for each leg; its "
        "frame turns it and its moment is about the foot",
    )
    topics.add_argument(
        "--contact-force",
        type=float,
        default=10.0,
        metavar="F",
        help="a foot with less vertical force is in the air [N] (default: %(default)s)",
    )
    topics.add_argument(
        "--gap",
        type=float,
        default=0.1,
        metavar="T",
        help="a longer pause between joint states is told [s] (default: %(default)s)",
    )

    where = parser.add_argument_group("where to")
    where.add_argument(
        "--table",
        type=Path,
        metavar="FILE",
        help=f"table, {' or '.join(judge_table.SUFFIXES)} (default: BAG_judged.parquet)",
    )
    where.add_argument(
        "--report",
        type=Path,
        metavar="FILE",
        help=f"report, {' or '.join(judge_report.SUFFIXES)} (default: BAG_judged.html)",
    )
    where.add_argument(
        "--output-bag", type=Path, metavar="FOLDER", help="copy with the leg states added"
    )
    where.add_argument(
        "--leg-states",
        default="/statics/leg_states",
        metavar="TOPIC",
        help="their topic in the copy (default: %(default)s)",
    )
    where.add_argument("--force", action="store_true", help="overwrite what is there")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge what the command line asks for and print the names of the files.

    Returns:
        0; 1 if the recording or something named cannot be used, 130 after Ctrl-C. What is asked
        for in a wrong way ends with exit code 2.
    """
    options = make_parser().parse_args(arguments)
    try:
        for path in _run(options):
            print(path)
    except (LegError, BagError, UnknownTypeError, OSError) as error:
        print(f"judge_bag: error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("judge_bag: interrupted, nothing was written", file=sys.stderr)
        return INTERRUPTED
    return 0


def _run(options: argparse.Namespace) -> list[Path]:
    """Judge and write; return the files."""
    name = options.bag.resolve().name
    for suffix in SUFFIXES:
        name = name.removesuffix(suffix)
    table = options.table or Path(f"{name}_judged.parquet")
    report = options.report or Path(f"{name}_judged.html")
    outputs = [table, report, *([options.output_bag] if options.output_bag else [])]
    judge_table.check_suffix(table)
    judge_report.check_suffix(report)
    for option, value in (("--contact-force", options.contact_force), ("--gap", options.gap)):
        if not 0.0 < value < math.inf:
            raise ValueRangeError(f"{option}: got {value:g}; allowed: > 0")
    robot = load_robot(options.robot)
    ground, friction = _ground(options)
    pictures = picture_files(report, robot.legs).values() if report.suffix == ".md" else ()
    for path in (*outputs, *pictures):
        _check_output(path, options)

    bag = Bag(options.bag)
    topics = Topics(options.joint_states, options.efforts, _by_leg(options.wrench))
    judge = BagJudge(bag, robot, friction, topics, options.contact_force, options.gap)
    findings, log = Findings(robot, friction), DiagnosticLog()
    with _drafts(outputs) as drafts:
        with ExitStack() as stack:
            sinks: list[Sink] = [findings, stack.enter_context(JudgeTable(drafts[table], robot))]
            copy = None
            if options.output_bag:
                copy = JudgedBag(drafts[options.output_bag], bag, robot, options.leg_states)
                sinks.append(stack.enter_context(copy))
            _judge(bag, judge, log, sinks, copy)
            _check_judged(bag, judge)
        write_report(drafts[report], Case(bag, judge, ground, friction, findings, log))
    for damage in bag.damages.values():
        print(
            f"judge_bag: warning: {damage.file} is damaged: {damage.reason}; "
            f"{damage.messages} messages before it were read",
            file=sys.stderr,
        )
    for topic in copy.left_out if copy else ():
        print(f"judge_bag: warning: {topic} is not copied: unknown type", file=sys.stderr)
    return outputs


def _judge(
    bag: Bag, judge: BagJudge, log: DiagnosticLog, sinks: Sequence[Sink], copy: JudgedBag | None
) -> None:
    """Read the recording once, and hand what the judge says to the sinks."""
    chosen = {t.name for t in bag.topics.values() if copy or t.type == DIAGNOSTICS}
    chosen |= judge.inputs
    total = sum(bag.counts[topic] for topic in chosen)
    with tqdm(total=total, desc="judging", unit="message", unit_scale=True, disable=None) as bar:
        for message in bag.messages(chosen):
            judge.take(message)
            if message.type == DIAGNOSTICS:
                _take_diagnostics(bag, judge, log, message)
            if copy:
                copy.take(message)
            if judge.full or (copy and copy.full):
                _hand_over(judge, sinks)
            bar.update()
        _hand_over(judge, sinks)


def _hand_over(judge: BagJudge, sinks: Sequence[Sink]) -> None:
    judgements = judge.judge()
    for sink in sinks:
        sink.add(judgements)


def _take_diagnostics(bag: Bag, judge: BagJudge, log: DiagnosticLog, message: BagMessage) -> None:
    try:
        log.add(message.time, bag.decode(message))
    except BagError as error:
        judge.tally.refuse(str(error))


# --------------------------------------------------------------------------- what is asked for


def _wrench(text: str) -> tuple[str, str]:
    """Return leg and topic of an argument LEG=TOPIC."""
    leg, _, topic = text.partition("=")
    if not leg or not topic:
        raise argparse.ArgumentTypeError(f"got {text!r}; allowed: LEG=TOPIC")
    return leg, topic


def _by_leg(wrenches: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Return the topics of wrenches by leg.

    Raises:
        ValueRangeError: If a leg or a topic is given twice.
    """
    for k, what in enumerate(("leg", "topic")):
        for name, count in Counter(pair[k] for pair in wrenches).items():
            if count > 1:
                raise ValueRangeError(f"--wrench: {what} {name} given {count} times; allowed: once")
    return dict(wrenches)


def _ground(options: argparse.Namespace) -> tuple[str, float]:
    """Return name and friction coefficient of the ground."""
    if options.friction is None:
        ground = load_grounds(options.grounds).find(options.ground)
        return ground.name, ground.friction_low
    if not 0.0 <= options.friction < math.inf:
        raise ValueRangeError(f"--friction: got {options.friction:g}; allowed: finite and >= 0")
    return "as given", options.friction


def _check_judged(bag: Bag, judge: BagJudge) -> None:
    """Raise a ValueRangeError if no joint state could be judged."""
    tally, topic = judge.tally, judge.topics.joint_states
    if tally.judged:
        return
    reasons = [f"{reason} ({count} times)" for reason, count in tally.refused.most_common(1)]
    if tally.foreign:
        known, _ = judge.robot.effort_limits()
        got = tally.foreign_names
        reasons.append(
            f"they name {', '.join(got[:3]) or 'nothing'}, ...; "
            f"the joints of {judge.robot.name} are {', '.join(known[:3])}, ..."
        )
    reasons += [f"legs lack joints: {missing}" for missing in list(tally.missing)[:1]]
    why = "; ".join(reasons) or "it has no messages"
    raise ValueRangeError(f"{bag.path}: nothing to judge on {topic}: {why}")


# --------------------------------------------------------------------------- outputs


def _check_output(path: Path, options: argparse.Namespace) -> None:
    """Raise a ValueRangeError if something cannot or must not be written there."""
    if not path.parent.is_dir():
        raise ValueRangeError(f"folder {path.parent} does not exist")
    if not path.exists():
        return
    if options.bag.resolve().is_relative_to(path.resolve()):
        raise ValueRangeError(f"{path} holds the recording itself; give another name")
    if not options.force:
        raise ValueRangeError(f"{path} exists already; give another name or --force")
    if path.is_dir() and not all(f.name.endswith((*SUFFIXES, ".yaml")) for f in path.iterdir()):
        raise ValueRangeError(f"{path} is a folder with other files than those of a recording")
    if path.is_dir() != (path == options.output_bag):
        raise ValueRangeError(f"{path} exists already and is of another kind; give another name")


@contextmanager
def _drafts(outputs: Sequence[Path]) -> Iterator[dict[Path, Path]]:
    """Give drafts of outputs, which take their places when all is well, and vanish if not."""
    with ExitStack() as stack:
        folders = {
            parent: Path(
                stack.enter_context(tempfile.TemporaryDirectory(dir=parent, prefix=".judge_bag_"))
            )
            for parent in dict.fromkeys(path.parent for path in outputs)
        }
        yield {path: folders[path.parent] / path.name for path in outputs}
        for parent, folder in folders.items():
            for made in folder.iterdir():
                place = parent / made.name
                if place.is_dir():
                    shutil.rmtree(place)
                made.replace(place)


if __name__ == "__main__":
    sys.exit(main())
