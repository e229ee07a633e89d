# SPDX-License-Identifier: Apache-2.0
"""What of a recording was checked, what could not be, and how near its limits it came."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from leg_statics.recordings.bag_judge import WRENCH
from leg_statics.recordings.diagnostic_log import level_name
from leg_statics.recordings.findings import Moment, Quantity
from leg_statics.recordings.report_case import Case


class Check(NamedTuple):
    """One quantity against its limit.

    Attributes:
        quantity: The quantity.
        limit: Its limit.
        legs: Legs of which it is known.
        known: Share of the legs' joint states for which it is known.
        beyond: Legs that went beyond the limit.
        worst: The worst moment; None if it is never known.
    """

    quantity: Quantity
    limit: float
    legs: tuple[str, ...]
    known: float
    beyond: tuple[str, ...]
    worst: Moment | None

    @property
    def share(self) -> float:
        """Worst share of the limit; 1 is at it."""
        if self.worst is None:
            return 0.0
        if self.limit > 0.0:
            return self.worst.value / self.limit
        return float("inf") if self.worst.value > 0.0 else 0.0


def limit_checks(case: Case) -> list[Check]:
    """Return a check of each quantity that has a limit."""
    findings = case.findings
    checks = []
    for quantity in findings.quantities:
        if quantity.limit is None:
            continue
        extents = {leg: findings.extent(leg, quantity) for leg in findings.statuses}
        legs = tuple(leg for leg, extent in extents.items() if extent.known)
        samples = sum(findings.samples(leg, quantity) for leg in legs)
        known = sum(extents[leg].known for leg in legs) / samples if samples else 0.0
        beyond = tuple(leg for leg, extent in extents.items() if extent.beyond)
        worst = next(iter(findings.worst(quantity)), None)
        checks.append(Check(quantity, quantity.limit, legs, known, beyond, worst))
    return checks


def gaps(case: Case) -> Iterator[str]:
    """Yield what was not checked, and why, one sentence each."""
    findings, judge, bag = case.findings, case.judge, case.bag
    silent = [leg for leg, counts in findings.statuses.items() if not counts]
    if silent:
        yield f"Nothing of {', '.join(silent)}: no joint state has all of their joints."
    for check in limit_checks(case):
        lacking = [leg for leg in findings.statuses if leg not in check.legs and leg not in silent]
        if lacking:
            every = len(lacking) == len(findings.statuses) - len(silent)
            of = "any leg" if every else ", ".join(lacking)
            needs = check.quantity.needs or "a pose that is OK"
            yield f"{check.quantity.label} of {of}: it needs {needs}."
    for check in limit_checks(case):
        if check.legs and check.known < 1.0:
            yield (
                f"{check.quantity.label} at {100.0 * (1.0 - check.known):.1f} % of the joint "
                "states of the legs checked."
            )
    used = set(judge.topics.wrenches.values())
    unused = sorted(t.name for t in bag.topics.values() if t.type == WRENCH and t.name not in used)
    if unused:
        yield (
            f"Recorded wrenches that were not used: {', '.join(unused)}; --wrench LEG=TOPIC tells "
            "whose they are."
        )
    tally = judge.tally
    if tally.foreign:
        yield f"{tally.foreign} joint states that name no joint of {judge.robot.name}."
    if tally.refused:
        yield f"{tally.refused.total()} messages that were refused."
    for damage in bag.damages.values():
        yield f"What comes after the damage of {damage.file}."


def complaints(case: Case) -> Iterator[str]:
    """Yield what the recorded diagnostics complain of, one sentence a component."""
    for name, history in sorted(case.diagnostics.statuses.items()):
        if history.worst > 0:
            yield f"{name} told {level_name(history.worst)}: {history.complaint or 'no reason'}"
