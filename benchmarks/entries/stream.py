# SPDX-License-Identifier: Apache-2.0
"""Joint states of six legs at 1 kHz through the statics node, and through a bare relay."""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from harness import Goal, Row, Settings
from leg_msgs.msg import LegStates
from rclpy.qos import QoSProfile
from ros import START_TIMEOUT, Client, child, suite_nodes
from sensor_msgs.msg import JointState

RATE = 1000.0  # [Hz]
STAMP = struct.Struct("<4xiI")  # encapsulation, seconds, nanoseconds: how both messages begin
SLACK = 30.0  # for starting and warming up [s]


class Passage(NamedTuple):
    """What became of the messages.

    Attributes:
        sent: Messages sent.
        rate: Rate at which they were sent [Hz].
        latencies: From stamp to arrival of those that arrived [s].
        load: Share of a processor that the node took.
        sender_load: Share that the sender took.
    """

    sent: int
    rate: float
    latencies: list[float]
    load: float
    sender_load: float


def rows(settings: Settings) -> Iterator[Row]:
    """Yield loss, latency and processor load of the relay and of the statics node."""
    settings.show(f"relay for {settings.soak:g} s")
    with child("empty_node") as process, Client() as client:
        relay = passage(client, JointState, "/empty/joint_states", process.pid, settings)
    yield from passage_rows("relay", relay, judged=False)
    settings.show(f"statics node for {settings.soak:g} s")
    with suite_nodes("statics") as pids, Client() as client:
        states = passage(client, LegStates, "/statics/leg_states", pids["statics"], settings)
    yield from passage_rows("leg_states", states, judged=True)
    ratio = states.load / relay.load
    yield Row("leg_states / relay, processor", ratio, "x", note="lower is better")


def passage_rows(name: str, passed: Passage, *, judged: bool) -> Iterator[Row]:
    """Yield the rows of one passage; only that of the suite has goals."""
    lost = passed.sent - len(passed.latencies)
    p50, p95, p99, most = np.percentile(passed.latencies, [50.0, 95.0, 99.0, 100.0])
    sent = f"of {passed.sent:,} sent at {passed.rate:.0f} Hz"
    yield Row(f"{name}: lost", lost, "count", goal=Goal(0.0) if judged else None, note=sent)
    yield Row(f"{name}: latency", float(p50), "s", float(p95), note=f"largest {1e3 * most:.1f} ms")
    yield Row(f"{name}: latency, p99", float(p99), goal=Goal(5e-3) if judged else None)
    sender = f"of one core; the sender takes {100.0 * passed.sender_load:.0f} %"
    yield Row(f"{name}: processor", 100.0 * passed.load, "%", note=sender)


def passage(client: Client, message_type: Any, topic: str, pid: int, settings: Settings) -> Passage:
    """Send joint states through the node of process `pid` and receive what comes out.

    The receiver takes messages as bytes: it measures the node, not the conversion by rclpy.
    """
    latencies: dict[int, float] = {}

    def receive(message: bytes) -> None:
        now = time.time_ns()
        seconds, nanoseconds = STAMP.unpack_from(message)
        if seconds:
            stamp = 10**9 * seconds + nanoseconds
            latencies[stamp] = 1e-9 * (now - stamp)

    client.node.create_subscription(message_type, topic, receive, QoSProfile(depth=1000), raw=True)
    client.wait(lambda: client.node.count_publishers(topic) == 1, START_TIMEOUT)
    with child("sender", str(RATE), str(settings.soak)) as sender:
        client.wait(lambda: bool(latencies) or sender.poll() is not None, SLACK)
        before, start = processor_time(pid), time.monotonic()
        client.wait(lambda: time.monotonic() - start > settings.soak, settings.soak + SLACK)
        load = (processor_time(pid) - before) / (time.monotonic() - start)
        client.wait(lambda: sender.poll() is not None, SLACK)
        output = sender.stdout.read() if sender.stdout else ""
        if sender.returncode:
            raise RuntimeError(f"the sender ended with {sender.returncode}")
    told = json.loads(output)
    return Passage(told["sent"], told["rate"], list(latencies.values()), load, told["load"])


def processor_time(pid: int) -> float:
    """Return the processor time a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")
