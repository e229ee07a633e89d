# SPDX-License-Identifier: Apache-2.0
"""The log of a node: throttled, counted, and open to Python's own logging."""

from __future__ import annotations

import logging
import warnings

import pytest

from leg_kinematics.nodes import node_log
from leg_kinematics.nodes.node_log import PERIOD, LibraryLog, NodeLog


class Lines:
    """Stands for an rclpy logger and keeps what is logged."""

    def __init__(self):
        self.all = []

    def __getattr__(self, level):
        return lambda text: self.all.append((level, text))


@pytest.fixture
def lines():
    return Lines()


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""
    now = [100.0]
    monkeypatch.setattr(node_log.time, "monotonic", lambda: now[0])
    return now


def test_a_flood_is_logged_once_in_a_period_with_its_number(lines, clock):
    log = NodeLog(lines)
    for _ in range(5000):
        log.log(logging.WARNING, "joints refused", "too few")
    assert lines.all == [("warning", "too few")]
    clock[0] += PERIOD
    log.log(logging.WARNING, "joints refused", "too many")
    assert lines.all[1:] == [("warning", "too many (4999 more of these before)")]


def test_kinds_do_not_silence_each_other(lines, clock):
    log = NodeLog(lines)
    for kind in ("joints refused", "leg not updated"):
        log.log(logging.WARNING, kind, kind)
    assert len(lines.all) == 2


def test_what_was_suppressed_last_is_told_when_it_is_over(lines, clock):
    log = NodeLog(lines)
    for _ in range(8):
        log.log(logging.ERROR, "executor", "broken")
    log.flush()
    assert len(lines.all) == 1
    clock[0] += PERIOD
    log.flush()
    log.flush()
    assert lines.all[1:] == [("error", "executor: 7 more messages not logged")]


@pytest.mark.parametrize(
    ("level", "name"),
    [
        (logging.DEBUG, "debug"),
        (logging.INFO, "info"),
        (logging.WARNING, "warning"),
        (logging.ERROR, "error"),
        (logging.CRITICAL, "fatal"),
    ],
)
def test_levels_of_python_are_those_of_ros(lines, level, name):
    NodeLog(lines).log(level, "kind", "text")
    assert lines.all == [(name, "text")]


def test_loggers_of_libraries_and_warnings_reach_the_log_while_it_is_installed(lines):
    library = LibraryLog(NodeLog(lines))
    library.install()
    try:
        logging.getLogger("solver").error("no answer for %d points", 3)
        logging.getLogger("solver").info("not worth telling")
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("cache is not writable", stacklevel=1)
    finally:
        library.remove()
    logging.getLogger("solver").error("nobody listens any more")
    (error, warning) = lines.all
    assert error == ("error", "solver: no answer for 3 points")
    assert warning[0] == "warning"
    assert "cache is not writable" in warning[1]


def test_a_traceback_of_a_library_is_logged_whole(lines):
    library = LibraryLog(NodeLog(lines))
    library.install()
    try:
        try:
            1 / 0  # noqa: B018
        except ZeroDivisionError:
            logging.getLogger("solver").exception("failed")
    finally:
        library.remove()
    assert "ZeroDivisionError" in lines.all[0][1]
