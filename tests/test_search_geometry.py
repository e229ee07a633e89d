# SPDX-License-Identifier: Apache-2.0
"""The command search_geometry as a process: killed, interrupted, refused."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from node_processes import find_executable
from nodes_support import START_TIMEOUT

from leg_kinematics import load_robot

STUDY = """\
version: 1
name: cheap
units: {length: mm, angle: deg}
base: {robot: hexapod, leg_type: initial}
parameters:
  drive_lever: {from: 60, to: 200}
  shank_length: {from: 320, to: 520}
objectives: [condition_number, unit_effort_capacity]
method: {name: nsga2, designs: 240, population: 24}
seed: 1
tolerance: 0.5
"""


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text(STUDY)
    return path


COMMAND = (find_executable("leg_statics", "search_geometry"),)
HELD = (sys.executable, Path(__file__).with_name("search_held.py"))


def begin(study, folder, *options, command=COMMAND, **keywords):
    return subprocess.Popen(
        [*map(str, command), study, "--output", folder, *options],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **keywords,
    )


def finish(process):
    output, errors = process.communicate(timeout=START_TIMEOUT)
    return process.returncode, output, errors


def designs(folder):
    path = folder / "designs.csv"
    return path.read_bytes() if path.exists() else b""


def begin_held(count, study, folder, *options, **keywords):
    """Begin a search, and return it when it is held after so many designs."""
    process = begin(study, folder, *options, command=(*HELD, count), **keywords)
    for line in process.stdout:
        if line == "held\n":
            break
    else:
        raise AssertionError(finish(process))
    assert designs(folder).count(b"\n") > count  # and a line of names
    return process


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder in which a search ran without interruption, and what the command printed."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "study.yaml"
    path.write_text(STUDY)
    code, output, errors = finish(begin(path, folder / "out"))
    assert code == 0, errors
    assert "designs/s" in errors
    return folder / "out", output


def test_the_command_leaves_table_winner_and_report(whole):
    folder, output = whole
    assert designs(folder).count(b"\n") > 200
    for name in ("winner.yaml", "pareto_front.png", "parallel_coordinates.png", "report.md"):
        assert str(folder / name) in output
    assert load_robot(folder / "winner.yaml").name == "hexapod"
    assert "| condition_number |" in output


def test_a_search_that_is_killed_and_interrupted_goes_on_with_nothing_lost(study, whole, tmp_path):
    folder = tmp_path / "out"
    kept = b""
    for count in (1, 60):
        process = begin_held(count, study, folder, "--workers", "2")
        process.kill()
        assert finish(process)[0] == -signal.SIGKILL
        assert designs(folder).startswith(kept)
        kept = designs(folder)[: designs(folder).rfind(b"\n") + 1]

    process = begin_held(120, study, folder, start_new_session=True)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does, to the workers too
    code, _, errors = finish(process)
    assert code == 130
    assert "stopped; what was found is kept" in errors
    assert "Traceback" not in errors
    assert designs(folder).startswith(kept)
    assert designs(folder).endswith(b"\n")

    code, _, errors = finish(begin(study, folder, "--workers", "1"))
    assert code == 0, errors
    assert designs(folder) == designs(whole[0])
    winner = (folder / "winner.yaml").read_text()
    assert winner == (whole[0] / "winner.yaml").read_text()


def test_a_full_disk_is_told_and_what_was_found_is_kept(study, whole, tmp_path):
    folder, size = tmp_path / "out", 12_000

    def limit_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    code, _, errors = finish(begin(study, folder, preexec_fn=limit_files))
    assert code == 1
    assert "designs.csv: cannot be written: File too large; what was found before is kept" in errors
    assert "Traceback" not in errors
    assert size - 300 < len(designs(folder)) <= size
    assert designs(whole[0]).startswith(designs(folder))


def test_a_worker_that_is_killed_costs_no_result(study, whole, tmp_path):
    folder = tmp_path / "out"
    process = begin_held(20, study, folder, "--workers", "2")
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    worker = next(k for k in children if b"spawn_main" in Path(f"/proc/{k}/cmdline").read_bytes())
    os.kill(int(worker), signal.SIGKILL)
    code, _, errors = finish(process)
    assert code == 0, errors
    assert designs(folder) == designs(whole[0])


REFUSED = {
    "bad study": (("seed: 1", "seed: x"), (), ["study.yaml:10: seed", "'x'"]),
    "unknown objective": (("condition_number", "beauty"), (), ["study.yaml:8", "beauty"]),
    "no workers": (("", ""), ("--workers", "0"), ["workers: 0; allowed: >= 1"]),
    "nobody listens": (
        ("", ""),
        ("--scheduler", "tcp://127.0.0.1:9"),
        ["scheduler tcp://127.0.0.1:9: not reachable"],
    ),
    "no address": (
        ("", ""),
        ("--scheduler", "nowhere"),
        ["scheduler 'nowhere'", "tcp://HOST:PORT"],
    ),
}


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_done_is_told_in_one_message(study, tmp_path, case):
    change, options, words = case
    study.write_text(STUDY.replace(*change))
    code, _, errors = finish(begin(study, tmp_path / "out", *options))
    assert code == 1
    assert errors.startswith("search_geometry: ")
    assert "Traceback" not in errors
    for word in words:
        assert word in errors
    assert not designs(tmp_path / "out")
