# SPDX-License-Identifier: Apache-2.0
"""Count messages that were lost on their way, by the numbers that their publishers give them.

The middleware's own event `message_lost` is of no use: rmw_fastrtps 8.4 takes it with two locks in
the order opposite to that of its receiving thread, and a flood that loses messages stops both.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription


class SequenceGaps:
    """Finds what is missing in the numbers of a topic's messages.

    A publisher numbers its messages one after the other. Where there are several, a message does
    not tell whose it is: it is taken to continue the sequence next below it.

    Args:
        publishers: Returns how many publishers the topic has.
    """

    def __init__(self, publishers: Callable[[], int]) -> None:
        self._publishers = publishers
        self._last: list[int] = []  # number of each publisher, the latest heard at the end

    def before(self, number: int) -> int:
        """Return how many messages were lost before the one of a number, since those known."""
        below = max((last for last in self._last if last < number), default=None)
        is_new = below is None or (
            below < number - 1 and len(self._last) < self._publishers()  # one is heard late
        )
        if below is None or is_new:
            while len(self._last) >= max(1, self._publishers()):
                self._last.pop(0)  # of one that has gone
            self._last.append(number)
            return 0
        self._last.remove(below)
        self._last.append(number)
        return number - below - 1


def subscribe_raw(
    node: Node,
    message_type: Any,
    topic: str,
    receive: Callable[[bytes], None],
    lose: Callable[[int], None],
    qos: QoSProfile,
    **options: Any,
) -> Subscription:
    """Subscribe to messages as they come, without decoding them.

    Args:
        node: Who subscribes.
        message_type: Type of the messages.
        topic: Name of the topic.
        receive: Called with each message.
        lose: Called before it with the number of messages that were lost, if any were.
        qos: Quality of service.
        options: What else `Node.create_subscription` takes.
    """

    def take(data: bytes, info: dict[str, Any]) -> None:
        number = info["publication_sequence_number"]
        if number is not None and (lost := gaps.before(number)):  # not every middleware numbers
            lose(lost)
        receive(data)

    subscription = node.create_subscription(
        message_type, topic, _WithInfo(take), qos, raw=True, **options
    )
    gaps = SequenceGaps(subscription.get_publisher_count)
    return subscription


class _WithInfo:
    """A callback with a message and what is known of it, whichever executor calls.

    The `EventsExecutor` of rclpy 7.1 gives the two as one tuple.
    """

    def __init__(self, callback: Callable[[bytes, dict[str, Any]], None]) -> None:
        self._callback = callback
        self.__signature__ = inspect.signature(callback)  # by it rclpy knows what is wanted

    def __call__(self, *given: Any) -> None:
        self._callback(*(given[0] if len(given) == 1 else given))
