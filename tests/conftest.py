# SPDX-License-Identifier: Apache-2.0
"""Real node processes for the tests, in a ROS domain of their own on this machine only."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

HERE = Path(__file__).resolve().parent
os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(HERE / "fastdds_log.xml")
sys.path.insert(0, str(HERE))

import pytest  # noqa: E402
from node_processes import NodeProcesses  # noqa: E402
from nodes_support import MAX_POINTS, PATIENCE, wait_until_ready  # noqa: E402


@pytest.fixture(scope="session")
def hexapod():
    """The robot that the nodes serve, for direct calls of the library."""
    from leg_kinematics import load_robot

    return load_robot("hexapod")


@pytest.fixture(scope="session")
def suite(tmp_path_factory):
    """All nodes of the hexapod and a client; a test that changes something changes it back."""
    from leg_msgs_py.client import LegClient

    folders = f"[{tmp_path_factory.getbasetemp()}]"
    parameters = {
        "max_points": MAX_POINTS,
        "diagnostics_rate": 10.0,
        "robot_folders": folders,
        "service_events": "off",  # which YAML reads as false
    }
    with NodeProcesses(parameters=parameters) as nodes, LegClient(timeout=PATIENCE) as client:
        wait_until_ready(client, nodes)
        yield SimpleNamespace(nodes=nodes, client=client)
