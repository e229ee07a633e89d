# SPDX-License-Identifier: Apache-2.0
"""The node that records topics as they are, without decoding them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from leg_msgs_py.losses import subscribe_raw
from leg_msgs_py.recordings.definitions import message_class
from leg_msgs_py.recordings.durable_bag import DurableBag, RecordedTopic
from leg_msgs_py.recordings.errors import UnknownTypeError
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

# What tells a leg's life, in any namespace; in these patterns `*` stands for slashes, too.
SUITE_TOPICS = (
    *("*/joint_states", "*/wrench", "*/statics/*", "*/maps/*"),
    *("*/tf", "*/tf_static", "*/robot_description", "/diagnostics", "/clock"),
)
SERVICE_EVENTS = "/_service_event"  # the only hidden topics that are recorded
# The middleware keeps this many messages for a reader that is late; beyond, it forgets silently.
DEPTH = 10_000
DISCOVERY_PERIOD = 0.1  # [s]
REPORT_PERIOD = 1.0  # of the diagnostics [s]
SPIN_PERIOD = 0.1  # within it a recording ends when told to [s]


class Recorder(Node):
    """Subscribes to every topic that is wanted as soon as it has a publisher.

    Args:
        bag: Where the messages go.
        topics: Patterns of the names of topics to record; a `*` stands for anything.

    Attributes:
        lost: Messages that the middleware lost on their way, by topic.
        remarks: What cannot be recorded, and why; every remark once.
    """

    def __init__(self, bag: DurableBag, topics: Collection[str] = SUITE_TOPICS) -> None:
        super().__init__("leg_recorder", enable_rosout=False, start_parameter_services=False)
        self.lost: Counter[str] = Counter()
        self.remarks: list[str] = []
        self._bag = bag
        self._patterns = topics
        self._seen: set[str] = set()
        self._reported = (time.monotonic(), 0)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DISCOVERY_PERIOD, self._discover)
        self.create_timer(REPORT_PERIOD, self._report)

    def _discover(self) -> None:
        for topic, types in self.get_topic_names_and_types():
            if not self._is_wanted(topic):
                continue
            if topic not in self._seen:
                self._begin(topic)
            if len(types) > 1 and topic in self._bag.topics:
                kept = self._bag.topics[topic].type
                others = ", ".join(kind for kind in types if kind != kept)
                self._remark(f"{topic}: only its messages of {kept} are recorded, not of {others}")

    def _is_wanted(self, topic: str) -> bool:
        hidden = "/_" in topic.removesuffix(SERVICE_EVENTS)
        return not hidden and any(fnmatchcase(topic, pattern) for pattern in self._patterns)

    def _begin(self, topic: str) -> None:
        """Begin to record a topic if it has publishers."""
        publishers = self.get_publishers_info_by_topic(topic)
        if not publishers:
            return
        self._seen.add(topic)
        kind = publishers[0].topic_type
        try:
            self._subscribe(
                topic, kind, [p.qos_profile for p in publishers if p.topic_type == kind]
            )
        except UnknownTypeError as error:
            self._remark(f"{topic}: {error}; not recorded")

    def _subscribe(self, topic: str, type_name: str, offered: Sequence[QoSProfile]) -> None:
        message_type = message_class(type_name)
        recorded = self._bag.add_topic(topic, type_name, [recorded_qos(qos) for qos in offered])
        subscribe_raw(
            self,
            message_type,
            topic,
            partial(self._receive, recorded),
            partial(self._note_loss, topic),
            matching_qos(offered),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=lambda _: self._remark(
                    f"{topic}: a publisher that came later offers less than the first ones (best "
                    "effort, or volatile); its messages are not recorded"
                ),
            ),
        )
        self.get_logger().info(f"recording {topic} ({type_name})")

    def _receive(self, topic: RecordedTopic, data: bytes) -> None:
        self._bag.put(topic, time.time_ns(), data)

    def _note_loss(self, topic: str, count: int) -> None:
        self.lost[topic] += count

    def _remark(self, text: str) -> None:
        if text not in self.remarks:
            self.remarks.append(text)
            self.get_logger().warning(text)

    def _report(self) -> None:
        """Publish the health of the recording; it is recorded with the rest."""
        topics = self._bag.topics.values()
        written, dropped = (sum(getattr(t, key) for t in topics) for key in ("written", "dropped"))
        lost = self.lost.total()
        (began, before), self._reported = self._reported, (time.monotonic(), written)
        values = {
            "messages": str(written),
            "rate [Hz]": f"{(written - before) / (self._reported[0] - began):.1f}",
            "dropped messages": str(dropped),
            "messages lost by the middleware": str(lost),
            "waiting [MiB]": f"{self._bag.waiting / 2**20:.1f}",
            "remarks": "; ".join(self.remarks),
        }
        level, message = DiagnosticStatus.OK, "ok"
        if self._bag.failure is not None:
            level, message = DiagnosticStatus.ERROR, str(self._bag.failure)
        elif dropped or lost:
            level, message = DiagnosticStatus.WARN, f"{dropped} messages dropped, {lost} lost"
        elif self.remarks:
            level, message = DiagnosticStatus.WARN, self.remarks[-1]
        status = DiagnosticStatus(
            level=level,
            name=f"{self.get_fully_qualified_name()}: recording",
            message=message,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        report = DiagnosticArray(status=[status])
        report.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(report)


def spin(node: Node, is_over: Callable[[], bool]) -> None:
    """Serve a node until something is over.

    rclpy's executor of events takes a seventh of the processor time of the others and loses nothing
    where they do. Its `spin` never returns and turns idly, hence the loop.
    """
    executor: Executor = EventsExecutor(context=node.context)
    executor.add_node(node)
    try:
        while not is_over():
            executor.spin_until_future_complete(Future(), SPIN_PERIOD)
        executor.spin_until_future_complete(Future(), SPIN_PERIOD)  # what has arrived before
    finally:
        executor.remove_node(node)
        executor.shutdown()


# --------------------------------------------------------------------------- quality of service


def matching_qos(offered: Sequence[QoSProfile]) -> QoSProfile:
    """Return the best quality of service that all publishers of a topic can meet."""
    reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def recorded_qos(offered: QoSProfile) -> Qos:
    """Return a publisher's quality of service as recordings have it: by the same numbers."""

    def span(duration: Any) -> QosTime:
        return QosTime(*divmod(duration.nanoseconds, 10**9))

    return Qos(
        QosHistory(offered.history.value),
        offered.depth,
        QosReliability(offered.reliability.value),
        QosDurability(offered.durability.value),
        span(offered.deadline),
        span(offered.lifespan),
        QosLiveliness(offered.liveliness.value),
        span(offered.liveliness_lease_duration),
        offered.avoid_ros_namespace_conventions,
    )
