# SPDX-License-Identifier: Apache-2.0
"""The report of a judged recording in words and tables: Markdown."""

from __future__ import annotations

import importlib.metadata
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np

from leg_kinematics.status import Status
from leg_statics.footholds import Verdict
from leg_statics.recordings.checks import Check, complaints, gaps, limit_checks
from leg_statics.recordings.diagnostic_log import level_name
from leg_statics.recordings.findings import Findings, Moment, Quantity
from leg_statics.recordings.judged_stances import INTERVAL
from leg_statics.recordings.query_judge import Query, QueryFindings, QueryTally
from leg_statics.recordings.report_case import Case

MOST_DETAILS = 20  # lines of a list that can grow with the recording

LEGEND = (
    "Times are seconds since the first message of the recording, then, in brackets, the time at "
    "which the message was recorded.",
    "Shares are 1 at the limit. Joint range used: 0 in the middle of the range, 1 at its end.",
    "Load capacity: greatest vertical ground reaction within the effort limits on this ground. "
    "Rated friction: what the ground must offer at full efforts, along the walking direction "
    "(mu_e) and in both horizontal directions (mu_e,xy).",
    "Feet whose wrench tells that they are in the air are left out of loads, capacities and "
    "frictions.",
    "A leg's own weight counts where a model tells its masses; dynamics are left out.",
    "Answers to planners' queries are found anew, with this robot, these grounds and the recorded "
    "effort limits. They are the same if no number is off by more than 1e-9, relative or absolute.",
)


def report_text(case: Case, pictures: Mapping[str, str]) -> str:
    """Return the report in Markdown.

    Args:
        case: What it tells.
        pictures: Links to the pictures by the leg or service that they show.
    """
    clock, judged = _Clock(case.bag.start), case.judge.tally.judged
    parts = [
        f"# Judgement of {_cell(case.bag.path.name)}",
        *_verdict(case, clock),
        "## About this report",
        _about(case),
        "## How to read it",
        _bullets(LEGEND),
        "## Recording",
        *_recording(case),
        "## Joint states",
        *_inputs(case, clock),
        *(["## Stances", *_stances(case, clock)] if case.judge.stances.known else []),
        *(["## Legs", *_legs(case), "## Worst moments", *_moments(case, clock)] if judged else []),
        "## Queries of planners",
        *_queries(case, clock),
        "## Diagnostics",
        *_diagnostics(case, clock),
        "## Curves",
        "Bands span the least and the greatest value of successive samples; triangles mark what is "
        "beyond a limit.",
        *(f"### {name}\n\n![{name}]({link})" for name, link in pictures.items()),
    ]
    return "\n\n".join(parts) + "\n"


def _verdict(case: Case, clock: _Clock) -> list[str]:
    """Return what was checked, what could not be, and the worst share of a limit."""
    checks = limit_checks(case)
    lines = [_conclusion(case, checks, clock)]
    told = headlines(case)
    lines += [_bullets(told)] if told else []
    rows = [
        (
            check.quantity.label,
            f"{check.limit:g}",
            f"{len(check.legs)} of {len(case.findings.statuses)}, "
            f"{100.0 * check.known:.0f} % of their joint states",
            f"{check.share:.3f}",
            f"{check.worst.leg}, {clock.at(check.worst.time)}",
            ", ".join(check.beyond) or "none",
        )
        for check in checks
        if check.worst is not None
    ]
    if rows:
        heads = ("checked", "limit", "legs", "worst share", "where, when [s]", "legs beyond it")
        lines.append(_table(heads, rows))
    unchecked = [_cell(gap) for gap in gaps(case)]
    lines += ["**Not checked:**", _bullets(unchecked)] if unchecked else []
    told = [_cell(complaint) for complaint in complaints(case)]
    lines += ["**The recorded diagnostics complain:**", _bullets(told)] if told else []
    return lines


def _conclusion(case: Case, checks: Sequence[Check], clock: _Clock) -> str:
    known = [check for check in checks if check.worst is not None]
    beyond = [check for check in known if check.beyond]
    if not known:
        return "**No leg was checked against a limit.**"
    worst = max(known, key=lambda check: check.share)
    assert worst.worst is not None
    share = (
        f"The worst share of a limit is {worst.share:.3f}: {worst.quantity.label} of "
        f"{worst.worst.leg}, {clock.at(worst.worst.time)}."
    )
    if beyond:
        return f"**Beyond limits: {', '.join(check.quantity.label for check in beyond)}.** {share}"
    whole = "everything was checked" if not any(gaps(case)) else "not everything was checked"
    return f"**Within the limits in what was checked; {whole}.** {share}"


def _about(case: Case) -> str:
    """Return what was judged, when, how and by what."""
    bag = case.bag
    rows = [
        ("recording", str(bag.path.resolve())),
        ("recorded", f"{_date(bag.start)} to {_date(bag.end)}"),
        ("robot", case.judge.robot.name),
        ("ground", f"{case.ground}, friction {case.friction:g}"),
        ("judged", _date(time.time_ns())),
        ("command", case.command),
        ("version", f"leg_statics {importlib.metadata.version('leg_statics')}"),
    ]
    return _table(("what", "which"), rows)


def _date(nanoseconds: int) -> str:
    """Return a time in UTC, to the second."""
    date = datetime.fromtimestamp(nanoseconds // 10**9, tz=timezone.utc)
    return date.strftime("%Y-%m-%d %H:%M:%S UTC")


def headlines(case: Case) -> list[str]:
    """Return what stands out, one sentence each."""
    clock, tally = _Clock(case.bag.start), case.judge.tally
    lines = [
        f"**Damaged: {_cell(damage.file)}**: {_cell(damage.reason)}; {damage.messages} messages "
        "before it were read."
        for damage in case.bag.damages.values()
    ]
    if tally.refused:
        lines.append(f"{tally.refused.total()} messages were refused, see below.")
    for leg, counts in case.findings.statuses.items():
        bad = {status: count for status, count in counts.items() if status != Status.OK}
        if bad:
            names = ", ".join(f"{count} {status.name}" for status, count in sorted(bad.items()))
            lines.append(f"Poses of {leg} that are not OK: {names}.")
    for what, queries in _standing_out(case.query_findings):
        if queries:
            first = queries[0]
            lines.append(
                f"{what}, the first {first.service} of {_cell(first.legs) or 'all legs'} at "
                f"{clock.at(first.time)}."
            )
    return lines


def _recording(case: Case) -> list[str]:
    bag = case.bag
    total = bag.counts.total()
    seconds = (bag.end - bag.start) / 1e9
    lines = [f"Files: {len(bag.files)}; messages: {total}, within {seconds:.3f} s."]
    if bag.expected is not None and bag.expected != total:
        lines.append(f"The metadata tells {bag.expected} messages, {total} were found.")
    lines.append(
        _table(
            ("topic", "type", "messages"),
            [(t.name, t.type, bag.counts[t.name]) for t in sorted(bag.topics.values())],
        )
    )
    if refused := case.judge.tally.refused:
        rows = refused.most_common(MOST_DETAILS)
        lines.append(_table(("refused because", "messages"), rows))
    return lines


def _inputs(case: Case, clock: _Clock) -> list[str]:
    tally, topics = case.judge.tally, case.judge.topics
    if not topics.joint_states:
        return ["None were recorded."]
    count = case.bag.counts[topics.joint_states]
    lines = [f"{count} on {topics.joint_states}, {tally.judged} judged."]
    if tally.first is not None and tally.last is not None and tally.last > tally.first:
        rate = (count - 1) / (tally.last - tally.first) * 1e9
        lines[0] += f" Mean rate {rate:.1f} Hz."
    if tally.disordered:
        lines.append(f"{tally.disordered} had a stamp not after the one before, but were judged.")
    if tally.pieces:
        lines.append(f"{tally.pieces} named joints of a leg in part, and were put together.")
    if tally.limit_changes:
        lines.append(f"Effort limits changed {tally.limit_changes} times; those in force counted.")
    if tally.foreign:
        example = _cell(", ".join(tally.foreign_names[:3]) or "nothing")
        lines.append(f"{tally.foreign} named no joint of the robot but, for example, {example}.")
    if tally.gaps:
        gaps = [(clock.at(begin), f"{length / 1e9:.3f}") for begin, length in tally.longest_gaps]
        lines.append(f"Pauses of more than {case.judge.gap:g} s: {tally.gaps}; the longest:")
        lines.append(_table(("after", "length [s]"), gaps))
    if tally.missing:
        rows = tally.missing.most_common(MOST_DETAILS)
        lines.append(_table(("leg not updated", "messages"), rows))
    return lines


def _legs(case: Case) -> list[str]:
    findings = case.findings
    present = {status for counts in findings.statuses.values() for status in counts}
    columns = [status for status in Status if status in present]
    statuses = [
        (leg, *(counts[status] for status in columns)) for leg, counts in findings.statuses.items()
    ]
    known = [q for q in findings.quantities if findings.worst(q)]
    rows = [(leg, *(_extent_text(findings, leg, q) for q in known)) for leg in findings.statuses]
    return [
        _table(("poses", *(status.name for status in columns)), statuses),
        "Worst values, and how often they are beyond the limit:",
        _table(("leg", *map(_limit_text, known)), rows),
    ]


def _stances(case: Case, clock: _Clock) -> list[str]:
    """Return how the robot stood."""
    stances = case.judge.stances
    rows = [
        ("load factor: how many times the feet carry the robot", stances.load_factor),
        ("margin of the centre of mass in the support region [m]", stances.margin),
    ]
    told = [(label, _number(w.value), clock.at(w.time)) for label, w in rows if w.value < np.inf]
    return [
        f"The feet carry the robot in {stances.carried} of {stances.known} stances, one each "
        f"{1e-6 * INTERVAL:g} ms, on level ground at rest.",
        _table(("worst", "value", "when [s]"), told),
    ]


def _moments(case: Case, clock: _Clock) -> list[str]:
    rows = []
    for quantity in case.findings.quantities:
        alike: dict[tuple[str, str], list[Moment]] = {}
        for moment in case.findings.worst(quantity):
            alike.setdefault((_number(moment.value), moment.leg), []).append(moment)
        for (value, leg), moments in alike.items():
            more = f" and {len(moments) - 1} more alike" if len(moments) > 1 else ""
            first = min(moment.time for moment in moments)
            rows.append((_limit_text(quantity), value, leg, clock.at(first) + more))
    return [_table(("quantity", "value", "leg", "when [s]"), rows)]


def _queries(case: Case, clock: _Clock) -> list[str]:
    judge, findings = case.queries, case.query_findings
    if not judge.inputs:
        node = case.judge.topics.node
        return [f"None of {node} were recorded; its parameter service_events makes it tell them."]
    heads = ("service", "legs", "queries", "refused", "points", "feasible", "best", "time [ms]")
    services = [
        (
            service,
            legs or "all",
            tally.queries,
            tally.refused,
            tally.points,
            f"{tally.feasible} ({100.0 * tally.feasible / tally.points:.1f} %)"
            if tally.points
            else 0,
            _best_text(tally, judge.services[service].best_unit),
            f"{1e3 * tally.seconds / tally.queries:.2f}, at most {1e3 * tally.longest:.2f}",
        )
        for (service, legs), tally in sorted(findings.tallies.items())
    ]
    lines = [
        _table(heads, services),
        "Points are foot positions, sets of joint positions, or legs times heights; feasible are "
        "those with a pose, footholds that bear the load, and steps. Best is the load capacity of "
        "the best foothold, or the longest common step. Time is from the request to the response.",
    ]
    verdicts = sum((tally.verdicts for tally in findings.tallies.values()), Counter[Verdict]())
    if verdicts:
        counts = [(verdict.name, count) for verdict, count in sorted(verdicts.items())]
        lines.append(_table(("verdict", "footholds"), counts))
    total, exact, same = (
        sum(getattr(tally, name) for tally in findings.tallies.values())
        for name in ("queries", "exact", "same")
    )
    lines.append(
        f"Of {total} answers, {same} are the same as recorded, {exact} of them bit for bit; "
        f"{total - same} differ."
    )
    for count, what in (
        (judge.unanswered, "requests without a recorded response are not judged."),
        (judge.without_request, "responses without a recorded request are not judged."),
        (judge.without_contents, "requests were recorded without their contents."),
        (judge.without_transform, "answers took a pose from tf, which is not read: not judged."),
    ):
        if count:
            lines.append(f"{count} {what}")
    for what, queries in _standing_out(findings):
        if queries:
            rows = [
                (query.service, query.legs or "all", clock.at(query.time), _remark(query))
                for query in queries
            ]
            lines += [f"{what}:", _table(("service", "legs", "when [s]", "what"), rows)]
    return lines


def _best_text(tally: QueryTally, unit: str) -> str:
    if np.isnan(tally.least) or not tally.feasible:
        return "none"
    return f"{_number(tally.least)} to {_number(tally.greatest)} {unit}"


def _standing_out(findings: QueryFindings) -> list[tuple[str, list[Query]]]:
    """Return the queries that stand out, by what they have in common."""
    return [
        ("**Answers that are not as recorded**", findings.different),
        ("Queries that were refused", findings.refused),
        ("Queries without a feasible point", findings.hopeless),
    ]


def _remark(query: Query) -> str:
    """Return what is remarkable about a query."""
    if query.difference:
        difference = query.difference
        return f"{difference.field}: {difference.expected} recorded, {difference.got} found"
    if query.refused:
        return f"{query.refused}: {query.reason}"
    verdicts = sorted(query.answer.verdicts.items())
    return ", ".join(f"{count} {verdict.name}" for verdict, count in verdicts) or "none feasible"


def _diagnostics(case: Case, clock: _Clock) -> list[str]:
    log = case.diagnostics
    if not log.statuses:
        return ["None were recorded."]
    rows = []
    for name, history in sorted(log.statuses.items()):
        levels = ", ".join(f"{level_name(k)} {n}" for k, n in sorted(history.levels.items()))
        worst = f"{level_name(history.worst)} at {clock.at(history.since)}: {history.complaint}"
        rows.append((name, levels, worst, history.last))
    values = [
        (name, key, value)
        for name, history in sorted(log.statuses.items())
        for key, value in history.values.items()
    ]
    lines = [_table(("component", "levels", "worst, first told", "last message"), rows)]
    if values:
        lines.append(_table(("component", "key", "last value"), values))
    if log.others:
        lines.append(f"{log.others} statuses of further components.")
    return lines


class _Clock:
    """Tells times of a recording that starts at a time [ns]."""

    def __init__(self, start: int) -> None:
        self._start = start

    def at(self, time: int) -> str:
        return f"{(time - self._start) / 1e9:.3f} ({time // 10**9}.{time % 10**9:09d})"


def _limit_text(quantity: Quantity) -> str:
    label = f"{quantity.label} [{quantity.unit}]" if quantity.unit else quantity.label
    return label if quantity.limit is None else f"{label}, limit {quantity.limit:g}"


def _extent_text(findings: Findings, leg: str, quantity: Quantity) -> str:
    extent = findings.extent(leg, quantity)
    if not extent.known:
        return "unknown"
    worst = _number(extent.greatest if quantity.worse == "high" else extent.least)
    return f"{worst} ({100.0 * extent.beyond / extent.known:.1f} %)" if extent.beyond else worst


def _number(value: float) -> str:
    return f"{value:.4g}"


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _table(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a Markdown table."""
    lines = [heads, ["---"] * len(heads), *([_cell(str(cell)) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _cell(text: str) -> str:
    """Return text of a recording, so that nothing in it is taken for Markdown."""
    flat = " ".join(text.split())
    return "".join(f"\\{c}" if c in "\\`*[]<>|&!#~" else c for c in flat)
