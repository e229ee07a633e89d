# SPDX-License-Identifier: Apache-2.0
"""A node as a process: its executor, the thread that spins it, and the signals that end it."""

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from leg_kinematics.errors import LegError
from leg_kinematics.nodes.node_help import asks_for_help
from leg_kinematics.nodes.robot_node import RobotNode

STOP_TIMEOUT = 5.0  # a callback may take this long to end when the node stops [s]


def make_executor() -> Executor:
    """Return the executor of all nodes: one thread, so that callbacks need no locks.

    rclpy's other executors build a set of all that may happen anew, in Python, for every message:
    that takes longer than to answer it.
    """
    return EventsExecutor()


def run(make_node: Callable[[], RobotNode]) -> int:
    """Run a node until SIGINT or SIGTERM.

    The node spins in a thread and the main thread waits for signals, so that a signal never
    interrupts a callback: a request under way is still answered.

    Args:
        make_node: Makes the node.

    Returns:
        Exit code: 0 after a signal, 1 if the node could not start or stopped by itself.
    """
    try:
        _handle_signals(_interrupt)
        if asks_for_help(make_node, sys.argv):
            return 0
        return _spin_until_signal(make_node)
    except KeyboardInterrupt:
        return 0
    except (LegError, ParameterException) as error:
        print(f"cannot start: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        _handle_signals(signal.SIG_IGN)  # until the process ends; the executor gave them back
        rclpy.try_shutdown()


def _spin_until_signal(make_node: Callable[[], RobotNode]) -> int:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    executor = make_executor()
    _handle_signals(_interrupt)  # the executor took them for itself
    spinner = _Spinner(executor, make_node())
    try:
        if _stop_asked.is_set():
            raise KeyboardInterrupt
        spinner.ended.wait()
        return 1
    finally:
        spinner.stop()


def _handle_signals(handler: Any) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell's `&` leaves SIGINT ignored
        signal.signal(number, handler)


_stop_asked = threading.Event()


def _interrupt(*_: object) -> None:
    """Raise a KeyboardInterrupt at the first signal; further ones shall not disturb the end.

    The signal is kept in mind, because what it meets at the start may swallow the exception, as
    numba's compiler does now and then.
    """
    _handle_signals(lambda *_: None)
    _stop_asked.set()
    raise KeyboardInterrupt


class _Spinner:
    """Spins a node in a thread.

    Attributes:
        ended: Set when the node no longer spins.
    """

    def __init__(self, executor: Executor, node: RobotNode) -> None:
        self.ended = threading.Event()
        self._node = node
        self._executor = executor
        self._executor.add_node(node)
        gc.collect()
        gc.freeze()  # to search all that was imported for garbage would hold callbacks up
        self._stopping = False
        self._thread = threading.Thread(target=self._spin, name="spin", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Let the callback under way end, then destroy the node."""
        self._stopping = True
        self._executor.create_task(lambda: None)  # `wake` alone does not make spin_once return
        self._thread.join(STOP_TIMEOUT)
        if not self._thread.is_alive():
            self._executor.shutdown()
            self._node.destroy_node()

    def _spin(self) -> None:
        try:
            while not self._stopping and rclpy.ok():
                try:
                    # without a time-out an `EventsExecutor` of rclpy 7.1 never wakes up
                    self._executor.spin_once(timeout_sec=1.0)
                except Exception:
                    self._node.health.fault("executor", traceback.format_exc(limit=-1))
                    text = traceback.format_exc()
                    self._node.log.error("executor", text)
                    time.sleep(0.01)  # a fault that stays must not take the whole processor
        finally:
            self.ended.set()
