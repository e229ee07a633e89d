# SPDX-License-Identifier: Apache-2.0
"""Publishes joint states of the hexapod at a steady rate and tells how many.

Arguments: rate [Hz], duration [s]. Messages with a stamp of zero are a warm-up.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import rclpy
from leg_msgs_py.arrays import to_field
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from leg_kinematics import load_robot

AMPLITUDE = 0.1  # of all joints, within their ranges [rad]
EFFORT = 30.0  # [N.m]
WARM_UP_MESSAGES, WARM_UP_PERIOD = 100, 0.01
TIMEOUT = 30.0  # to be listened to [s]


def main() -> None:
    """Wait for a listener, warm up, send, and print what was done as JSON."""
    rate, seconds = map(float, sys.argv[1:3])
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # a signal ends it at once
    node = Node("joint_state_sender", enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(JointState, "/joint_states", qos_profile_sensor_data)
    deadline = time.monotonic() + TIMEOUT
    while not publisher.get_subscription_count():
        if time.monotonic() > deadline:
            sys.exit("nobody listens to /joint_states")
        time.sleep(0.01)
    legs = load_robot("hexapod").legs.values()
    message = JointState(name=[name for leg in legs for name in leg.joint_names])
    phases = np.arange(len(message.name))
    message.velocity = to_field(np.zeros(len(phases)))
    message.effort = to_field(np.full(len(phases), EFFORT))
    for _ in range(WARM_UP_MESSAGES):
        message.position = to_field(np.zeros(len(phases)))
        publisher.publish(message)
        time.sleep(WARM_UP_PERIOD)

    count = round(rate * seconds)
    start, work = time.monotonic(), time.process_time()
    for k in range(count):
        pause = start + k / rate - time.monotonic()
        if pause > 0.0:
            time.sleep(pause)
        message.position = to_field(AMPLITUDE * np.sin(0.01 * k + phases))
        stamp = time.time_ns()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        publisher.publish(message)
    elapsed, work = time.monotonic() - start, time.process_time() - work
    time.sleep(1.0)  # whoever is late still gets them
    print(json.dumps({"sent": count, "rate": count / elapsed, "load": work / elapsed}))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
