# SPDX-License-Identifier: Apache-2.0
"""A minute at 1 kHz for six legs, without a message lost: `make soak`.

Too long for the tests, which check that what is lost is counted. The machine should do nothing
else: where the recorder waits for a processor for some 85 ms, the middleware's queue overflows.
"""

import json
import subprocess
import sys
from pathlib import Path

from leg_msgs_py.client import LegClient
from leg_msgs_py.recordings.bags import Bag
from node_processes import NodeProcesses
from nodes_support import START_TIMEOUT, wait_for
from recorder_support import (
    LEGS,
    RecordProcess,
    missing,
    report_of,
    sender,
    wait_until_recorded,
)

RATE, SECONDS = 1000.0, 60.0
SUITE_SENDER = Path(__file__).parent.parent / "benchmarks" / "children" / "sender.py"


def test_six_topics_of_a_leg_each(tmp_path):
    with RecordProcess(tmp_path / "soak") as record, sender(RATE, SECONDS, LEGS) as sending:
        told = report_of(sending)
        wait_until_recorded(record)
        memory = record.memory()
        print(f"\nsent {told}, recorder's memory {memory:.0f} MiB\n{record.stop()}")
    assert missing(tmp_path / "soak", told["sent"]) == {}
    assert memory < 300.0


def test_the_suite_of_a_hexapod(tmp_path):
    with NodeProcesses("hexapod", names=["statics"]):
        with LegClient() as client:
            wait_for(lambda: client.node.count_subscribers("/joint_states"), START_TIMEOUT)
        with RecordProcess(tmp_path / "soak") as record:
            command = [sys.executable, SUITE_SENDER, str(RATE), str(SECONDS)]
            told = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
            memory, output = record.memory(), record.stop()
            print(f"\nsent {told}, recorder's memory {memory:.0f} MiB\n{output}")
    joints, states = (
        {message.data[4:12] for message in Bag(tmp_path / "soak").messages([topic])}
        for topic in ("/joint_states", "/statics/leg_states")
    )
    warm_up = bytes(8)
    assert len(joints - {warm_up}) == told["sent"]
    # A node that cannot follow leaves inputs out, and tells so; what it publishes is recorded.
    assert states <= joints
    assert "dropped:" not in output
    assert "lost by" not in output
    assert memory < 300.0
