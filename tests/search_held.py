# SPDX-License-Identifier: Apache-2.0
"""The command search_geometry, held after as many designs as its first argument says.

It then prints "held", and goes on when its standard input has a line or ends.
"""

import sys

from leg_statics.commands import search_geometry


class HeldBar(search_geometry.ProgressBar):
    """Shows progress, and holds the search once."""

    def show(self, search):
        """Show a search now and then, and hold it when it is time."""
        super().show(search)
        if search.progress.evaluated == int(sys.argv[1]):
            print("held", flush=True)
            sys.stdin.readline()


if __name__ == "__main__":
    search_geometry.ProgressBar = HeldBar
    sys.exit(search_geometry.main(sys.argv[2:]))
