# SPDX-License-Identifier: Apache-2.0
"""Entry points of nodes: light, so that Ctrl-C ends them quietly while they load."""

from __future__ import annotations

import importlib
import os
import signal
from functools import partial


def start(module: str) -> int:
    """Load the module of a node, which takes most of a second, and run its `main`.

    Until `main` handles signals, SIGINT and SIGTERM end the process at once, with exit code 0.

    Args:
        module: Name of the module.

    Returns:
        Exit code of the process.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    code: int = importlib.import_module(module).main()
    return code


kinematics_node = partial(start, "leg_kinematics.nodes.kinematics_node")
