# SPDX-License-Identifier: Apache-2.0
"""Publishes numbered joint states of legs at a steady rate, one topic a leg, and tells how many.

Arguments: rate [Hz], duration [s], topics. The number stands in the stamp; a warm-up has number 0.
Every other topic is best effort, the others are reliable. When all is sent it tells so, and goes on
with messages of the number `LAST`, by which a reader finds out what it has lost before, until its
standard input ends.
"""

from __future__ import annotations

import json
import select
import sys
import time

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

LAST = 2**31 - 1
WARM_UP_MESSAGES, WARM_UP_PERIOD = 30, 0.01
LAST_PERIOD = 0.05  # [s]
TIMEOUT = 600.0  # to be listened to [s]


def main() -> None:
    """Wait for listeners, warm up, send, and print what was done as lines of JSON."""
    rate, seconds, topics = float(sys.argv[1]), float(sys.argv[2]), sys.argv[3:]
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node("numbered_sender", enable_rosout=False, start_parameter_services=False)
    profiles = (qos_profile_sensor_data, QoSProfile(depth=1000))
    publishers = [
        node.create_publisher(JointState, topic, profiles[k % 2]) for k, topic in enumerate(topics)
    ]
    deadline = time.monotonic() + TIMEOUT
    while not all(publisher.get_subscription_count() for publisher in publishers):
        if time.monotonic() > deadline:
            sys.exit("nobody listens")
        time.sleep(0.01)
    message = JointState(
        name=["crank_1", "crank_2", "crank_3"],
        position=[0.1, 0.2, 0.3],
        velocity=[0.0] * 3,
        effort=[30.0] * 3,
    )

    def send(number: int) -> None:
        message.header.stamp.sec = number
        data = serialize_message(message)
        for publisher in publishers:
            publisher.publish(data)

    for _ in range(WARM_UP_MESSAGES):
        send(0)
        time.sleep(WARM_UP_PERIOD)
    count = round(rate * seconds)
    start = time.monotonic()
    for k in range(count):
        pause = start + k / rate - time.monotonic()
        if pause > 0.0:
            time.sleep(pause)
        send(k + 1)
    elapsed = time.monotonic() - start
    print(json.dumps({"sent": count, "rate": count / elapsed}), flush=True)
    published = WARM_UP_MESSAGES + count
    while not select.select([sys.stdin], [], [], LAST_PERIOD)[0]:
        send(LAST)
        published += 1
    print(json.dumps({"published": published}))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
