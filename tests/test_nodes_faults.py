# SPDX-License-Identifier: Apache-2.0
"""Faults of a node's own code, and floods of bad input: the node lives on, and its log is short."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from leg_msgs_py.client import LegClient
from node_processes import NodeProcesses
from nodes_support import PATIENCE, START_TIMEOUT, wait_for
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from leg_kinematics.nodes.node_log import PERIOD

BROKEN_NODE = Path(__file__).with_name("nodes_broken.py")


@pytest.fixture
def log(tmp_path):
    """The file that a node logs to."""
    return tmp_path / "node.log"


def test_callbacks_that_fail_stop_neither_the_node_nor_its_other_services(log):
    with log.open("w") as stream, LegClient() as client:
        process = subprocess.Popen([sys.executable, BROKEN_NODE], stderr=stream)
        try:
            clients = [client.node.create_client(Trigger, f"/broken/{n}") for n in ("work", "fail")]
            for service in clients:
                assert service.wait_for_service(START_TIMEOUT)
            work, fail = clients
            for _ in range(3):
                fail.call_async(Trigger.Request())
            wait_for(lambda: int(work.call(Trigger.Request(), timeout_sec=PATIENCE).message) > 10)
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(PATIENCE)
    assert code == 0
    text = log.read_text()
    assert "ValueError: broken on purpose" in text
    assert re.search(r"^\[WARN\] .*\[broken\]: solver: no answer for 3 points", text, re.MULTILINE)


def test_an_interrupt_that_something_swallows_at_the_start_ends_the_node_all_the_same():
    done = subprocess.run(
        [sys.executable, BROKEN_NODE],
        env={**os.environ, "SWALLOW": "1"},
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT,
    )
    assert done.returncode == 0
    assert "[broken]: ready" in done.stderr


def test_every_message_of_a_flood_is_counted_and_one_a_period_is_logged(log):
    def refusals():
        return [line for line in log.read_text().splitlines() if "joint_states refused" in line]

    def logged():
        suppressed = [int(n) for line in refusals() for n in re.findall(r"(\d+) more", line)]
        return sum(suppressed) + sum("appear more than once" in line for line in refusals())

    told = {}

    def diagnose(message):
        if message.status[0].name.startswith("/flooded/statics"):
            told.update({value.key: value.value for value in message.status[0].values})

    with (
        log.open("w") as stream,
        NodeProcesses(
            names=["statics"], namespace="flooded", stderr=stream, stdout=stream
        ) as nodes,
        LegClient(namespace="flooded") as client,
    ):
        node = client.node
        node.create_subscription(DiagnosticArray, "/diagnostics", diagnose, 10)
        publisher = node.create_publisher(
            JointState, "/flooded/joint_states", qos_profile_sensor_data
        )
        wait_for(lambda: publisher.get_subscription_count() == 1, START_TIMEOUT)
        bad = JointState(name=["a", "a"], position=[0.0, 0.0])

        def is_refused():
            publisher.publish(bad)
            return refusals()

        wait_for(is_refused)  # the node may know the publisher later than the publisher the node
        for _ in range(400):
            publisher.publish(bad)
        wait_for(lambda: 1 < logged() == int(told.get("refused: joint_states", 0)))
        assert nodes.ended() == {}
    assert "name: a appear more than once" in refusals()[0]
    times = [float(re.search(r"\[(\d+\.\d+)\]", line)[1]) for line in refusals()]
    assert logged() > len(times) >= 2
    assert np.diff(times).min() > 0.5 * PERIOD  # the line is written some time after the decision
