# SPDX-License-Identifier: Apache-2.0
"""What the commands share: reading their command lines, and printing on any terminal."""

from __future__ import annotations

import argparse
import io
import sys
from typing import NoReturn


class ArgumentParser(argparse.ArgumentParser):
    """A parser whose errors are one line, without the usage before it."""

    def error(self, message: str) -> NoReturn:
        """Print the error and exit."""
        self.exit(2, f"{self.prog}: error: {message}\n")


def print_on_any_terminal() -> None:
    """Escape what the encoding of the output lacks, such as the degree sign in ASCII."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
