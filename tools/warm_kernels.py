# SPDX-License-Identifier: Apache-2.0
"""Compile the kernels of a shipped robot into the cache; needs no ROS."""

import sys

from leg_kinematics import load_robot
from leg_kinematics.warm_up import warm_up_kinematics
from leg_statics.warm_up import warm_up_statics

if __name__ == "__main__":
    for name in sys.argv[1:]:
        robot = load_robot(name)
        warm_up_kinematics(robot)
        warm_up_statics(robot)
