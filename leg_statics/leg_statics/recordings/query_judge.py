# SPDX-License-Identifier: Apache-2.0
"""Queries of planners in a recording, answered again by the services that the nodes answer with.

A node whose parameter `service_events` is "contents" publishes its requests and responses. Every
request is answered anew, with the robot, the limits and the grounds of the judge, and the answer is
compared with the recorded one.
"""

from __future__ import annotations

import array
import sys
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import ErrorCode
from leg_msgs_py.arrays import to_field
from leg_msgs_py.recordings.bags import Bag, BagMessage
from leg_msgs_py.recordings.comparison import Difference, Tolerance, differences
from leg_msgs_py.recordings.definitions import message_definition

from leg_kinematics.errors import ValueRangeError
from leg_kinematics.nodes.frames import no_transforms
from leg_kinematics.nodes.service import Service, Summary
from leg_kinematics.nodes.services import SERVICES as KINEMATICS
from leg_kinematics.robot import Leg, Mount, Robot
from leg_statics.grounds import Grounds
from leg_statics.map_jobs import MapKey, MapMemory
from leg_statics.maps import IndexMap
from leg_statics.nodes.services import SERVICES as STATICS
from leg_statics.recordings.findings import Envelope

REQUEST_RECEIVED, RESPONSE_SENT = 1, 2  # of service_msgs/ServiceEventInfo, told by the node
MOST_WAITING = 256  # requests without a response yet; the node queues no more
MOST_QUERIES = 4096  # that wait to be taken
MOST_TALLIES = 100  # requests may name anything as legs
OTHERS = "others"
MOST_TOLD = 20  # of each kind of query that stands out
EXACT, SAME = Tolerance(), Tolerance(absolute=1e-9, relative=1e-9)  # other machines round otherwise
NO_ANSWER = ("header", "error")  # fields that tell when, and what went wrong


# Services by the names of their nodes, without those that change a node.
SERVICES = {
    node: tuple(service for service in services if not service.changes_host)
    for node, services in {**KINEMATICS, **STATICS}.items()
}


class _Answerer(NamedTuple):
    """Answers as the nodes do; they took the requests, so their limits allow them."""

    robot: Robot
    grounds: Grounds
    max_points: int = sys.maxsize
    max_steps: int = sys.maxsize

    def base_pose(self, frame_id: str, stamp: Any) -> Mount:
        """Raise a RequestError: what tf told the node is not known."""
        raise no_transforms(self.robot, frame_id, "tf of a recording is not read")

    def plane(self, leg: Leg, key: MapKey) -> IndexMap:
        """Return the map of a plane."""
        return MapMemory(0).plane(key)


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
        node: Name of the statics node; the other nodes are in the same namespace.

    Attributes:
        inputs: Names of the topics to take.
        services: Services whose events they are, by name.
        without_contents: Requests of which only the metadata were recorded.
        without_request: Responses whose request was not recorded.
        without_transform: Requests that the node answered with what tf told, which is not judged.

    Raises:
        ValueRangeError: If a topic has another type of messages, or one of another version.
    """

    def __init__(self, bag: Bag, grounds: Grounds, node: str = "/statics") -> None:
        topics = _event_topics(node)
        self._services = {topic: each for topic, each in topics.items() if topic in bag.topics}
        for topic, service in self._services.items():
            event_type = f"leg_msgs/srv/{service.type.__name__}_Event"
            if bag.topics[topic].type != event_type:
                raise ValueRangeError(
                    f"topic {topic}: got {bag.topics[topic].type}; allowed: {event_type}"
                )
            if bag.types.hash_rihs01(event_type) != message_definition(event_type).hash:
                raise ValueRangeError(
                    f"topic {topic}: {event_type} is not defined there as it is installed here: "
                    "another version of leg_msgs"
                )
        self.inputs = set(self._services)
        self.services = {service.name: service for service in self._services.values()}
        self.without_contents = 0
        self.without_request = 0
        self.without_transform = 0
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
            refused = event.response[0].error.code != ErrorCode.SUCCESS
            if not refused and _asks_tf(request.content, robot):
                self.without_transform += 1
                return
            seconds = (nanoseconds - request.stamp) / 1e9
            service = self._services[message.topic]
            query = self._query(service, robot, request, event.response[0], seconds)
            self._judged.append(query)

    def judge(self) -> list[Query]:
        """Return the queries that were judged since the last call."""
        judged, self._judged = self._judged, []
        return judged

    def _query(
        self, service: Service, robot: Robot, request: _Request, recorded: Any, seconds: float
    ) -> Query:
        wanted, found = service.type.Response(), service.type.Response()
        _copy(recorded, wanted)
        if wanted.error.code == ErrorCode.TOO_LARGE:  # the node's limits are not recorded
            found.error.code = ErrorCode.TOO_LARGE
        else:
            found = service.answer(_Answerer(robot, self._grounds), request.content, found)
        exact = not _differences(service, wanted, found, EXACT)
        off = () if exact else _differences(service, wanted, found, SAME)
        code = wanted.error.code
        return Query(
            service.name,
            _legs(request.content),
            request.time,
            seconds,
            "" if code == ErrorCode.SUCCESS else _error_name(code),
            wanted.error.message,
            service.summary(found),
            exact,
            next(iter(off), None),
        )


def _event_topics(node: str) -> dict[str, Service]:
    """Return the services by the topics of their events."""
    namespace = node.rpartition("/")[0]
    nodes = {name: f"{namespace}/{name}" for name in SERVICES} | {"statics": node}
    return {
        f"{nodes[name]}/{service.name}/_service_event": service
        for name, services in SERVICES.items()
        for service in services
    }


def _asks_tf(request: Any, robot: Robot) -> bool:
    """Tell whether a request is in a frame of which it does not tell where the robot is."""
    if not hasattr(request, "base_pose") or len(request.base_pose):
        return False
    own = {"", robot.base_frame, *(leg.frame for leg in robot.legs.values())}
    return request.header.frame_id not in own


def _legs(request: Any) -> str:
    """Return the legs that a request names, separated by blanks."""
    return " ".join(request.legs) if hasattr(request, "legs") else str(request.leg)


def _differences(
    service: Service, wanted: Any, found: Any, tolerance: Tolerance
) -> Sequence[Difference]:
    """Return where an answer is not the recorded one."""
    codes = wanted.error.code, found.error.code
    if codes[0] != codes[1]:
        return [Difference(service.name, 0, "error.code", *map(_error_name, codes))]
    return differences(
        {service.name: [found]}, {service.name: [wanted]}, {"*": tolerance}, NO_ANSWER
    )


def _copy(recorded: Any, message: Any) -> None:
    """Fill a message of ROS from a decoded one, but for its header."""
    for name in message.get_fields_and_field_types():
        value, place = getattr(recorded, name), getattr(message, name)
        if name == "header":
            continue
        if hasattr(place, "get_fields_and_field_types"):
            _copy(value, place)
        elif isinstance(place, array.array):
            setattr(message, name, to_field(value, value.dtype))
        elif isinstance(value, np.ndarray) and isinstance(place, list):  # booleans
            setattr(message, name, value.tolist())
        else:
            setattr(message, name, value)


def _error_name(code: int) -> str:
    """Return the name of an error code."""
    constants = (name for name in dir(ErrorCode) if name.isupper() and name[0] != "_")
    return next((name for name in constants if getattr(ErrorCode, name) == code), str(code))


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
    verdicts: Counter[IntEnum] = field(default_factory=Counter)
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
