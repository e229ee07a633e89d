# SPDX-License-Identifier: Apache-2.0
"""Lost messages are counted by the numbers of those that come, without the middleware's events."""

import itertools

import pytest
import rclpy
from hypothesis import given
from hypothesis import strategies as st
from leg_msgs_py.losses import SequenceGaps, subscribe_raw
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import UInt32

arrivals = st.lists(st.booleans(), max_size=60)


@given(st.integers(1, 10**6), arrivals)
def test_of_one_publisher_every_loss_between_two_messages_is_counted(first, arrives):
    gaps = SequenceGaps(lambda: 1)
    numbers = [first, *(first + 1 + k for k, arrived in enumerate(arrives) if arrived)]
    lost = [after - before - 1 for before, after in itertools.pairwise(numbers)]
    assert [gaps.before(n) for n in numbers] == [0, *lost]


@given(st.lists(arrivals, min_size=2, max_size=4), st.randoms(use_true_random=False))
def test_of_several_publishers_the_sum_is_right_in_whatever_order_they_come(publishers, random):
    sent = [(1000 * p, [1, *arrives, 1]) for p, arrives in enumerate(publishers)]
    waiting = [[start + k for k, arrived in enumerate(all_) if arrived] for start, all_ in sent]
    gaps = SequenceGaps(lambda: len(waiting))
    lost = sum(gaps.before(numbers.pop(0)) for numbers in waiting)
    while left := [numbers for numbers in waiting if numbers]:
        lost += gaps.before(random.choice(left).pop(0))
    assert lost == sum(arrives.count(False) for arrives in publishers)


def test_a_publisher_that_starts_anew_or_comes_later_has_lost_nothing():
    count = 1
    gaps = SequenceGaps(lambda: count)
    assert [gaps.before(n) for n in (5, 6, 1, 2, 4)] == [0, 0, 0, 0, 1]
    count = 2
    assert [gaps.before(n) for n in (700, 5, 701, 703, 6)] == [0, 0, 0, 1, 0]


@pytest.mark.parametrize("executor_type", [SingleThreadedExecutor, EventsExecutor])
def test_what_a_full_queue_loses_is_counted_and_no_event_of_the_middleware_is_taken(executor_type):
    context = rclpy.Context()
    context.init()
    node = rclpy.create_node("reader", context=context)
    executor = executor_type(context=context)
    executor.add_node(node)
    received, lost = [], []
    qos = QoSProfile(depth=2)
    subscription = subscribe_raw(
        node,
        UInt32,
        "numbers",
        lambda data: received.append(deserialize_message(data, UInt32).data),
        lost.append,
        qos,
    )
    publisher = node.create_publisher(UInt32, "numbers", qos)
    number = 0
    while len(received) < 20:
        for _ in range(10):
            number += 1
            publisher.publish(UInt32(data=number))
        executor.spin_once(timeout_sec=0.1)
    assert received == sorted(received)
    assert sum(lost) == received[-1] - received[0] + 1 - len(received) > 0
    taken = {handler.event_type.name for handler in subscription.event_handlers}
    assert not any("MESSAGE_LOST" in name for name in taken)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()
