# SPDX-License-Identifier: Apache-2.0
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

import os
import threading
import time
from collections.abc import Collection
from typing import Any

import rclpy
from leg_msgs_py.recordings.bags import Bag
from leg_msgs_py.recordings.definitions import message_class, message_definition
from leg_msgs_py.recordings.errors import ReplayError
from leg_msgs_py.recordings.recorder import spin
from leg_msgs_py.recordings.replay_flow import PATIENCE
from leg_msgs_py.recordings.replay_session import Session
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions

START_TIMEOUT = 30.0  # for the nodes to be found [s]


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
        patience: float = PATIENCE,
    ) -> dict[str, list[Any]]:
        """Play a recording and return what the nodes made of it.

        It begins when all who subscribe to the topics, and all who publish what is collected, are
        connected. It ends when the last input is answered, or has found no answer for `patience`.
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
            patience: How long to wait for an answer; inputs that find none later than that, such
                as those refused, get none [s].

        Returns:
            Messages by topic, in the order they came.

        Raises:
            BagError: If it is no recording.
            ReplayError: If it lacks a topic or has another definition of a type than is installed,
                if nodes are missing or end, or if nothing at all is answered.
            UnknownTypeError: If a type is not installed.
        """
        if not rate > 0.0:
            raise ReplayError(f"rate must be > 0, got {rate}")
        recording = Bag(bag)
        _check_topics(recording, topics)
        session = Session(self._node, self._prefix, time.monotonic() + timeout, patience)
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
