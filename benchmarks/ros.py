# SPDX-License-Identifier: Apache-2.0
"""What the entries with nodes share: nodes as processes and a client in this one."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from node_processes import NodeProcesses
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

HERE = Path(__file__).resolve().parent
START_TIMEOUT = 180.0  # the first start on a machine compiles [s]
CALL_TIMEOUT = 30.0


class Client:
    """A node of this process that calls services and listens, spun where it waits."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("benchmark", context=self._context, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def __enter__(self) -> Client:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free what the node uses."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def service(self, service_type: Any, name: str, timeout: float = START_TIMEOUT) -> Any:
        """Return the client of a service that is there, or None if it is not in time."""
        client = self.node.create_client(service_type, name)
        if client.wait_for_service(timeout):
            return client
        self.node.destroy_client(client)
        return None

    def call(self, client: Any, request: Any) -> Any:
        """Return the answer to a request."""
        future = client.call_async(request)
        deadline = time.monotonic() + CALL_TIMEOUT
        while not future.done():
            self._executor.spin_once(timeout_sec=1.0)
            if time.monotonic() > deadline:
                raise TimeoutError(f"no answer from {client.srv_name}")
        return future.result()

    def wait(self, condition: Callable[[], bool], timeout: float) -> None:
        """Spin until a condition holds.

        Raises:
            TimeoutError: If it does not in time.
        """
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f"nothing within {timeout:g} s")
            self._executor.spin_once(timeout_sec=0.01)


@contextmanager
def suite_nodes(*names: str) -> Iterator[dict[str, int]]:
    """Run nodes of the suite for the hexapod; give their process ids by name."""
    with (
        (results_folder() / "nodes.log").open("w") as log,
        NodeProcesses(names=names, stdout=log, stderr=log) as nodes,
    ):
        yield {name: process.pid for name, process in nodes.processes.items()}


@contextmanager
def child(name: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program of `children`."""
    process = subprocess.Popen(
        [sys.executable, HERE / "children" / f"{name}.py", *arguments],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()


def results_folder() -> Path:
    """Return the folder of results."""
    folder = HERE / "results"
    folder.mkdir(exist_ok=True)
    return folder
