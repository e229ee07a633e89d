# SPDX-License-Identifier: Apache-2.0
"""What the tests of the recorder and its soak share: the command as a process, and a sender."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from contextlib import contextmanager, suppress
from pathlib import Path

from leg_msgs_py.recordings.bags import Bag, BagError
from node_processes import find_executable
from nodes_support import START_TIMEOUT
from numbered_sender import LAST

SENDER = Path(__file__).with_name("numbered_sender.py")
LEGS = tuple(f"/leg_{k}/joint_states" for k in range(6))
BEST_EFFORT, RELIABLE = LEGS[::2], LEGS[1::2]  # what the sender makes of them
LOOK_PERIOD = 0.5  # at a recording in the making [s]


class RecordProcess:
    """The command `record` as a process; afterwards its output and exit code."""

    def __init__(self, folder, *arguments, **environment):
        self.folder = folder
        command = [find_executable("leg_msgs_py", "record"), "-o", folder, *arguments]
        self.process = subprocess.Popen(
            command,
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def stop(self, number=signal.SIGINT):
        """End it by a signal, and return its output."""
        self.process.send_signal(number)
        return self.wait()

    def wait(self):
        """Wait until it ends, and return its output."""
        output, self.errors = self.process.communicate(timeout=START_TIMEOUT)
        return output

    def size(self):
        """Return how much of the recording is on the disk [B]."""
        file = self.folder / f"{self.folder.name}_0.mcap"
        return file.stat().st_size if file.exists() else 0

    def memory(self):
        """Return the most memory it has had [MiB]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024


@contextmanager
def sender(rate, seconds, topics):
    """Run a sender of numbered joint states."""
    process = subprocess.Popen(
        [sys.executable, SENDER, str(rate), str(seconds), *topics],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.stdin.close()
        process.wait(START_TIMEOUT)
        process.stdout.close()


def report_of(process):
    """Wait until a sender has sent everything, and return what it tells."""
    return json.loads(process.stdout.readline())


def published_by(process):
    """End a sender, and return how many messages it has published on each topic."""
    process.stdin.close()
    return json.loads(process.stdout.readline())["published"]


def counts(folder):
    """Return how many messages are recorded by topic, also while the recording is being made."""
    try:
        return Bag(folder).counts
    except BagError:  # nothing yet
        return Counter()


def all_numbers(folder):
    """Return the numbers of the recorded joint states by topic."""
    found = defaultdict(list)
    with suppress(BagError):  # nothing yet
        for message in Bag(folder).messages(LEGS):
            found[message.topic].append(int.from_bytes(message.data[4:8], "little"))
    return dict(found)


def numbers(folder):
    """Return the same without those of the warm-up and of the end."""
    return {
        topic: [number for number in found if 0 < number < LAST]
        for topic, found in all_numbers(folder).items()
    }


def wait_until_recorded(record, topics=LEGS):
    """Wait until the last number is recorded: all before it is, too, or is counted as lost."""

    def are_recorded():
        found = all_numbers(record.folder)
        return all(LAST in found.get(topic, ()) for topic in topics)

    while not are_recorded():
        assert record.process.poll() is None, record.wait()
        time.sleep(LOOK_PERIOD)


def missing(folder, sent):
    """Return what the recording of all legs lacks: first, last and number of them by topic."""
    found = numbers(folder)
    lacking = {topic: sorted({*range(1, sent + 1)} - {*found.get(topic, ())}) for topic in LEGS}
    return {topic: (each[0], each[-1], len(each)) for topic, each in lacking.items() if each}
