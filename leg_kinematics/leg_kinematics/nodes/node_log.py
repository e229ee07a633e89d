# SPDX-License-Identifier: Apache-2.0
"""The log of a node: nothing floods it, and Python's own logging goes to it."""

from __future__ import annotations

import logging
import time
from typing import Any

PERIOD = 5.0  # what repeats is logged once in this time [s]


class NodeLog:
    """Logs warnings and errors, those of one kind at most once in `PERIOD`, with their number.

    Args:
        logger: Logger of the node.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._kinds: dict[str, _Kind] = {}

    def warning(self, kind: str, text: str) -> None:
        """Log a warning; see `log`."""
        self.log(logging.WARNING, kind, text)

    def error(self, kind: str, text: str) -> None:
        """Log an error; see `log`."""
        self.log(logging.ERROR, kind, text)

    def log(self, level: int, kind: str, text: str) -> None:
        """Log a text, unless one of its kind was logged a short time ago.

        Args:
            level: Level as of Python's `logging`.
            kind: What counts as a repetition.
            text: The text.
        """
        now = time.monotonic()
        known = self._kinds.setdefault(kind, _Kind())
        if now < known.logged_at + PERIOD:
            known.suppressed += 1
            known.level = level
            return
        more = f" ({known.suppressed} more of these before)" if known.suppressed else ""
        known.logged_at, known.suppressed = now, 0
        self._write(level, text + more)

    def flush(self) -> None:
        """Tell how much was suppressed of what has not been logged again since, and forget it."""
        now = time.monotonic()
        over = {k: v for k, v in self._kinds.items() if now >= v.logged_at + PERIOD}
        for kind, known in over.items():
            del self._kinds[kind]
            if known.suppressed:
                self._write(known.level, f"{kind}: {known.suppressed} more messages not logged")

    def _write(self, level: int, text: str) -> None:
        # one line of code for each level: rclpy tells loggers apart by where they are called
        if level >= logging.CRITICAL:
            self._logger.fatal(text)
        elif level >= logging.ERROR:
            self._logger.error(text)
        elif level >= logging.WARNING:
            self._logger.warning(text)
        elif level >= logging.INFO:
            self._logger.info(text)
        else:
            self._logger.debug(text)


class _Kind:
    """What is remembered of texts of one kind."""

    def __init__(self) -> None:
        self.logged_at = -PERIOD
        self.suppressed = 0
        self.level = logging.NOTSET


class LibraryLog(logging.Handler):
    """Passes what libraries tell by `logging` and `warnings` on to the log of a node.

    What is passed on is up to the levels of `logging`: warnings and worse by default.

    Args:
        log: Log of the node.
    """

    def __init__(self, log: NodeLog) -> None:
        super().__init__()
        self._log = log

    def install(self) -> None:
        """Begin."""
        logging.getLogger().addHandler(self)
        logging.captureWarnings(True)

    def remove(self) -> None:
        """End."""
        logging.captureWarnings(False)
        logging.getLogger().removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record."""
        try:
            kind = f"{record.name} ({record.filename}:{record.lineno})"
            self._log.log(record.levelno, kind, f"{record.name}: {self.format(record).rstrip()}")
        except Exception:
            self.handleError(record)
