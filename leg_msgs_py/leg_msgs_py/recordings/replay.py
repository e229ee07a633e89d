"""Play recordings into live nodes and collect what they publish, to test gaits without a robot.

    from leg_msgs_py.recordings.comparison import Tolerance, assert_same
    from leg_msgs_py.recordings.replay import Replay, read_messages

    with Replay() as replay:  # the nodes of the robot run already
        outputs = replay.play("walk", ["/joint_states"], ["/statics/leg_states"], rate=math.inf)
    expected = read_messages("walk_judged", outputs)
    assert_same(outputs, expected, {"legs.load_capacity": Tolerance(relative=1e-9)})

Tests with pytest find `Replay` as a fixture, see `leg_msgs_py.recordings.pytest_replay`.
"""

from __future__ import annotations

import itertools
import math
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple, TypeAlias

import rclpy
from builtin_interfaces.msg import Time
from leg_msgs_py.recordings.bags import Bag, BagMessage, Topic
from leg_msgs_py.recordings.definitions import message_class, message_definition
from leg_msgs_py.recordings.recorder import matching_qos, spin
from rcl_interfaces.srv import GetParameters  # type: ignore[import-untyped]
from rclpy.context import Context
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosbags.interfaces import QosDurability
from rosgraph_msgs.msg import Clock  # type: ignore[import-untyped]

START_TIMEOUT = 30.0  # for the nodes to be found [s]
POLL_PERIOD = 0.01  # [s]
DEPTH = 1000  # messages kept for a reader that is late
CLOCK_PERIOD = 10_000_000  # between messages of /clock, in the time of the recording [ns]

Stamp: TypeAlias = bytes  # as it is serialised

_NAMELESS = ("_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_")

# How far the player is ahead of the answers, on each topic, when it plays as fast as possible: less
# than the five messages that a subscriber with the profile of sensor data keeps.
WINDOW = 4
# Inputs without an answer this long after the last one get none, such as those refused [s].
PATIENCE = 1.0
# The names of nodes and their services come at most so long after their endpoints, or never, if
# they are not of ROS or have no parameters [s].
DISCOVERY_PATIENCE = 3.0


class ReplayError(Exception):
    """A recording cannot be played, or the nodes do not take part."""


def read_messages(bag: str | os.PathLike[str], topics: Collection[str]) -> dict[str, list[Any]]:
    """Return messages of a recording by topic, in the order of recording.

    Args:
        bag: The recording.
        topics: Its topics to read.

    Raises:
        BagError: If it is no recording.
        ReplayError: If it lacks a topic, has another definition of a type than is installed, or a
            message is garbled.
        UnknownTypeError: If a type is not installed.
    """
    recording = Bag(bag)
    _check_topics(recording, topics)
    messages: dict[str, list[Any]] = {topic: [] for topic in topics}
    for message in recording.messages(topics):
        kind, so_far = message_class(message.type), messages[message.topic]
        try:
            so_far.append(deserialize_message(message.data, kind))
        except Exception as error:  # of rclpy's implementation, which does not export its class
            raise ReplayError(
                f"{bag}: message {len(so_far)} of {message.topic} is no {message.type}: {error}"
            ) from None
    return messages


class Replay:
    """Plays recordings into live nodes, as a context manager.

    It has a ROS context of its own, so that it neither needs nor disturbs that of the caller.

    Args:
        namespace: Namespace of the nodes; their topics have it before the recorded names.
    """

    def __init__(self, namespace: str = "") -> None:
        self._prefix = f"/{namespace.strip('/')}" if namespace else ""

    def __enter__(self) -> Replay:
        """Join the ROS network."""
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            "leg_replay",
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._ending = threading.Event()
        self._thread = threading.Thread(
            target=spin, args=(self._node, self._ending.is_set), name="replay", daemon=True
        )
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the ROS network."""
        self._ending.set()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()

    def play(
        self,
        bag: str | os.PathLike[str],
        topics: Collection[str] = ("/joint_states",),
        collect: Collection[str] = ("/statics/leg_states",),
        *,
        rate: float = 1.0,
        clock: bool = False,
        timeout: float = START_TIMEOUT,
    ) -> dict[str, list[Any]]:
        """Play a recording and return what the nodes made of it.

        It begins when all who subscribe to the topics, and all who publish what is collected, are
        connected. It ends when the last input is answered, or has found no answer for `PATIENCE`.
        An output answers the input that has the same stamp, and tells that the nodes are done
        with all that was sent before it.

        Args:
            bag: The recording.
            topics: Topics to play, byte for byte as they were recorded.
            collect: Topics to collect.
            rate: Speed; 1 as it was recorded, 2 twice as fast, `math.inf` as fast as the nodes
                answer, which loses nothing if the outputs have the stamps of their inputs.
            clock: Whether to publish the time of the recording as /clock, for nodes with the
                parameter `use_sim_time`.
            timeout: How long to wait for the nodes [s].

        Returns:
            Messages by topic, in the order they came.

        Raises:
            BagError: If it is no recording.
            ReplayError: If it lacks a topic or has another definition of a type than is installed,
                or if nodes are missing or end.
            UnknownTypeError: If a type is not installed.
        """
        if not rate > 0.0:
            raise ReplayError(f"rate must be > 0, got {rate}")
        recording = Bag(bag)
        _check_topics(recording, topics)
        session = _Session(self._node, self._prefix, time.monotonic() + timeout)
        try:
            for name in collect:
                session.open_output(name)
            for name in topics:
                session.open_input(recording.topics[name])
            if clock:
                session.open_clock()
            session.connect()
            session.play(recording.messages(topics), rate)
        finally:
            session.close()
        return {name: output.messages() for name, output in session.outputs.items()}


class _Output(NamedTuple):
    """What is collected of a topic."""

    type: Any
    subscription: Subscription
    data: list[bytes]

    def messages(self) -> list[Any]:
        """Return the messages that came."""
        return [deserialize_message(data, self.type) for data in self.data]


class _Session:
    """One playing of a recording.

    Args:
        node: Node to play with; it spins in another thread.
        prefix: What the names of topics have before the recorded ones.
        deadline: When all must be connected (monotonic) [s].

    Attributes:
        outputs: What is collected, by topic.
    """

    def __init__(self, node: Node, prefix: str, deadline: float) -> None:
        self.outputs: dict[str, _Output] = {}
        self._inputs: dict[str, Publisher] = {}
        self._clock: Publisher | None = None
        self._node = node
        self._prefix = prefix
        self._deadline = deadline
        self._flow = _Flow()

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
            self._flow.answer(_stamp(message))

        qos = matching_qos([each.qos_profile for each in publishers])
        subscription = self._node.create_subscription(kind, name, receive, qos, raw=True)
        self.outputs[topic] = _Output(kind, subscription, data)

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
        pace = _Pace(rate)
        before: int | None = None
        for message in messages:
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
            self._flow.send(message.topic, _stamp(message.data))
            self._inputs[message.topic].publish(message.data)
        self._flow.wait_for_all()
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


class _Pace:
    """Turns the times of a recording into waits.

    Args:
        rate: Speed; infinite for no wait.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._begin: tuple[float, int] | None = None

    def wait_until(self, instant: int) -> None:
        """Wait until it is time for what was recorded at an instant [ns]."""
        now = time.monotonic()
        began, first = self._begin = self._begin or (now, instant)
        pause = began + 1e-9 * (instant - first) / self._rate - now
        if pause > 0.0:
            time.sleep(pause)


class _Flow:
    """The inputs that wait for their answers."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._waiting: deque[tuple[str, Stamp]] = deque()  # topic and stamp, in the order sent
        self._topics: Counter[str] = Counter()  # how many of each wait
        self._stamps: Counter[Stamp] = Counter()

    def send(self, topic: str, stamp: Stamp) -> None:
        """Note an input."""
        with self._changed:
            self._waiting.append((topic, stamp))
            self._topics[topic] += 1
            self._stamps[stamp] += 1

    def answer(self, stamp: Stamp) -> None:
        """Note an output: inputs up to the one with its stamp are dealt with."""
        with self._changed:
            done = not self._stamps[stamp]
            while not done:
                topic, first = self._waiting.popleft()
                self._topics[topic] -= 1
                self._stamps[first] -= 1
                done = first == stamp
            self._changed.notify()

    def wait_for_room(self, topic: str) -> None:
        """Wait until few enough inputs of a topic are unanswered for another one."""
        self._wait(lambda: self._topics[topic] < WINDOW)

    def wait_for_all(self) -> None:
        """Wait until every input is answered."""
        self._wait(lambda: not self._waiting)

    def _wait(self, is_over: Callable[[], bool]) -> None:
        """Wait for answers; what has none within `PATIENCE` gets none."""
        with self._changed:
            while not is_over():
                if not self._changed.wait(PATIENCE):
                    for each in (self._waiting, self._topics, self._stamps):
                        each.clear()


def _check_topics(recording: Bag, topics: Collection[str]) -> None:
    """Raise unless the recording has the topics and their types are those installed."""
    for name in topics:
        if name not in recording.topics:
            known = ", ".join(recording.topics)
            raise ReplayError(f"{recording.path} has no topic {name!r}; it has {known}")
        kind = recording.topics[name].type
        if recording.types.hash_rihs01(kind) != message_definition(kind).hash:
            raise ReplayError(
                f"{recording.path}: {name}: {kind} is recorded with another definition than the "
                "one that is installed"
            )


def _stamp(message: bytes) -> Stamp:
    """Return the time that a serialised message begins with, if it begins with a header."""
    return message[4:12]


def _clock(instant: int) -> Clock:
    seconds, nanoseconds = divmod(instant, 10**9)
    return Clock(clock=Time(sec=seconds, nanosec=nanoseconds))
