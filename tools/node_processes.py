# SPDX-License-Identifier: Apache-2.0
"""The nodes of one robot as processes of this machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

NODES = Path(__file__).resolve().parent.parent / "config" / "nodes.yaml"
STOP_SIGNALS = ((signal.SIGINT, 6.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, None))


def node_names() -> tuple[str, ...]:
    """Return the names of the nodes of a robot."""
    return tuple(node["name"] for node in YAML(typ="safe").load(NODES)["nodes"])


def find_executable(package: str, executable: str) -> Path:
    """Return the path of a node that is installed in this environment.

    Raises:
        FileNotFoundError: If the workspace is not built.
    """
    prefixes = [
        *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)),
        sys.prefix,
    ]
    for prefix in prefixes:
        path = Path(prefix, "lib", package, executable)
        if path.is_file():
            return path
    raise FileNotFoundError(f"no {package}/{executable} in {', '.join(prefixes)}: run `make setup`")


class NodeProcesses:
    """Starts nodes and stops them, as a context manager.

    Args:
        robot: YAML file or name of a shipped robot; None for the nodes' default.
        names: Nodes to start, companions among them; None for all that a robot has.
        namespace: Namespace of the nodes; "" for none.
        environment: Variables that differ from this process's.
        parameters: Further parameters of every node.
        **streams: `stdout` and `stderr` of the nodes, as for `subprocess.Popen`.
    """

    def __init__(
        self,
        robot: str | None = None,
        *,
        names: Iterable[str] | None = None,
        namespace: str = "",
        environment: Mapping[str, str] | None = None,
        parameters: Mapping[str, object] | None = None,
        **streams: Any,
    ) -> None:
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._names = node_names() if names is None else tuple(names)
        settings = {**({"robot": robot} if robot else {}), **(parameters or {})}
        self._arguments = ["--ros-args"] if settings or namespace else []
        for key, value in settings.items():
            self._arguments += ["-p", f"{key}:={value}"]
        if namespace:
            self._arguments += ["-r", f"__ns:=/{namespace.strip('/')}"]
        self._environment = {**os.environ, **(environment or {})}
        self._streams = streams

    def __enter__(self) -> NodeProcesses:
        """Start all nodes."""
        try:
            for name in self._names:
                self.start(name)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all nodes."""
        self.stop()

    def start(self, name: str) -> None:
        """Start a node; it gets no signals of the terminal, so that it stops only when told."""
        node = _read_nodes()[name]
        executable = find_executable(node["package"], node["executable"])
        self.processes[name] = subprocess.Popen(
            [executable, *self._arguments],
            env=self._environment,
            start_new_session=True,
            **self._streams,
        )

    def ended(self) -> dict[str, int]:
        """Return the exit codes of nodes that no longer run, by name."""
        codes = {name: process.poll() for name, process in self.processes.items()}
        return {name: code for name, code in codes.items() if code is not None}

    def stop(self) -> dict[str, int]:
        """Stop all nodes, harder and harder, and return their exit codes."""
        for number, patience in STOP_SIGNALS:
            running = [process for process in self.processes.values() if process.poll() is None]
            for process in running:
                process.send_signal(number)
            for process in running:
                try:
                    process.wait(patience)
                except subprocess.TimeoutExpired:
                    continue
        return self.ended()


def _read_nodes() -> dict[str, dict[str, str]]:
    known = YAML(typ="safe").load(NODES)
    return {node["name"]: node for node in (*known["nodes"], *known["companions"])}
