# SPDX-License-Identifier: Apache-2.0
"""A node whose callbacks fail, and that logs by Python's `logging`; the tests run it."""

import contextlib
import logging
import os
import signal
import sys

from std_srvs.srv import Trigger

from leg_kinematics.nodes.node_process import run
from leg_kinematics.nodes.robot_node import RobotNode


class BrokenNode(RobotNode):
    """Fails in a timer and in a service; answers in another service.

    With SWALLOW in its environment it swallows an interrupt at the start, as a compiler may.
    """

    def __init__(self):
        super().__init__("broken")
        if "SWALLOW" in os.environ:
            with contextlib.suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
        self.create_timer(0.02, self.fail)
        self.create_service(Trigger, "~/fail", self.fail)
        self.create_service(Trigger, "~/work", self.work)
        logging.getLogger("solver").warning("no answer for %d points", 3)
        self.announce()

    def fail(self, *_):
        """Fail."""
        raise ValueError("broken on purpose")

    def work(self, request, response):
        """Answer how many faults were counted."""
        response.message = self.health.report().values["internal faults"]
        return response


if __name__ == "__main__":
    sys.exit(run(BrokenNode))
