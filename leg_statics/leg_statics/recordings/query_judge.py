"""Queries of planners in a recording, answered again by the functions that the node answers with.

A node whose parameter `service_events` is "contents" publishes its requests and responses. Every
request is answered anew, with the robot, the limits and the grounds of the judge, and the answer is
compared with the recorded one.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import ErrorCode
from leg_msgs.srv import QueryFootholds, QueryStepLength
from leg_msgs_py.arrays import from_field, to_field
from leg_msgs_py.recordings.bags import Bag, BagMessage
from leg_msgs_py.recordings.comparison import Difference, Tolerance, differences
from leg_msgs_py.recordings.definitions import message_definition

from leg_kinematics.errors import ValueRangeError
from leg_kinematics.nodes.requests import error_code
from leg_kinematics.robot import Robot
from leg_statics.footholds import Verdict
from leg_statics.grounds import Grounds
from leg_statics.nodes.foothold_requests import fill_footholds
from leg_statics.nodes.step_requests import fill_step_length
from leg_statics.recordings.findings import Envelope

REQUEST_RECEIVED, RESPONSE_SENT = 1, 2  # of service_msgs/ServiceEventInfo, told by the node
MOST_WAITING = 256  # requests without a response yet; the node queues no more
MOST_QUERIES = 4096  # that wait to be taken
MOST_TALLIES = 100  # requests may name anything as legs
OTHERS = "others"
MOST_TOLD = 20  # of each kind of query that stands out
EXACT, SAME = Tolerance(), Tolerance(absolute=1e-9, relative=1e-9)  # other machines round otherwise
NO_ANSWER = ("header", "error")  # fields that tell when, and what went wrong


class Summary(NamedTuple):
    """What an answer says in short.

    Attributes:
        points: Candidate footholds, or legs times heights.
        feasible: How many of them are feasible, or have a step.
        best: Load capacity of the best foothold [N], or the longest common step [m]; NaN if none.
        verdicts: How many footholds have which verdict.
    """

    points: int
    feasible: int
    best: float
    verdicts: Counter[Verdict]


class Query(NamedTuple):
    """A query and its answer.

    Attributes:
        service: Name of the service.
        legs: Legs that it names, separated by blanks; "" for all, or the only one.
        time: When the request was recorded [ns].
        seconds: From the request to the response, as the node stamped them [s].
        refused: Name of the recorded error; "" if there was none.
        reason: The message that came with it.
        answer: The answer found here.
        exact: Whether it is the recorded one, bit for bit.
        difference: The first value that is not the recorded one; None if there is none.
    """

    service: str
    legs: str
    time: int
    seconds: float
    refused: str
    reason: str
    answer: Summary
    exact: bool
    difference: Difference | None


class _Request(NamedTuple):
    """A request that waits for its response."""

    time: int
    stamp: int
    content: Any


class QueryJudge:
    """Takes the service events of a recording one by one.

    Args:
        bag: The recording.
        grounds: Grounds that requests may name.
        node: Name of the node that was asked.

    Attributes:
        inputs: Names of the topics to take.
        services: Names of the services whose events they are.
        without_contents: Requests of which only the metadata were recorded.
        without_request: Responses whose request was not recorded.

    Raises:
        ValueRangeError: If a topic has another type of messages, or one of another version.
    """

    def __init__(self, bag: Bag, grounds: Grounds, node: str = "/statics") -> None:
        topics = {f"{node}/{service.name}/_service_event": service for service in SERVICES}
        self._services = {topic: each for topic, each in topics.items() if topic in bag.topics}
        for topic, service in self._services.items():
            if bag.topics[topic].type != service.event_type:
                raise ValueRangeError(
                    f"topic {topic}: got {bag.topics[topic].type}; allowed: {service.event_type}"
                )
            installed = message_definition(service.event_type).hash
            if bag.types.hash_rihs01(service.event_type) != installed:
                raise ValueRangeError(
                    f"topic {topic}: {service.event_type} is not defined there as it is installed "
                    "here: another version of leg_msgs"
                )
        self.inputs = set(self._services)
        self.services = [service.name for service in self._services.values()]
        self.without_contents = 0
        self.without_request = 0
        self._forgotten = 0
        self._bag = bag
        self._grounds = grounds
        self._waiting: dict[tuple[str, bytes, int], _Request] = {}
        self._judged: list[Query] = []

    @property
    def unanswered(self) -> int:
        """Requests whose response was not recorded (so far)."""
        return self._forgotten + len(self._waiting)

    @property
    def full(self) -> bool:
        """Whether so many queries wait that they should be taken now."""
        return len(self._judged) >= MOST_QUERIES

    def take(self, message: BagMessage, robot: Robot) -> None:
        """Take an event of the topics; other messages are ignored.

        Args:
            message: The event.
            robot: The robot with the effort limits in force.

        Raises:
            BagError: If it cannot be decoded.
        """
        if message.topic not in self._services:
            return
        event = self._bag.decode(message)
        info, stamp = event.info, event.info.stamp
        key = (message.topic, info.client_gid.tobytes(), info.sequence_number)
        nanoseconds = stamp.sec * 10**9 + stamp.nanosec
        if info.event_type == REQUEST_RECEIVED:
            if not event.request:
                self.without_contents += 1
                return
            self._waiting[key] = _Request(message.time, nanoseconds, event.request[0])
            if len(self._waiting) > MOST_WAITING:
                del self._waiting[next(iter(self._waiting))]
                self._forgotten += 1
        elif info.event_type == RESPONSE_SENT and event.response:
            if key not in self._waiting:
                self.without_request += 1
                return
            request = self._waiting.pop(key)
            seconds = (nanoseconds - request.stamp) / 1e9
            service = self._services[message.topic]
            query = self._query(service, robot, request, event.response[0], seconds)
            self._judged.append(query)

    def judge(self) -> list[Query]:
        """Return the queries that were judged since the last call."""
        judged, self._judged = self._judged, []
        return judged

    def _query(
        self, service: _Service, robot: Robot, request: _Request, recorded: Any, seconds: float
    ) -> Query:
        wanted = _as_ros(service.response_type, recorded)
        found = service.response_type()
        try:
            if wanted.error.code == ErrorCode.TOO_LARGE:  # the node's limits are not recorded
                found.error.code = ErrorCode.TOO_LARGE
            else:
                # The node took the request, so its limits allow it.
                service.fill(robot, self._grounds, sys.maxsize, request.content, found)
                found.error.code = ErrorCode.SUCCESS
        except Exception as error:  # as in the node: every fault becomes an error code
            found = service.response_type()
            found.error.code = error_code(error)
            found.error.message = str(error)
        exact = not _differences(service, wanted, found, EXACT)
        off = () if exact else _differences(service, wanted, found, SAME)
        code = wanted.error.code
        return Query(
            service.name,
            service.legs(request.content),
            request.time,
            seconds,
            "" if code == ErrorCode.SUCCESS else _error_name(code),
            wanted.error.message,
            service.summary(found),
            exact,
            next(iter(off), None),
        )


def _differences(
    service: _Service, wanted: Any, found: Any, tolerance: Tolerance
) -> Sequence[Difference]:
    """Return where an answer is not the recorded one."""
    codes = wanted.error.code, found.error.code
    if codes[0] != codes[1]:
        return [Difference(service.name, 0, "error.code", *map(_error_name, codes))]
    return differences(
        {service.name: [found]}, {service.name: [wanted]}, {"*": tolerance}, NO_ANSWER
    )


def _as_ros(kind: Any, recorded: Any) -> Any:
    """Return a decoded response as a message of ROS, without its header."""
    message = kind()
    message.error.code = int(recorded.error.code)
    message.error.message = recorded.error.message
    for name in kind.get_fields_and_field_types():
        if name not in NO_ANSWER:
            value = getattr(recorded, name)
            is_array = isinstance(value, np.ndarray)
            setattr(message, name, to_field(value, value.dtype) if is_array else value)
    return message


def _error_name(code: int) -> str:
    """Return the name of an error code."""
    constants = (name for name in dir(ErrorCode) if name.isupper() and name[0] != "_")
    return next((name for name in constants if getattr(ErrorCode, name) == code), str(code))


# --------------------------------------------------------------------------- services


class _Service(NamedTuple):
    """A service whose queries are judged.

    Attributes:
        name: Its name below the node's.
        event_type: Type of its events.
        response_type: Class of its responses.
        fill: Answers a request as the node does.
        legs: Returns the legs of a request, separated by blanks.
        summary: Says in short what a response says.
    """

    name: str
    event_type: str
    response_type: Any
    fill: Callable[[Robot, Grounds, int, Any, Any], None]
    legs: Callable[[Any], str]
    summary: Callable[[Any], Summary]


def _foothold_summary(response: Any) -> Summary:
    numbers, counts = np.unique(from_field(response.verdict, dtype=np.uint8), return_counts=True)
    verdicts = Counter(dict(zip(map(Verdict, numbers), counts.tolist(), strict=True)))
    best = response.load_capacity[response.best] if response.ranking else np.nan
    return Summary(len(response.verdict), verdicts[Verdict.FEASIBLE], best, verdicts)


def _step_summary(response: Any) -> Summary:
    lengths, common = from_field(response.lengths), from_field(response.common_lengths)
    best = float(np.max(common)) if common.size else np.nan
    return Summary(len(lengths), int(np.sum(lengths > 0.0)), best, Counter())


SERVICES = (
    _Service(
        "query_footholds",
        "leg_msgs/srv/QueryFootholds_Event",
        QueryFootholds.Response,
        fill_footholds,
        lambda request: request.leg,
        _foothold_summary,
    ),
    _Service(
        "query_step_length",
        "leg_msgs/srv/QueryStepLength_Event",
        QueryStepLength.Response,
        fill_step_length,
        lambda request: " ".join(request.legs),
        _step_summary,
    ),
)


# --------------------------------------------------------------------------- what stands out


CURVES = ("feasible", "best", "milliseconds")


def _curve_values(query: Query) -> tuple[float, float, float]:
    """Return the values of `CURVES`."""
    points, feasible, best, _ = query.answer
    return feasible / points if points else np.nan, best, 1e3 * query.seconds


@dataclass
class QueryTally:
    """What became of the queries of one service for the same legs.

    Attributes:
        queries: Their number.
        refused: How many were refused.
        points: Candidate footholds, or legs times heights.
        feasible: How many of them are feasible, or have a step.
        verdicts: How many footholds have which verdict.
        least, greatest: Least and greatest best value, see `Summary`.
        seconds: Sum of the times to the response [s].
        longest: Longest time to the response [s].
        exact: Answers that are the recorded ones, bit for bit.
        same: Answers that are the recorded ones but for rounding; the exact ones included.
    """

    queries: int = 0
    refused: int = 0
    points: int = 0
    feasible: int = 0
    verdicts: Counter[Verdict] = field(default_factory=Counter)
    least: float = np.nan
    greatest: float = np.nan
    seconds: float = 0.0
    longest: float = 0.0
    exact: int = 0
    same: int = 0

    def add(self, query: Query) -> None:
        """Take up a query."""
        answer = query.answer
        self.queries += 1
        self.refused += bool(query.refused)
        self.points += answer.points
        self.feasible += answer.feasible
        self.verdicts.update(answer.verdicts)
        self.least = float(np.fmin(self.least, answer.best))
        self.greatest = float(np.fmax(self.greatest, answer.best))
        self.seconds += query.seconds
        self.longest = max(self.longest, query.seconds)
        self.exact += query.exact
        self.same += query.difference is None


class QueryFindings:
    """Gathers what stands out, in constant memory.

    Attributes:
        tallies: Tallies by service and legs.
        refused: The first queries that were refused.
        hopeless: The first that were answered, but without a feasible point.
        different: The first whose answer is not the recorded one.
        curves: Feasible share, best value and time to the response [ms] by service.
    """

    def __init__(self) -> None:
        self.tallies: defaultdict[tuple[str, str], QueryTally] = defaultdict(QueryTally)
        self.refused: list[Query] = []
        self.hopeless: list[Query] = []
        self.different: list[Query] = []
        self.curves: defaultdict[str, Envelope] = defaultdict(lambda: Envelope(CURVES))

    def add(self, queries: Sequence[Query]) -> None:
        """Take up queries."""
        for service in dict.fromkeys(query.service for query in queries):
            asked = [query for query in queries if query.service == service]
            times = np.array([query.time for query in asked])
            self.curves[service].add(times, np.array([_curve_values(query) for query in asked]))
        for query in queries:
            key = (query.service, query.legs)
            known = key in self.tallies or len(self.tallies) < MOST_TALLIES
            self.tallies[key if known else (query.service, OTHERS)].add(query)
            hopeless = query.answer.points and not query.answer.feasible
            for stands_out, told in (
                (query.refused, self.refused),
                (hopeless, self.hopeless),
                (query.difference, self.different),
            ):
                if stands_out and len(told) < MOST_TOLD:
                    told.append(query)
