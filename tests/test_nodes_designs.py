# SPDX-License-Identifier: Apache-2.0
"""The designs node: searches as an action, with progress, cancellation and bad studies."""

import subprocess

import numpy as np
import pytest
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from node_processes import find_executable
from nodes_support import PATIENCE, START_TIMEOUT, is_served, wait_for

from leg_kinematics.description import robot_from_document
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
    results = tmp_path_factory.mktemp("results")
    arguments = ["-r", "__ns:=/studio", "-p", f"results:={results}", "-p", "workers:=1"]
    node = subprocess.Popen(
        [find_executable("leg_statics", "designs_node"), "--ros-args", *arguments],
        start_new_session=True,
    )
    try:
        with LegClient(namespace="studio", timeout=PATIENCE) as client:
            wait_for(lambda: is_served(client, "search_geometry"), START_TIMEOUT)
            client.results = results
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


def test_a_cancelled_search_gives_what_there_is_and_goes_on_later(client, tmp_path):
    progress = []
    work = client.search_geometry.future(ENDLESS, tmp_path / "out", on_progress=progress.append)
    wait_for(lambda: progress and progress[-1].evaluated > 20, START_TIMEOUT)
    assert progress[-1].total == 10**9
    assert progress[-1].rate > 0.0
    assert np.isfinite(progress[-1].best).all()
    waiting = client.search_geometry.future(STUDY, tmp_path / "other")
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
    again = client.search_geometry.future(ENDLESS, tmp_path / "out", on_progress=heard.append)
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


def test_a_folder_that_cannot_be_used_is_told(client, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(errors.InvalidInputError, match="cannot be written: Not a directory"):
        client.search_geometry(STUDY, tmp_path / "file" / "out")
