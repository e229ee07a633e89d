# SPDX-License-Identifier: Apache-2.0
"""A maps node that computes a map of a workspace only as far as the test that runs it lets it.

Every line on standard input is the number of planes that may pass the gate from then on; it is
repeated on standard output. A map that is cancelled passes with the plane that it is at.
"""

import sys
import threading

from leg_statics.map_jobs import MapJob
from leg_statics.nodes import maps_node


class Gate:
    """Holds planes up until they may pass."""

    def __init__(self):
        self._allowed = 0
        self._changed = threading.Condition()
        threading.Thread(target=self._obey, daemon=True).start()

    def pass_through(self, is_cancelled):
        """Wait until a plane may pass."""
        with self._changed:
            while not self._allowed and not is_cancelled():
                self._changed.wait(0.01)
            self._allowed = max(0, self._allowed - 1)

    def _obey(self):
        for line in sys.stdin:
            with self._changed:
                self._allowed = int(line)
                self._changed.notify_all()
            print(line, end="", flush=True)


gate = Gate()


class GatedJob(MapJob):
    """A map that waits at the gate before it tells of a plane."""

    def _note(self, *progress):
        gate.pass_through(self._cancelled.is_set)
        super()._note(*progress)


if __name__ == "__main__":
    maps_node.MapJob = GatedJob
    sys.exit(maps_node.main())
