"""What all tests share: a ROS network of their own, and no deadline for what numba compiles."""

import importlib
import os
import sys

from hypothesis import settings

# Domains 1 to 101 use no port that the system gives to others; parallel runs and workers differ.
os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 101))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)

# Import mode `importlib` makes a namespace package of a folder such as leg_kinematics/ that holds
# tests, unless the package of that name is there already.
for package in ("leg_kinematics", "leg_msgs_py", "leg_statics"):
    importlib.import_module(package)

# A verdict on a commit must not depend on luck: elsewhere every run tries other inputs.
settings.register_profile("workspace", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("workspace")
