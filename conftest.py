# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a ROS domain of their own, and the same random inputs in every run."""

import importlib
import os
import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).resolve().parent / "tools"))

import ros_domain

# Of every worker of pytest-xdist, too, which inherits the environment of its parent.
ros_domain.use_own_domain()
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)

# Import mode `importlib` makes a namespace package of a folder such as leg_kinematics/ that holds
# tests, unless the package of that name is there already.
for package in ("leg_kinematics", "leg_msgs_py", "leg_statics"):
    importlib.import_module(package)

# A verdict must depend neither on luck nor on the pace of the machine, and numba compiles within an
# example. `--hypothesis-profile explore` tries other inputs in every run.
PATIENT = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("workspace", derandomize=True, **PATIENT)
settings.register_profile("explore", **PATIENT)
settings.load_profile("workspace")
