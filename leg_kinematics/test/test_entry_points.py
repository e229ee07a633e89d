# SPDX-License-Identifier: Apache-2.0
"""Entry points of the nodes: quiet while the heavy modules load."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

PROGRAM = "from leg_kinematics.nodes.entry_points import start; start('slow_node')"
SLOW_MODULE = """
import threading
print("loading", flush=True)
threading.Event().wait()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_node_loads_ends_it_without_a_traceback(tmp_path, number):
    (tmp_path / "slow_node.py").write_text(SLOW_MODULE)
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "loading\n"
    process.send_signal(number)
    output, errors = process.communicate(timeout=60.0)
    assert (process.returncode, output, errors) == (0, "", "")


@pytest.mark.parametrize("package", ["leg_kinematics", "leg_statics"])
def test_nothing_heavy_is_loaded_before_signals_are_handled(package):
    module = f"{package}.nodes.entry_points"
    program = f"import sys, {module}; print({{'numpy', 'rclpy', 'numba'}} & {{*sys.modules}})"
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert output.stdout == "set()\n"
