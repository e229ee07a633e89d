# SPDX-License-Identifier: Apache-2.0
"""Numpy in and out of leg_msgs, and a client for gait planners.

`leg_msgs_py.client.LegClient` asks the nodes; `leg_msgs_py.arrays` converts fields and does not
need rclpy; `leg_msgs_py.errors` are the exceptions; `leg_msgs_py.recordings` are bags.
"""
