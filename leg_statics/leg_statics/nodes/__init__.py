# SPDX-License-Identifier: Apache-2.0
"""ROS nodes of statics, maps and designs, and what they read and answer."""
