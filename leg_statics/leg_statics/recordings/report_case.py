# SPDX-License-Identifier: Apache-2.0
"""All that is told of a judged recording."""

from __future__ import annotations

from typing import NamedTuple

from leg_msgs_py.recordings.bags import Bag

from leg_statics.recordings.bag_judge import BagJudge
from leg_statics.recordings.diagnostic_log import DiagnosticLog
from leg_statics.recordings.findings import Findings
from leg_statics.recordings.query_judge import QueryFindings, QueryJudge


class Case(NamedTuple):
    """What the report of a recording tells.

    Attributes:
        bag: The recording.
        judge: The judge of joint states.
        ground: Name of the ground, or how its friction was given.
        friction: Friction coefficient of the ground.
        findings: What stands out in joint states.
        queries: The judge of queries.
        query_findings: What stands out in queries.
        diagnostics: The components' own words.
        command: The command line that judged it.
    """

    bag: Bag
    judge: BagJudge
    ground: str
    friction: float
    findings: Findings
    queries: QueryJudge
    query_findings: QueryFindings
    diagnostics: DiagnosticLog
    command: str
