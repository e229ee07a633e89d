# SPDX-License-Identifier: Apache-2.0
"""Nodes that start, stop, restart and change their robot; clients that live through it."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from leg_msgs_py import errors
from leg_msgs_py.client import LegClient
from node_processes import NodeProcesses, find_executable, node_names
from nodes_support import PATIENCE, START_TIMEOUT, set_parameter, wait_for, wait_until_ready
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

ROOT = Path(__file__).resolve().parent.parent
FOOT = [-0.1, 0.0, -0.65]
JOINT = "left_front_crank_1"


@pytest.fixture
def hexapod_file(tmp_path):
    """Write a description made from the hexapod's and return its path."""
    text = (ROOT / "config" / "robots" / "hexapod.yaml").read_text()

    def write(name, *changes):
        changed = text
        for old, new in changes:
            assert old in changed
            changed = changed.replace(old, new)
        path = tmp_path / f"{name}.yaml"
        path.write_text(changed)
        return str(path)

    return write


# --------------------------------------------------------------------------- effort limits


def test_a_late_subscriber_receives_the_limits_in_force(suite):
    changed = suite.client.set_effort_limits("left_front", [JOINT], [120.0], [-90.0])
    try:
        with LegClient() as late:
            limits = late.effort_limits()
        k = limits.joint_names.index(JOINT)
        assert (limits.lower[k], limits.upper[k]) == (-90.0, 120.0)
        assert changed.joint_names == limits.joint_names
        np.testing.assert_array_equal(changed.upper, limits.upper)
        assert suite.client.describe("left_front").effort_limits[0].tolist() == [-90.0, 120.0]
    finally:
        suite.client.set_effort_limits("left_front", [JOINT], [150.0])


def test_new_limits_are_all_put_in_force_or_none(suite):
    before = suite.client.describe("left_front").effort_limits
    with pytest.raises(errors.InvalidInputError):
        suite.client.set_effort_limits("left_front", [JOINT, "left_front_crank_2"], [10.0, -1.0])
    np.testing.assert_array_equal(suite.client.describe("left_front").effort_limits, before)


def test_new_limits_change_the_utilisation(suite):
    force = [0.0, 0.0, 300.0]
    before = suite.client.compute_efforts("left_front", FOOT, force)
    names = before.joint_names
    suite.client.set_effort_limits("left_front", names, [75.0] * 3)
    try:
        after = suite.client.compute_efforts("left_front", FOOT, force)
        np.testing.assert_allclose(after.utilisation, 2.0 * before.utilisation)
    finally:
        suite.client.set_effort_limits("left_front", names, [150.0] * 3)


# --------------------------------------------------------------------------- parameters


@pytest.mark.parametrize("server", ["kinematics", "statics"])
def test_a_wrong_robot_is_refused_with_the_reason_and_the_old_one_stays(
    suite, hexapod_file, server, tmp_path_factory
):
    node = suite.client.node
    wrong = hexapod_file("wrong", ("rod_length: 220", "rod_length: -220"))
    secret = str(tmp_path_factory.getbasetemp().parent / f"secret_{os.getpid()}.yaml")
    Path(secret).write_text("password: open sesame")
    for value, words in (
        (wrong, ["wrong.yaml", "rod_length", "-220"]),
        ("decapod", ["decapod", "hexapod"]),
        ("/nowhere/robot.yaml", ["/nowhere/robot.yaml", "robot_folders"]),
        (secret, [secret, "robot_folders"]),
        ("~nobody_at_all/robot.yaml", ["robot_folders"]),
        ("", ["shipped robots"]),
    ):
        result = set_parameter(node, server, "robot", value)
        assert not result.successful
        for word in words:
            assert word in result.reason
        assert "sesame" not in result.reason
    Path(secret).unlink()
    assert len(suite.client.legs()) == 6
    assert suite.client.inverse_kinematics("left_front", FOOT).status == 0


@pytest.mark.parametrize(
    ("server", "name", "value"),
    [
        ("statics", "friction_coefficient", -0.1),
        ("statics", "friction_coefficient", 11.0),
        ("statics", "friction_coefficient", "rough"),
        ("statics", "state_rate_limit", -1.0),
        ("statics", "diagnostics_rate", 2.0),  # read-only
        ("statics", "robot_folders", ["/"]),  # read-only
        ("kinematics", "max_points", 0),
        ("kinematics", "robot", 6),
        ("kinematics", "colour", "red"),
    ],
)
def test_a_wrong_parameter_is_refused(suite, server, name, value):
    assert not set_parameter(suite.client.node, server, name, value).successful


def test_a_new_robot_is_taken_up(suite, hexapod_file):
    node, client = suite.client.node, suite.client
    other = hexapod_file(
        "other", ("name: hexapod", "name: walker"), ("crank_1: 150", "crank_1: 80"),
        ("left_front:", "nose:"),
    )  # fmt: skip
    try:
        for server in node_names():
            assert set_parameter(node, server, "robot", other).successful
        assert client.legs()[0] == "nose"
        assert client.describe("nose").robot == "walker"
        assert client.inverse_kinematics("nose", FOOT).joint_names[0] == "nose_crank_1"
        wait_for(lambda: client.effort_limits().upper[0] == 80.0)
        with pytest.raises(errors.UnknownLegError):
            client.inverse_kinematics("left_front", FOOT)
    finally:
        for server in node_names():
            assert set_parameter(node, server, "robot", "hexapod").successful
    assert client.legs()[0] == "left_front"


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"robot": "decapod"}, "decapod"),
        ({"robot": 3}, "robot"),
        ({"max_points": -5}, "max_points"),
    ],
)
def test_a_node_that_cannot_start_says_why(parameters, words):
    nodes = NodeProcesses(
        names=["kinematics"],
        parameters=parameters,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    with nodes:
        output, _ = nodes.processes["kinematics"].communicate(timeout=START_TIMEOUT)
    assert nodes.ended() == {"kinematics": 1}
    assert words in output.decode()
    assert "Traceback" not in output.decode()


# --------------------------------------------------------------------------- clients

TWO_CLIENTS = """
import numpy as np
from leg_msgs_py.client import LegClient
seed = {seed}
with LegClient(timeout=60.0) as client:
    feet = client.describe("left_front").initial_foot_position
    feet = feet + np.random.default_rng(seed).uniform(-0.03, 0.03, (50, 3))
    for _ in range(60):
        joints = client.inverse_kinematics("left_front", feet).joint_positions
        back = client.forward_kinematics("left_front", joints).positions
        assert np.abs(back - feet).max() < 1e-9
print("all answers were mine")
"""


def test_two_clients_at_once_get_their_own_answers(suite):
    scripts = [
        subprocess.Popen(
            [sys.executable, "-c", TWO_CLIENTS.format(seed=seed)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        for seed in (1, 2)
    ]
    for script in scripts:
        output, _ = script.communicate(timeout=START_TIMEOUT)
        assert (script.returncode, output.decode()) == (0, "all answers were mine\n")


def test_many_threads_share_a_client(suite):
    wanted = suite.client.inverse_kinematics("left_front", FOOT).joint_positions
    wrong = []

    def ask():
        for _ in range(20):
            answer = suite.client.inverse_kinematics("left_front", FOOT).joint_positions
            if not np.array_equal(answer, wanted):
                wrong.append(answer)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
        assert not thread.is_alive()
    assert not wrong


def test_many_requests_may_be_under_way(suite):
    feet = np.linspace(FOOT, np.add(FOOT, [0.03, 0.0, 0.0]), 300)
    futures = [suite.client.inverse_kinematics.future("left_front", foot) for foot in feet]
    joints = [future.wait().joint_positions for future in futures]
    back = suite.client.forward_kinematics("left_front", joints)
    np.testing.assert_allclose(back.positions, feet, atol=1e-9)


class Planner(Node):
    """A node that asks from its own callback, by awaiting."""

    def __init__(self, context):
        super().__init__("planner", context=context)
        self.client = LegClient(node=self, timeout=PATIENCE)
        self.answers = []
        self.timer = self.create_timer(0.01, self.plan)

    async def plan(self):
        self.timer.cancel()
        try:
            feet = await self.client.forward_kinematics.future("left_front", np.zeros((2, 3)))
            back = await self.client.inverse_kinematics.future("left_front", feet.positions)
            self.answers.append(back.joint_positions)
            await self.client.describe.future("tail")
        except errors.LegServiceError as error:
            self.answers.append(error)


@pytest.fixture
def planner(suite):
    """A planner that spins in a thread, in a context of its own."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Planner(context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    stop = threading.Event()

    def spin():
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.1)

    thread = threading.Thread(target=spin)
    thread.start()
    yield node
    node.client.close()
    stop.set()
    thread.join()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_a_node_asks_from_its_own_callback(planner):
    wait_for(lambda: len(planner.answers) == 2)
    np.testing.assert_allclose(planner.answers[0], np.zeros((2, 3)), atol=1e-9)
    assert isinstance(planner.answers[1], errors.UnknownLegError)


def test_a_shared_node_may_be_asked_from_another_thread(planner):
    assert planner.client.inverse_kinematics("left_front", FOOT).status == 0
    assert len(planner.client.effort_limits().joint_names) == 18


def test_a_call_that_blocks_the_callback_it_waits_in_blames_the_callback(suite):
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("blocked", context=context)
    client = LegClient(node=node, timeout=0.5)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    told = []

    def ask():
        timer.cancel()
        wait_for(lambda: node.count_services("/kinematics/inverse_kinematics"))
        with pytest.raises(errors.TimedOutError) as caught:
            client.inverse_kinematics("left_front", FOOT)
        told.append(caught.value.message)

    timer = node.create_timer(0.01, ask)
    while not told:
        executor.spin_once(timeout_sec=0.1)
    assert "no executor worked for the client's node" in told[0]
    client.close()
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_a_client_of_another_namespace_is_told_which_servers_there_are(suite):
    with LegClient(namespace="robot_9", timeout=0.3) as client:
        wait_for(lambda: client.node.count_services("/kinematics/inverse_kinematics"))
        wait_for(lambda: client.node.count_services("/maps/compute_index_map/_action/send_goal"))
        with pytest.raises(
            errors.ServerUnavailableError,
            match=r"no node serves /robot_9/kin.*; there is /kinematics/inverse_kinematics; ",
        ):
            client.inverse_kinematics("left_front", FOOT)
        with pytest.raises(errors.ServerUnavailableError, match=r"there is /maps/compute_index"):
            client.compute_index_map("left_front", 0.05)


def test_a_closed_client_says_so(suite):
    client = LegClient()
    client.close()
    client.close()
    with pytest.raises(errors.CancelledError):
        client.legs()


def test_a_cancelled_call_says_so(suite):
    future = suite.client.legs.future()
    future.cancel()
    with pytest.raises(errors.CancelledError):
        future.wait()
    assert len(suite.client.legs()) == 6


def test_without_a_server_the_call_ends_after_the_time_allowed():
    with LegClient(namespace="nobody/here", timeout=0.3) as client:
        with pytest.raises(
            errors.ServerUnavailableError, match=r"/nobody/here/kinematics/.* waited 0\.3 s"
        ):
            client.inverse_kinematics("left_front", FOOT)
        with pytest.raises(errors.ServerUnavailableError):
            client.effort_limits()
        with pytest.raises(errors.ServerUnavailableError):
            client.wait_until_ready(timeout=0.1)


# --------------------------------------------------------------------------- stop and restart


def test_a_server_that_hangs_is_a_time_out_and_works_again_later(suite):
    process = suite.nodes.processes["kinematics"]
    with LegClient(timeout=0.5) as client:
        client.wait_until_ready(PATIENCE)
        process.send_signal(signal.SIGSTOP)
        try:
            deadline = time.monotonic() + PATIENCE
            told = ""
            while "no answer" not in told:  # a busy machine may keep the client from listening
                assert time.monotonic() < deadline, told
                with pytest.raises(errors.TimedOutError) as raised:
                    client.inverse_kinematics("left_front", FOOT)
                told = str(raised.value)
        finally:
            process.send_signal(signal.SIGCONT)
        client.caller.timeout = PATIENCE
        assert client.inverse_kinematics("left_front", FOOT).status == 0


def test_a_client_lives_through_a_restart_and_a_crash_of_nodes():
    outputs = []
    nodes = NodeProcesses(namespace="robot_1", stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    with nodes, LegClient(namespace="robot_1", timeout=START_TIMEOUT) as client:
        wait_until_ready(client, nodes)
        wanted = client.inverse_kinematics("left_front", FOOT).joint_positions
        capacity = client.query_footholds("left_front", FOOT, 0.4).load_capacity
        for name, number, code in (
            ("kinematics", signal.SIGKILL, -signal.SIGKILL),  # the middleware does not know yet
            ("maps", signal.SIGINT, 0),
            ("statics", signal.SIGTERM, 0),
        ):
            nodes.processes[name].send_signal(number)
            outputs.append(nodes.processes[name].communicate(timeout=PATIENCE)[0].decode())
            assert nodes.processes[name].returncode == code
        solved = client.inverse_kinematics.future("left_front", FOOT)  # nobody is there
        carried = client.query_footholds.future("left_front", FOOT, 0.4)
        for name in node_names():
            nodes.start(name)
        np.testing.assert_array_equal(solved.wait().joint_positions, wanted)
        assert carried.wait().load_capacity == capacity
        assert len(client.legs()) == 6
    for output in outputs:
        assert "Traceback" not in output


def test_a_manipulator_with_four_coordinates_is_served():
    with (
        NodeProcesses("gantry", namespace="gantry") as nodes,
        LegClient(namespace="gantry", timeout=PATIENCE) as client,
    ):
        wait_until_ready(client, nodes)
        arm = client.describe("")
        assert arm.task_coordinates == ("x", "y", "z", "beta")
        joints = [[0.0, 0.0, 0.0, 0.0], [0.001, 0.002, -0.001, 0.0005]]
        pose = client.forward_kinematics("", joints).positions
        assert pose.shape == (2, 4)
        back = client.inverse_kinematics("", pose).joint_positions
        np.testing.assert_allclose(back, joints, atol=1e-9)
        answer = client.jacobian("", pose)
        assert answer.jacobian.shape == (2, 4, 4)
        assert answer.angular_jacobian.shape == (2, 3, 4)
        with pytest.raises(errors.NotSupportedError, match="beta"):
            client.forward_kinematics("", joints, frame=arm.base_frame)
        with pytest.raises(errors.NotSupportedError, match="beta"):
            client.compute_efforts("", pose, [0.0, 0.0, 1.0])
        assert nodes.ended() == {}


# --------------------------------------------------------------------------- tools


def test_run_robot_starts_and_stops_all_nodes():
    tool = subprocess.Popen(
        [sys.executable, ROOT / "tools" / "run_robot.py", "--namespace", "tool"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    with LegClient(namespace="tool") as client:
        client.wait_until_ready(START_TIMEOUT)
    tool.send_signal(signal.SIGINT)
    output = tool.communicate(timeout=PATIENCE)[0].decode()
    assert tool.returncode == 0
    assert "Traceback" not in output
    for name in node_names():
        assert f"{name} runs as process" in output


def test_run_robot_tells_when_a_node_dies():
    tool = subprocess.Popen(
        [sys.executable, "-u", ROOT / "tools" / "run_robot.py", "--namespace", "dying"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    line = next(line for line in tool.stdout if line.strip().startswith("statics runs as"))
    os.kill(int(line.split()[-1]), signal.SIGKILL)
    output = tool.communicate(timeout=PATIENCE)[0]
    assert tool.returncode == 1
    assert "statics ended by itself" in output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["max_points"], "got 'max_points'; allowed: NAME:=VALUE"),
        ([":=5"], "got ':=5'; allowed: NAME:=VALUE"),
    ],
)
def test_run_robot_refuses_what_is_no_parameter(arguments, words):
    tool = subprocess.run(
        [sys.executable, ROOT / "tools" / "run_robot.py", *arguments],
        capture_output=True,
        text=True,
    )
    assert tool.returncode == 2
    assert words in tool.stderr


def test_a_node_helps_and_refuses_what_it_does_not_know():
    node = find_executable("leg_statics", "gait_node")
    told = subprocess.run([node, "--help"], capture_output=True, text=True)
    assert told.returncode == 0
    for words in (
        "read-only)\n      Length of a stance [m]",
        "robot  (default 'hexapod')",
        "/joint_states  sensor_msgs/msg/JointState",
        "/left_front/wrench  geometry_msgs/msg/WrenchStamped",
    ):
        assert words in told.stdout
    assert "parameter_events" not in told.stdout
    refused = subprocess.run([node, "--robot", "walker"], capture_output=True, text=True)
    assert refused.returncode == 2
    assert "unrecognized arguments: --robot walker" in refused.stderr


def test_run_robot_refuses_a_robot_that_is_not_there():
    tool = subprocess.run(
        [sys.executable, ROOT / "tools" / "run_robot.py", "--robot", "decapod"],
        capture_output=True,
        text=True,
    )
    assert tool.returncode == 1
    assert "decapod" in tool.stderr
    assert "Traceback" not in tool.stderr


def test_the_demo_shows_everything_and_ends_well(tmp_path):
    demo = subprocess.run(
        [sys.executable, ROOT / "tools" / "demo.py", "--output", tmp_path],
        capture_output=True,
        text=True,
        timeout=START_TIMEOUT,
    )
    assert demo.returncode == 0, demo.stdout + demo.stderr
    for words in (
        "left_front",
        "solo12",
        "out of reach",
        "soft ground",
        "UnknownLegError",
        "Arrived",
    ):
        assert words in demo.stdout
    assert {path.name for path in tmp_path.iterdir()} == {
        *("map_load_capacity.png", "map_rated_friction.png"),
        *("walk.json", "walk_steps.png", "walk_terrain.png"),
    }
