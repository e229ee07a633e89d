# SPDX-License-Identifier: Apache-2.0
"""The designs node: searches as an action, with progress, cancellation and bad studies."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from node_processes import find_executable
from nodes_support import PATIENCE, START_TIMEOUT, is_served, set_parameter, wait_for

from leg_kinematics.description import find_robot_file, robot_from_document
from leg_kinematics.documents import Document

STUDY = """\
version: 1
name: cheap
units: {length: mm, angle: deg}
base: {leg_type: initial}        # of the node's robot
parameters:
  drive_lever: {from: 60, to: 200}
  shank_length: {from: 320, to: 520}
objectives: [condition_number, unit_effort_capacity]
method: {name: samples, designs: 64}
tolerance: 0.5
"""
ENDLESS = STUDY.replace("designs: 64", "designs: 1000000000")


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """A client of a designs node of its own."""
    results, robots = tmp_path_factory.mktemp("results"), tmp_path_factory.mktemp("robots")
    parameters = [f"output_root:={results}", f"robot_folders:=[{robots}]", "workers:=1"]
    arguments = ["-r", "__ns:=/studio", *(word for p in parameters for word in ("-p", p))]
    node = subprocess.Popen(
        [find_executable("leg_statics", "designs_node"), "--ros-args", *arguments],
        start_new_session=True,
    )
    try:
        with LegClient(namespace="studio", timeout=PATIENCE) as client:
            wait_for(lambda: is_served(client, "search_geometry"), START_TIMEOUT)
            client.results, client.robots, client.process = results, robots, node.pid
            yield client
            assert node.poll() is None
    finally:
        node.terminate()
        assert node.wait(PATIENCE) == 0


def test_a_search_finds_designs_and_a_robot(client, tmp_path):
    found = client.search_geometry(STUDY)
    assert found.evaluated == 64
    assert found.parameters == ("drive_lever", "shank_length")
    assert found.objectives == ("condition_number", "unit_effort_capacity")
    assert found.best_parameters.shape == found.best_objectives.shape
    assert np.all(np.diff(found.best_objectives, axis=0) > 0.0)  # a better one costs the other
    robot = robot_from_document(Document(tmp_path / "winner", found.robot))
    lengths = [robot.legs["left_front"].geometry.drive_lever]
    lengths.append(robot.legs["left_front"].geometry.shank_length)
    assert np.isclose(found.best_parameters, lengths).all(axis=1).any()
    assert found.folder.startswith(str(client.results))
    assert client.search_geometry(STUDY, found.folder).best_parameters == pytest.approx(
        found.best_parameters
    )


def test_a_cancelled_search_gives_what_there_is_and_goes_on_later(client):
    progress = []
    work = client.search_geometry.future(ENDLESS, "out", on_progress=progress.append)
    wait_for(lambda: progress and progress[-1].evaluated > 20, START_TIMEOUT)
    assert progress[-1].total == 10**9
    assert progress[-1].rate > 0.0
    assert np.isfinite(progress[-1].best).all()
    waiting = client.search_geometry.future(STUDY, "other")
    waiting.cancel()
    with pytest.raises(errors.CancelledError) as caught:
        waiting.wait()
    assert caught.value.partial.evaluated == 0
    work.cancel()
    with pytest.raises(errors.CancelledError, match="cancelled by the caller after") as caught:
        work.wait()
    partial = caught.value.partial
    assert 20 < partial.evaluated < 10**9
    assert len(partial.best_parameters)
    assert partial.robot
    heard = []
    again = client.search_geometry.future(ENDLESS, "out", on_progress=heard.append)
    wait_for(lambda: heard and heard[-1].evaluated >= partial.evaluated, START_TIMEOUT)
    again.cancel()
    with pytest.raises(errors.CancelledError):
        again.wait()


BAD = {
    "no YAML": (("units: {", "units: {{"), ["study:4"]),
    "unknown parameter": (("drive_lever", "drive_liver"), ["study:6", "did you mean"]),
    "unknown objective": (("condition_number", "beauty"), ["objectives.0", "beauty"]),
    "version": (("version: 1", "version: 9"), ["study:1", "version", "9"]),
    "unknown robot": (("leg_type", "robot: spider, leg_type"), ["base.robot", "spider"]),
}


@pytest.mark.parametrize("case", BAD.values(), ids=BAD.keys())
def test_a_bad_study_is_ended_with_the_reason(client, case):
    change, words = case
    with pytest.raises(errors.InvalidInputError) as caught:
        client.search_geometry(STUDY.replace(*change))
    for word in words:
        assert word in caught.value.message


def test_a_folder_that_cannot_be_used_is_told(client):
    (client.results / "file").write_text("")
    with pytest.raises(errors.InvalidInputError, match="cannot be written: Not a directory"):
        client.search_geometry(STUDY, "file/out")


def processor_time(process: int) -> float:
    """Return the processor time that a process has taken [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def greatest_memory(process: int) -> int:
    """Return the most memory that a process ever had [bytes]."""
    text = Path(f"/proc/{process}/status").read_text()
    return 1024 * int(text.partition("VmHWM:")[2].split()[0])


LAUGHS = "a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize("study", [LAUGHS, STUDY + "x: " + "[" * 60_000, "- 1\n" * 1_000_000])
def test_a_study_without_end_costs_neither_time_nor_memory(client, study):
    before, memory = processor_time(client.process), greatest_memory(client.process)
    with pytest.raises(errors.InvalidInputError, match=r"study:?\d*: .*(allowed|deeper)"):
        client.search_geometry(study)
    assert processor_time(client.process) - before < 1.0
    assert greatest_memory(client.process) - memory < len(study) * 5 + 50e6


def test_results_go_below_the_output_root_only(client, tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (client.results / "link").symlink_to(outside)
    within = client.results / "with_links"
    within.mkdir(exist_ok=True)
    (within / "designs.csv").symlink_to(outside / "designs.csv")
    homes = ("~/out", "~nobody_at_all/out")
    for folder in (outside, "../outside", "link", "link/below", "with_links", *homes):
        with pytest.raises(errors.InvalidInputError, match=r"allowed: a path below|no home folder"):
            client.search_geometry(STUDY, folder)
    assert not list(outside.iterdir())
    found = client.search_geometry(STUDY, client.results / "deep" / "down")
    assert found.folder == str(client.results / "deep" / "down")
    assert (client.results / "deep" / "down" / "designs.csv").is_file()


def test_robots_are_shipped_or_in_allowed_folders_and_no_answer_tells_what_is_in_a_file(
    client, tmp_path
):
    shipped = find_robot_file("quadruped").read_text()
    (client.robots / "mine.yaml").write_text(shipped)
    (client.robots / "note.yaml").write_text("password: open sesame")
    (client.robots / "broken.yaml").write_text("password: {open sesame")
    secret = tmp_path / "secret.yaml"
    secret.write_text("password: open sesame")
    (client.robots / "link.yaml").symlink_to(secret)
    for robot, words in (
        ("note.yaml", "is no robot description"),
        ("broken.yaml", "is no robot description"),
        (secret, "robot_folders"),
        ("link.yaml", "robot_folders"),
        ("../" * 20 + str(secret)[1:], "robot_folders"),
        ("~/robot.yaml", "robot_folders"),
        ("~nobody_at_all/robot.yaml", "robot_folders"),
        ("/etc/passwd", "robot_folders"),
        ("nothing.yaml", "robot_folders"),
    ):
        with pytest.raises(errors.InvalidInputError, match=words) as caught:
            client.search_geometry(STUDY.replace("leg_type", f"robot: {robot}, leg_type"))
        assert "sesame" not in caught.value.message
        assert "root:" not in caught.value.message
    with pytest.raises(errors.InvalidInputError, match=r"base\.leg_type: unknown leg type"):
        client.search_geometry(STUDY.replace("leg_type", "robot: mine.yaml, leg_type"))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("output_root", "/"),
        ("robot_folders", ["/"]),
        ("scheduler", "tcp://127.0.0.1:8786"),
        ("workers", 1000),
    ],
)
def test_what_opens_the_machine_cannot_be_set_at_run_time(client, name, value):
    result = set_parameter(client.node, "studio/designs", name, value)
    assert not result.successful
    assert "read-only" in result.reason
