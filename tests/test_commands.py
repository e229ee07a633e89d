# SPDX-License-Identifier: Apache-2.0
"""Commands as a shell runs them: a clear line instead of a traceback, on any terminal."""

import os
import subprocess

import pytest
from node_processes import find_executable
from nodes_support import START_TIMEOUT

STUDY = """\
version: 1
name: cheap
units: {length: mm, angle: deg}
base: {robot: hexapod, leg_type: initial}
parameters: {drive_lever: {from: 60, to: 200}}
objectives: [condition_number]
method: {name: samples, designs: 4}
tolerance: 0.5
"""
SYNTHESIS = ("leg_statics", "synthesize_six_bar", "--generations", "3")
ASCII = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
LATIN = {"PYTHONIOENCODING": "latin-1"}


def run(command, folder, **environment):
    """Run a command of a package in a folder."""
    package, name, *arguments = command
    return subprocess.run(
        [find_executable(package, name), *arguments],
        cwd=folder, env={**os.environ, **environment}, capture_output=True, timeout=START_TIMEOUT,
    )  # fmt: skip


@pytest.mark.parametrize("encoding", [ASCII, LATIN], ids=["ascii", "latin-1"])
def test_what_a_terminal_cannot_show_is_escaped(tmp_path, encoding):
    result = run(SYNTHESIS, tmp_path, **encoding)
    assert result.returncode == 0, result.stderr.decode(errors="replace")
    assert b"\\u" in result.stdout  # the letter phi


WRONG = {
    "folder of figures": (*SYNTHESIS, "--figures", "a_file/x"),
    "seed": (*SYNTHESIS, "--seed", "-1"),
    "generations": ("leg_statics", "synthesize_six_bar", "--generations", "0"),
    "folder of results": ("leg_statics", "search_geometry", "study.yaml", "--output", "a_file/x"),
    "pipe as a study": ("leg_statics", "search_geometry", "pipe.yaml"),
    "unknown home": ("leg_statics", "search_geometry", "~nobody_at_all/study.yaml"),
    "long line": ("leg_statics", "search_geometry", "study.yaml", "--output", "long"),
    "long lines": ("leg_statics", "search_geometry", "study.yaml", "--output", "longer"),
    "folder of pictures": ("leg_statics", "plot_index_map", "--all", "a_file/x"),
    "pipe as a robot": ("leg_statics", "plot_index_map", "--robot", "pipe.yaml", "--all", "x"),
    "pipe as a recording": ("leg_statics", "judge_bag", "pipe.mcap"),
    "folder of a report": ("leg_statics", "judge_bag", "pipe.mcap", "--report", "a_file/x.html"),
    "folder of a recording": ("leg_msgs_py", "record", "--output", "a_file/x"),
}


@pytest.mark.parametrize("command", WRONG.values(), ids=WRONG.keys())
def test_what_cannot_be_done_is_told_in_a_line(tmp_path, command):
    (tmp_path / "a_file").write_text("")
    (tmp_path / "study.yaml").write_text(STUDY)
    for pipe in ("pipe.yaml", "pipe.mcap"):
        os.mkfifo(tmp_path / pipe)
    for folder, table in (("long", "x" * 200_000), ("longer", f"{'x' * 200_000}\ny\n")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "designs.csv").write_text(table)
    result = run(command, tmp_path)
    *progress, message = result.stderr.decode().strip().splitlines()
    assert result.returncode in (1, 2)
    assert message.startswith(f"{command[1]}: ")
    assert not [line for line in progress if "Traceback" in line or "  File" in line]
