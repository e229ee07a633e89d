# SPDX-License-Identifier: Apache-2.0
"""The examples as a newcomer runs them: as programs, against real nodes."""

import json
import os
import signal
import subprocess
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray
from leg_msgs_py.client import LegClient
from node_processes import NodeProcesses
from nodes_support import PATIENCE, START_TIMEOUT, wait_for, wait_until_ready
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import claim_domain
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from leg_kinematics.errors import DescriptionError
from leg_statics import BodyPose, Load, evaluate_stances, robot_stance, support_region

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
KEPT = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)
DISTANCE = 3.0


def start(name, *arguments, **environment):
    return subprocess.Popen(
        [sys.executable, EXAMPLES / name, *map(str, arguments)],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(name, *arguments, timeout=START_TIMEOUT, **environment):
    process = start(name, *arguments, **environment)
    try:
        output, errors = process.communicate(timeout=timeout)
    finally:
        process.kill()
    return SimpleNamespace(code=process.returncode, output=output, errors=errors)


@pytest.fixture(scope="module")
def nodes():
    # Not the session's `suite`: 10,000 candidates are more points than that one accepts.
    with (
        NodeProcesses("hexapod", namespace="examples") as nodes,
        LegClient(namespace="examples", timeout=PATIENCE) as client,
    ):
        wait_until_ready(client, nodes)
        yield client


@pytest.fixture(scope="module")
def walk(nodes, tmp_path_factory):
    """A walk over the shipped terrain: what it printed, wrote and published."""
    folder = tmp_path_factory.mktemp("walk")
    published = {"footholds": [], "step_length": [], "plan": []}
    types = {"footholds": PoseArray, "step_length": Float64, "plan": MarkerArray}
    subscriptions = [
        nodes.node.create_subscription(
            types[topic], f"/walker/{topic}", published[topic].append, KEPT
        )
        for topic in types
    ]
    plan = folder / "walk.json"
    ros = ["--ros-args", "-p", "robot:=examples", "-p", f"distance:={DISTANCE}"]
    program = run("04_walk_over_terrain.py", "--output", folder, "--json", plan, *ros)
    assert program.code == 0, program.output + program.errors
    steps = len(json.loads(plan.read_text())["half_steps"])
    wait_for(lambda: all(len(published[topic]) >= steps for topic in ("footholds", "step_length")))
    wait_for(lambda: published["plan"])
    for subscription in subscriptions:
        nodes.node.destroy_subscription(subscription)
    return SimpleNamespace(
        folder=folder, plan=json.loads(plan.read_text()), published=published, program=program
    )


@pytest.fixture(scope="module")
def terrain():
    sys.path.insert(0, str(EXAMPLES))
    try:
        import terrain
    finally:
        sys.path.remove(str(EXAMPLES))
    return terrain


def test_a_stance_is_chosen_and_drawn_without_nodes(tmp_path):
    answer = run("05_choose_stance.py", "--output", tmp_path)
    assert answer.code == 0, answer.errors
    first, *_, best, pose, _ = answer.output.splitlines()
    assert "let 120 kg stand" in first
    assert float(best.split()[3]) > 1.0
    assert float(pose.split("mass is")[1].split()[0]) > 0.0
    for name in ("support_region.png", "stance_margins.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_footholds_are_found_on_rubble_stairs_a_slope_and_before_a_gap(tmp_path):
    answer = run("06_footholds_on_terrain.py", "--output", tmp_path)
    assert answer.code == 0, answer.errors
    grounds = ("rubble", "stairs", "slope", "gap")
    assert {path.name for path in tmp_path.iterdir()} == {f"terrain_{g}.png" for g in grounds}
    lines = [line.split() for line in answer.output.splitlines() if "footholds; the best" in line]
    assert len(lines) == 8
    assert all(int(line[1]) > 20 and float(line[-1]) > 0.3 for line in lines)


def test_without_nodes_an_example_says_how_to_start_them():
    answer = run("01_ask_one_foothold.py", ROS_DOMAIN_ID=claim_domain())
    assert answer.code == 1
    assert "make run" in answer.errors
    assert "Traceback" not in answer.errors


def test_the_walk_arrives_and_writes_its_pictures(walk):
    assert walk.plan["arrived"]
    assert walk.plan["half_steps"][-1]["body_end"][0] == pytest.approx(DISTANCE)
    for name in ("walk_terrain.png", "walk_steps.png"):
        assert (walk.folder / name).read_bytes().startswith(b"\x89PNG")


def test_the_walk_publishes_every_half_step(walk):
    steps = walk.plan["half_steps"]
    published = walk.published
    assert [message.data for message in published["step_length"]] == [
        step["step_length"] for step in steps
    ]
    assert len(published["footholds"]) == len(steps)
    for message, step in zip(published["footholds"], steps, strict=True):
        assert message.header.frame_id == "map"
        places = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
        np.testing.assert_allclose(places, [foot["position"] for foot in step["footholds"]])
    assert published["plan"]
    names = {marker.ns for marker in published["plan"][-1].markers}
    assert {"body", "left_front", "right_rear"} <= names


def test_every_stance_holds_with_its_reserve_from_touchdown_to_lift_off(walk, hexapod):
    for step in walk.plan["half_steps"]:
        feet = {foot["leg"]: foot["position"] for foot in step["footholds"]}
        friction = [foot["friction"] for foot in step["footholds"]]
        start, end = np.array(step["body_start"]), np.array(step["body_end"])
        bodies = start + np.array([[0.0], [0.5], [1.0]]) * (end - start)
        stance = robot_stance(hexapod, feet, friction, BodyPose(bodies))
        load = Load(walk.plan["mass"], bodies)
        found = evaluate_stances(stance, load)
        assert found.stands.all(), (step, found.verdict)
        assert found.load_factor.min() == pytest.approx(step["load_factor"], rel=1e-6)
        assert step["load_factor"] >= walk.plan["reserve"]
        margin = support_region(stance, load, 12).margin.min()
        assert margin == pytest.approx(step["margin"], abs=1e-6)
        assert margin > 0.0


def test_the_walk_avoids_pit_kerb_and_edges(walk, terrain):
    land = terrain.load_terrain(EXAMPLES / "terrain.yaml")
    feet = [foot for step in walk.plan["half_steps"] for foot in step["footholds"]]
    places = np.array([foot["position"] for foot in feet])
    names = Counter(land.patches[k].name for k in land.at(places))
    assert not {"pit", "kerb"} & set(names)
    assert {"base", "ice"} <= set(names)
    assert {"first_board", "second_board"} & set(names)
    assert (land.under_foot(places, 0.03) >= 0).all()
    np.testing.assert_allclose(places[:, 2], land.height(places))


def test_no_foot_needs_more_friction_than_there_is(walk):
    feet = [foot for step in walk.plan["half_steps"] for foot in step["footholds"]]
    assert min(foot["friction"] for foot in feet) < 0.2  # some stand on ice
    assert all(foot["friction_used"] <= foot["friction"] + 1e-6 for foot in feet)
    assert all(foot["load"] > 0.0 for foot in feet)


def test_the_tripods_take_turns(walk):
    tripods = [
        frozenset(foot["leg"] for foot in step["footholds"]) for step in walk.plan["half_steps"]
    ]
    assert all(len(tripod) == 3 for tripod in tripods)
    assert all(a.isdisjoint(b) for a, b in pairwise(tripods))


def test_the_walk_stops_with_a_reason_where_it_cannot_go_on(nodes, tmp_path):
    chasm = tmp_path / "chasm.yaml"
    chasm.write_text(
        "base: {height: 0.0, ground: cement}\n"
        "patches:\n"
        "  chasm: {x: [0.7, 3.0], y: [-5, 5], height: -2.0, ground: cement}\n"
    )
    plan = tmp_path / "walk.json"
    ros = ["--ros-args", "-p", "robot:=examples", "-p", f"terrain:={chasm}"]
    program = run("04_walk_over_terrain.py", "--output", tmp_path, "--json", plan, *ros)
    assert program.code == 1
    assert "no footholds" in program.errors
    walk = json.loads(plan.read_text())
    assert not walk["arrived"]
    assert walk["half_steps"]
    assert all(f["position"][0] < 0.7 for s in walk["half_steps"] for f in s["footholds"])


def test_ctrl_c_ends_the_walk_cleanly(nodes, tmp_path):
    ros = ["--ros-args", "-p", "robot:=examples", "-p", "pause:=0.2", "-p", "distance:=1000.0"]
    walker = start("04_walk_over_terrain.py", "--output", tmp_path, *ros, PYTHONUNBUFFERED="1")
    try:
        assert walker.stdout.readline().strip().startswith("1 ")
        walker.send_signal(signal.SIGINT)
        output, errors = walker.communicate(timeout=PATIENCE)
    finally:
        walker.kill()
    assert walker.returncode == 0, errors
    assert "Stopped." in output
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: {height: 0.0}", r":1: base: missing key 'ground'"),
        ("base: {height: .nan, ground: ice}", r"base\.height: nan is not a finite number"),
        ("base: {height: 0.0, ground: lava}", r"base\.ground: 'lava' is not one of: ice, wood"),
        (
            "base: {height: 0.0, ground: ice}\n"
            "patches: {hole: {x: [2, 1], y: [0, 1], height: 0, ground: ice}}",
            r":2: patches\.hole\.x: \[2, 1\]: the first end must be < the second",
        ),
        (
            "base: {height: 0.0, ground: ice}\n"
            "patches: {hole: {x: [1, 2], y: [0, 1], depth: 1, height: 0, ground: ice}}",
            r":2: patches\.hole: unknown key 'depth'; allowed: x, y, height, ground",
        ),
        ("base: [", r"terrain\.yaml"),
    ],
)
def test_mistakes_in_a_terrain_file_are_told(terrain, tmp_path, text, message):
    path = tmp_path / "terrain.yaml"
    path.write_text(text)
    with pytest.raises(DescriptionError, match=message):
        terrain.load_terrain(path)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("terrain:=nowhere.yaml", "nowhere.yaml does not exist"),
        ("mass:=-5", "parameter mass: got -5; allowed: a number >= 0"),
    ],
)
def test_a_wrong_parameter_ends_the_planner_with_the_mistake(parameter, message):
    program = run("04_walk_over_terrain.py", "--ros-args", "-p", parameter)
    assert program.code == 1
    assert message in program.errors
    assert "Traceback" not in program.errors


def test_one_patch_lies_on_another_and_the_smoothest_ground_counts(terrain):
    def patch(name, x, height, friction):
        return terrain.Patch(name, x, (-1.0, 1.0), height, name, friction)

    everywhere = (-np.inf, np.inf)
    base = terrain.Patch("base", everywhere, everywhere, 0.0, "base", 0.4)
    land = terrain.Terrain(
        (base, patch("ice", (0.0, 1.0), 0.0, 0.1), patch("step", (0.5, 1.0), 0.2, 0.6))
    )
    points = [[-0.5, 0.0], [-0.02, 0.0], [0.25, 0.0], [0.49, 0.0], [0.75, 0.0]]
    assert land.at(points).tolist() == [0, 0, 1, 1, 2]
    assert land.under_foot(points, 0.03).tolist() == [0, 1, 1, -1, 2]
    np.testing.assert_allclose(land.height(points), [0.0, 0.0, 0.0, 0.0, 0.2])
