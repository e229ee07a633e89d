"""Real node processes for the tests, in a ROS domain of their own on this machine only."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

# Before anything loads ROS. Unconditional, because workers of pytest-xdist inherit the environment
# of their parent: they must not meet each other's nodes.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 101)

HERE = Path(__file__).resolve().parent
os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(HERE / "fastdds_log.xml")
sys.path[:0] = [str(HERE), str(HERE.parent / "tools")]

import pytest  # noqa: E402
from node_processes import NodeProcesses  # noqa: E402
from nodes_support import MAX_POINTS, START_TIMEOUT  # noqa: E402


@pytest.fixture(scope="session")
def hexapod():
    """The robot that the nodes serve, for direct calls of the library."""
    from leg_kinematics import load_robot

    return load_robot("hexapod")


@pytest.fixture(scope="session")
def suite():
    """All nodes of the hexapod and a client; a test that changes something changes it back."""
    from leg_msgs_py.client import LegClient

    parameters = {"max_points": MAX_POINTS, "diagnostics_rate": 10.0}
    with NodeProcesses(parameters=parameters) as nodes, LegClient(timeout=20.0) as client:
        client.wait_until_ready(START_TIMEOUT)
        yield SimpleNamespace(nodes=nodes, client=client)
