# SPDX-License-Identifier: Apache-2.0
"""One playing of a recording: connected before it begins, over when its outputs are in."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from leg_msgs_py.recordings.bag_files import Topic
from leg_msgs_py.recordings.bags import BagMessage
from leg_msgs_py.recordings.definitions import message_class
from leg_msgs_py.recordings.errors import ReplayError
from leg_msgs_py.recordings.recorder import matching_qos
from leg_msgs_py.recordings.replay_flow import Flow, Pace, stamp_of
from rcl_interfaces.srv import GetParameters  # type: ignore[import-untyped]
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosbags.interfaces import QosDurability
from rosgraph_msgs.msg import Clock  # type: ignore[import-untyped]

POLL_PERIOD = 0.01  # [s]
DEPTH = 1000  # messages kept for a reader that is late
CLOCK_PERIOD = 10_000_000  # between messages of /clock, in the time of the recording [ns]
# The names of nodes and their services come at most so long after their endpoints, or never, if
# they are not of ROS or have no parameters [s].
DISCOVERY_PATIENCE = 3.0

_NAMELESS = ("_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_")


class Output(NamedTuple):
    """What is collected of a topic."""

    type: Any
    subscription: Subscription
    data: list[bytes]

    def messages(self) -> list[Any]:
        """Return the messages that came."""
        return [deserialize_message(data, self.type) for data in self.data]


class Session:
    """One playing of a recording.

    Args:
        node: Node to play with; it spins in another thread.
        prefix: What the names of topics have before the recorded ones.
        deadline: When all must be connected (monotonic) [s].
        patience: How long to wait for an answer [s].

    Attributes:
        outputs: What is collected, by topic.
    """

    def __init__(self, node: Node, prefix: str, deadline: float, patience: float) -> None:
        self.outputs: dict[str, Output] = {}
        self._inputs: dict[str, Publisher] = {}
        self._clock: Publisher | None = None
        self._node = node
        self._prefix = prefix
        self._deadline = deadline
        self._flow = Flow(patience)

    def open_output(self, topic: str) -> None:
        """Subscribe to a topic once it is published."""
        name = self._prefix + topic
        publishers = self._wait_for(
            lambda: self._node.get_publishers_info_by_topic(name), f"nobody publishes {name}"
        )
        kind = message_class(publishers[0].topic_type)
        data: list[bytes] = []

        def receive(message: bytes) -> None:
            data.append(message)
            self._flow.answer(stamp_of(message))

        qos = matching_qos([each.qos_profile for each in publishers])
        subscription = self._node.create_subscription(kind, name, receive, qos, raw=True)
        self.outputs[topic] = Output(kind, subscription, data)

    def open_input(self, topic: Topic) -> None:
        """Make the publisher of a recorded topic; it is reliable, which suits every subscriber."""
        latched = topic.qos and all(
            qos.durability == QosDurability.TRANSIENT_LOCAL for qos in topic.qos
        )
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        self._inputs[topic.name] = self._node.create_publisher(
            message_class(topic.type),
            self._prefix + topic.name,
            QoSProfile(depth=DEPTH, durability=durability),
        )

    def open_clock(self) -> None:
        """Make the publisher of /clock."""
        self._clock = self._node.create_publisher(Clock, "/clock", DEPTH)

    def connect(self) -> None:
        """Wait until no message will be lost for want of a connection, in either direction.

        That this side has found another one does not tell that the other one has found this one.
        But what a participant announces arrives in order: a node that answers a service whose
        client was made last knows all that was made before.
        """
        for publisher in self._publishers():
            self._wait_for_subscribers(publisher)
        for output in self.outputs.values():
            subscription = output.subscription
            self._wait_for(
                subscription.get_publisher_count, f"nobody publishes {subscription.topic_name}"
            )
        self._wait_a_moment(lambda: _NAMELESS not in self._peers())
        for peer in self._peers() - {_NAMELESS}:
            self._greet(*peer)

    def play(self, messages: Iterator[BagMessage], rate: float) -> None:
        """Publish messages, and wait for the last outputs."""
        pace = Pace(rate)
        sent = 0
        before: int | None = None
        for message in messages:
            self._check_nodes()
            if self._clock is not None:
                start = message.time if before is None else before
                ticks = range(start + CLOCK_PERIOD, message.time, CLOCK_PERIOD)
                for instant in itertools.chain(ticks, [message.time]):
                    pace.wait_until(instant)
                    self._clock.publish(_clock(instant))
            before = message.time
            pace.wait_until(message.time)
            if math.isinf(rate):
                self._flow.wait_for_room(message.topic)
            if self._flow.is_hopeless:
                break
            self._flow.send(message.topic, stamp_of(message.data))
            sent += 1
            self._inputs[message.topic].publish(message.data)
        self._flow.wait_for_all()
        self._check_nodes()
        if sent and self.outputs and not any(output.data for output in self.outputs.values()):
            raise ReplayError(
                f"nothing came on {', '.join(self.outputs)} for {sent} messages on "
                f"{', '.join(self._inputs)}: do they name the joints of the robot that the nodes "
                "serve? /diagnostics tells what the nodes make of them"
            )

    def _check_nodes(self) -> None:
        for topic, output in self.outputs.items():
            if not output.subscription.get_publisher_count():
                raise ReplayError(f"{topic}: its node ended after {len(output.data)} messages")

    def close(self) -> None:
        """Withdraw from the network."""
        for publisher in self._publishers():
            self._node.destroy_publisher(publisher)
        for output in self.outputs.values():
            self._node.destroy_subscription(output.subscription)

    def _publishers(self) -> list[Publisher]:
        return [*self._inputs.values(), *([self._clock] if self._clock is not None else [])]

    def _peers(self) -> set[tuple[str, str]]:
        """Return name and namespace of the nodes at the other ends."""
        endpoints: list[TopicEndpointInfo] = []
        for publisher in self._publishers():
            endpoints += self._node.get_subscriptions_info_by_topic(publisher.topic_name)
        for output in self.outputs.values():
            endpoints += self._node.get_publishers_info_by_topic(output.subscription.topic_name)
        return {(endpoint.node_name, endpoint.node_namespace) for endpoint in endpoints}

    def _wait_for_subscribers(self, publisher: Publisher) -> None:
        topic = publisher.topic_name
        self._wait_for(publisher.get_subscription_count, f"nobody subscribes to {topic}")
        self._wait_for(
            lambda: publisher.get_subscription_count() >= self._node.count_subscribers(topic),
            f"a subscriber to {topic} asks for another quality of service",
        )

    def _greet(self, name: str, namespace: str) -> None:
        """Wait until a node answers; one without parameters cannot be asked."""
        service = f"{namespace.rstrip('/')}/{name}/get_parameters"

        def is_offered() -> bool:
            try:
                offered = self._node.get_service_names_and_types_by_node(name, namespace)
            except NodeNameNonExistentError:
                raise ReplayError(f"{name} has ended") from None
            return service in dict(offered)

        if not self._wait_a_moment(is_offered):
            return
        client = self._node.create_client(GetParameters, service)
        try:
            self._wait_for(client.service_is_ready, f"{service} is not offered")
            answer = client.call_async(GetParameters.Request())
            self._wait_for(answer.done, f"{service} does not answer")
        finally:
            self._node.destroy_client(client)

    @staticmethod
    def _wait_a_moment(is_so: Callable[[], bool]) -> bool:
        """Tell whether something becomes so within `DISCOVERY_PATIENCE`."""
        patience = time.monotonic() + DISCOVERY_PATIENCE
        while not (so := is_so()) and time.monotonic() < patience:
            time.sleep(POLL_PERIOD)
        return so

    def _wait_for(self, find: Callable[[], Any], failure: str) -> Any:
        """Return the first true value of a function."""
        while not (found := find()):
            if time.monotonic() > self._deadline:
                raise ReplayError(failure)
            time.sleep(POLL_PERIOD)
        return found


def _clock(instant: int) -> Clock:
    seconds, nanoseconds = divmod(instant, 10**9)
    return Clock(clock=Time(sec=seconds, nanosec=nanoseconds))
