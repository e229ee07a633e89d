# SPDX-License-Identifier: Apache-2.0
"""A service, said once: for the node that serves it, and for whoever answers as the node does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from leg_msgs.msg import ErrorCode
from leg_msgs_py.arrays import from_field
from leg_msgs_py.naming import interface_name

from leg_kinematics.nodes.frames import Whereabouts
from leg_kinematics.nodes.requests import error_code
from leg_kinematics.status import Status


class Host(Whereabouts, Protocol):
    """What answers requests about a robot, with the effort limits in force: a node, or its like."""

    @property
    def max_points(self) -> int:
        """Points accepted in one request."""


class Summary(NamedTuple):
    """What an answer says in short.

    Attributes:
        points: Points that were asked about, or legs times heights.
        feasible: How many of them have a pose, are feasible footholds, or have a step.
        best: Load capacity of the best foothold [N], or the longest common step [m]; NaN if none.
        verdicts: How many footholds have which verdict.
    """

    points: int
    feasible: int
    best: float
    verdicts: Counter[IntEnum]


def status_summary(response: Any) -> Summary:
    """Return the summary of a response that has a status for each point."""
    status = from_field(response.status, dtype=np.uint8)
    return Summary(len(status), int(np.sum(status == Status.OK)), np.nan, Counter())


def no_points(response: Any) -> Summary:
    """Return the summary of a response that is not about points."""
    return Summary(0, 0, np.nan, Counter())


@dataclass(frozen=True)
class Service:
    """A service, and what answers it.

    Attributes:
        type: Its type.
        fill: Fills the response of a request to a host, or raises. Of a header it leaves the stamp.
        fill_always: Fills what a response carries also on failure.
        summary: Says in short what a response says.
        best_unit: Unit of the best in the summary; "" if there is no best.
        changes_host: Whether a request changes the host, so that it is more than a question.
    """

    type: Any
    fill: Callable[[Any, Any, Any], None]
    fill_always: Callable[[Any, Any], None]
    summary: Callable[[Any], Summary]
    best_unit: str
    changes_host: bool

    @property
    def name(self) -> str:
        """Its name below the node's."""
        return interface_name(self.type)

    def answer(
        self, host: Any, request: Any, response: Any, tell: Callable[[Exception], str] = str
    ) -> Any:
        """Return the response to a request; every fault becomes an error code.

        Args:
            host: What is asked.
            request: The request.
            response: An empty response, to fill.
            tell: Returns the message for what was raised.
        """
        try:
            self.fill(host, request, response)
            response.error.code = ErrorCode.SUCCESS
        except Exception as error:
            response = self.type.Response()
            response.error.code = error_code(error)
            response.error.message = tell(error)
        self.fill_always(host, response)
        return response


def service(
    service_type: Any,
    *,
    fill_always: Callable[[Any, Any], None] = lambda host, response: None,
    summary: Callable[[Any], Summary] = status_summary,
    best_unit: str = "",
    changes_host: bool = False,
) -> Callable[[Callable[[Any, Any, Any], None]], Service]:
    """Return a decorator that makes a `Service` of the function that fills its responses."""
    return lambda fill: Service(service_type, fill, fill_always, summary, best_unit, changes_host)
