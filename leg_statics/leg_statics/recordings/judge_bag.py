# SPDX-License-Identifier: Apache-2.0
"""Command `judge_bag`: what a recording tells about the legs, without ROS running.

Every joint state and every planner's query of a rosbag2 recording (folder or file; mcap or sqlite3;
split, compressed or damaged) goes through the same code as in the statics node. Written are a table
with a row for each leg and joint state, one with a row for each query, a report with curves and the
worst moments, and on request a copy of the recording with the leg states added.
"""

from __future__ import annotations

import argparse
import math
import shlex
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

from leg_msgs_py.recordings.bag_files import SUFFIXES
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.errors import BagError, RecordingError
from tqdm import tqdm

from leg_kinematics.description import load_robot
from leg_kinematics.errors import LegError, ValueRangeError
from leg_statics.commands.command_line import ArgumentParser, print_on_any_terminal
from leg_statics.grounds import Grounds, load_grounds
from leg_statics.recordings import report, tables
from leg_statics.recordings.bag_judge import BagJudge, Topics
from leg_statics.recordings.diagnostic_log import DIAGNOSTICS, DiagnosticLog
from leg_statics.recordings.findings import Findings
from leg_statics.recordings.judged_bag import JudgedBag
from leg_statics.recordings.query_judge import QueryFindings, QueryJudge
from leg_statics.recordings.report_case import Case

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

JOINT_STATES = "/joint_states"
INTERRUPTED = 130  # exit code after Ctrl-C, as shells have it


class Sink(Protocol):
    """What takes judgements, of joint states or of queries, as they come."""

    def add(self, judgements: Sequence[Any]) -> None:
        """Take up judgements."""


class Source(Protocol):
    """What judges messages."""

    @property
    def full(self) -> bool:
        """Whether so much waits that it should be judged now."""

    def judge(self) -> Sequence[Any]:
        """Return new judgements."""


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
    which.add_argument(
        "--frame-prefix",
        default="",
        metavar="PREFIX",
        help="the nodes' parameter frame_prefix, such as robot_1/ (default: none)",
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
        "--joint-states",
        metavar="TOPIC",
        help="default: /joint_states; none if there are only queries",
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
        "--node",
        default="/statics",
        metavar="NAME",
        help="node whose effort limits count and whose queries are judged (default: %(default)s); "
        "queries are recorded if its parameter service_events is 'contents'",
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
        help=f"table, {' or '.join(tables.SUFFIXES)} (default: BAG_judged.parquet); that of "
        "the queries stands beside it, as BAG_judged_queries.parquet",
    )
    where.add_argument(
        "--report",
        type=Path,
        metavar="FILE",
        help=f"report, {' or '.join(report.SUFFIXES)} (default: BAG_judged.html)",
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
    options.command = shlex.join(["judge_bag", *(sys.argv[1:] if arguments is None else arguments)])
    print_on_any_terminal()
    try:
        for path in _run(options):
            print(path)
    except (LegError, RecordingError, OSError) as error:
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
    table_file = options.table or Path(f"{name}_judged.parquet")
    query_file = table_file.with_name(f"{table_file.stem}_queries{table_file.suffix}")
    report_file = options.report or Path(f"{name}_judged.html")
    outputs = [table_file, report_file, *([options.output_bag] if options.output_bag else [])]
    tables.check_suffix(table_file)
    report.check_suffix(report_file)
    for option, value in (("--contact-force", options.contact_force), ("--gap", options.gap)):
        if not 0.0 < value < math.inf:
            raise ValueRangeError(f"{option}: got {value:g}; allowed: > 0")
    robot = load_robot(options.robot).with_frame_prefix(options.frame_prefix)
    grounds = load_grounds(options.grounds)
    ground, friction = _ground(options, grounds)
    bag = Bag(options.bag)
    queries = QueryJudge(bag, grounds, options.node)
    outputs += [query_file] if queries.inputs else []
    pictures = report.picture_files(report_file, [*robot.legs, *queries.services])
    for path in (*outputs, *pictures.values()):
        _check_output(path, options)

    topics = Topics(
        _joint_states(options, bag, queries),
        options.efforts,
        _by_leg(options.wrench),
        options.node,
    )
    judge = BagJudge(bag, robot, friction, topics, options.contact_force, options.gap)
    case = Case(
        bag,
        judge,
        ground,
        friction,
        Findings(robot, friction, options.contact_force),
        queries,
        QueryFindings(),
        DiagnosticLog(),
        options.command,
    )
    with _drafts(outputs) as drafts:
        with ExitStack() as stack:
            sinks: list[Sink] = [
                case.findings,
                stack.enter_context(tables.JudgeTable(drafts[table_file], robot)),
            ]
            copy = None
            if options.output_bag:
                copy = JudgedBag(drafts[options.output_bag], bag, robot, options.leg_states)
                sinks.append(stack.enter_context(copy))
            query_sinks: list[Sink] = [case.query_findings]
            if queries.inputs:
                query_sinks.append(stack.enter_context(tables.QueryTable(drafts[query_file])))
            _judge(case, sinks, query_sinks, copy)
            _check_judged(case)
        report.write_report(drafts[report_file], case)
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
    case: Case,
    sinks: Sequence[Sink],
    query_sinks: Sequence[Sink],
    copy: JudgedBag | None,
) -> None:
    """Read the recording once, and hand what the judges say to the sinks."""
    bag, judge, queries = case.bag, case.judge, case.queries
    chosen = {t.name for t in bag.topics.values() if copy or t.type == DIAGNOSTICS}
    chosen |= judge.inputs | queries.inputs
    total = sum(bag.counts[topic] for topic in chosen)
    with tqdm(total=total, desc="judging", unit="message", unit_scale=True, disable=None) as bar:
        for message in bag.messages(chosen):
            judge.take(message)
            try:
                queries.take(message, judge.robot)
                if message.type == DIAGNOSTICS:
                    case.diagnostics.add(message.time, bag.decode(message))
            except BagError as error:
                judge.tally.refuse(str(error))
            if copy:
                copy.take(message)
            if judge.full or (copy and copy.full):
                _hand_over(judge, sinks)
            if queries.full:
                _hand_over(queries, query_sinks)
            bar.update()
        _hand_over(judge, sinks)
        _hand_over(queries, query_sinks)


def _hand_over(source: Source, sinks: Sequence[Sink]) -> None:
    judgements = source.judge()
    for sink in sinks:
        sink.add(judgements)


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


def _joint_states(options: argparse.Namespace, bag: Bag, queries: QueryJudge) -> str:
    """Return the topic of joint states; "" if only queries were recorded."""
    if options.joint_states is not None:
        return str(options.joint_states)
    return "" if queries.inputs and JOINT_STATES not in bag.topics else JOINT_STATES


def _ground(options: argparse.Namespace, grounds: Grounds) -> tuple[str, float]:
    """Return name and friction coefficient of the ground."""
    if options.friction is None:
        ground = grounds.find(options.ground)
        return ground.name, ground.friction_low
    if not 0.0 <= options.friction < math.inf:
        raise ValueRangeError(f"--friction: got {options.friction:g}; allowed: finite and >= 0")
    return "as given", options.friction


def _check_judged(case: Case) -> None:
    """Raise a ValueRangeError if neither a joint state nor a query could be judged."""
    bag, judge = case.bag, case.judge
    tally, topic = judge.tally, judge.topics.joint_states
    if tally.judged or case.query_findings.tallies:
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
    where = ", ".join(sorted({topic} - {""} | case.queries.inputs))
    raise ValueRangeError(f"{bag.path}: nothing to judge on {where}: {why}")


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
