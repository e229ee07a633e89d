# SPDX-License-Identifier: Apache-2.0
"""ROS nodes: what they share, and the kinematics node."""
