# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions: every mistake is named with file, line, key, value and what is allowed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from leg_kinematics import DescriptionError, Status, UnknownNameError, load_robot
from leg_kinematics.description import find_robot_file
from leg_kinematics.geometry import geometry_parameters

HEXAPOD = find_robot_file("hexapod")


@pytest.fixture
def edited(tmp_path):
    """Return a function that writes the hexapod with one text replaced and gives its path."""

    def edit(old: str, new: str) -> Path:
        text = HEXAPOD.read_text()
        assert old in text
        path = tmp_path / "robot.yaml"
        path.write_text(text.replace(old, new, 1))
        return path

    return edit


def test_hexapod_has_six_legs_mirrored_left_to_right():
    robot = load_robot("hexapod")
    assert list(robot.legs) == [
        f"{side}_{place}" for side in ("left", "right") for place in ("front", "middle", "rear")
    ]
    left, right = robot.leg("left_front"), robot.leg("right_front")
    assert left.mirrored
    assert not right.mirrored
    np.testing.assert_allclose(left.mount.position * [1, -1, 1], right.mount.position)
    foot = np.array([0.50, -0.35, -0.55])  # in the base frame, to the right
    q = right.mechanism.inverse(right.mount.to_leg(foot))
    q_left = left.mechanism.inverse(left.mount.to_leg(foot * [1, -1, 1]))
    assert q.status == Status.OK
    np.testing.assert_allclose(q.joint_positions, q_left.joint_positions, atol=1e-14)


def test_joint_names_are_unique_in_a_robot_passive_ones_included():
    for robot in map(load_robot, ("hexapod", "quadruped", "walker", "gantry")):
        names = [
            name
            for leg in robot.legs.values()
            for name in leg.joint_names + leg.passive_joint_names
        ]
        assert len(set(names)) == len(names)
        for leg in robot.legs.values():
            joints = [joint.name for joint in leg.mechanism.passive_joints]
            assert leg.passive_joint_names == tuple(f"{leg.name}_{joint}" for joint in joints)


@pytest.mark.parametrize("robot", ["hexapod", "quadruped", "walker"])
def test_axes_of_legs_are_those_of_the_body(robot):
    for leg in load_robot(robot).legs.values():
        np.testing.assert_array_equal(leg.mount.rotation, np.eye(3))


def test_a_mount_turns_a_leg_and_back(edited):
    turned = edited("position: [450, -300, 0]", "position: [450, -300, 0], rpy: [0, 0, 30]")
    mount = load_robot(turned).leg("right_front").mount
    forward = mount.vectors_to_base([1.0, 0.0, 0.0])
    np.testing.assert_allclose(forward, [np.cos(np.pi / 6), 0.5, 0.0], atol=1e-15)
    points = np.random.default_rng(0).normal(size=(4, 5, 3))
    np.testing.assert_allclose(mount.to_leg(mount.to_base(points)), points, atol=1e-15)


def test_lengths_are_converted_once_to_metres_and_radians():
    geometry = load_robot("hexapod").leg("left_front").geometry
    assert geometry.shank_length == pytest.approx(0.320)
    assert geometry.crank_zero == pytest.approx(np.radians(-36.0))
    np.testing.assert_allclose(geometry.joint_limits, np.radians([[-21, 21]] * 3))


def test_shipped_defaults_are_the_initial_dimensions(edited):
    robot = load_robot(edited("type: optimised", "type: initial"))
    geometry = robot.leg("left_front").geometry
    default = type(geometry)()
    for field in geometry_parameters(geometry):
        assert getattr(geometry, field.name) == pytest.approx(getattr(default, field.name)), field


def test_a_leg_may_be_left_unnamed_only_if_it_is_the_only_one(tmp_path):
    text = HEXAPOD.read_text()
    legs = text.index("\nlegs:")
    second = text.index("  left_middle:")
    path = tmp_path / "monopod.yaml"
    path.write_text(text[:second])
    assert legs < second
    assert load_robot(path).leg("").name == "left_front"
    with pytest.raises(UnknownNameError, match="left_front, left_middle"):
        load_robot("hexapod").leg("")
    with pytest.raises(UnknownNameError, match="unknown leg 'lf'"):
        load_robot("hexapod").leg("lf")


# What is wrong, how to make it so, and words that the message must contain.
# ruff: noqa: E501
MISTAKES = {
    "unknown geometry key": ("rod_length: 220", "rod_len: 220", ["rod_len", "allowed", "rod_length"]),
    "missing length": ("      rod_length: 220            # l1 = l2\n", "", ["missing", "rod_length"]),
    "negative length": ("rod_length: 220", "rod_length: -220", [".rod_length", "-220", "> 0"]),
    "zero length": ("rod_length: 220", "rod_length: 0", [".rod_length", "0 must be > 0"]),
    "NaN": ("rod_length: 220", "rod_length: .nan", ["nan", "finite number"]),
    "infinite angle": ("crank_zero: -36", "crank_zero: .inf", ["inf", "finite number"]),
    "text for a number": ("rod_length: 220", "rod_length: long", ["'long'", "finite number"]),
    "boolean for a number": ("rod_length: 220", "rod_length: yes", ["finite number"]),
    "cannot be assembled": ("rod_length: 220", "rod_length: 20", ["cannot be assembled", "rod_length"]),
    "reversed joint range": ("crank_1: [-21, 21]", "crank_1: [21, -21]", ["crank_1", "lower must be"]),
    "one-sided joint range": ("crank_1: [-21, 21]", "crank_1: 21", ["joint_limits.crank_1", "21"]),
    "unknown joint": ("crank_1: [-21, 21]", "crank_9: [-21, 21]", ["crank_9", "crank_1"]),
    "negative effort limit": ("crank_1: 150", "crank_1: -3", ["effort_limits.crank_1", "-3"]),
    "effort range without zero": ("crank_1: 150", "crank_1: [3, 5]", ["lower <= 0 <= upper"]),
    "unknown leg type": ("type: optimised", "type: optimized", ["'optimized'", "initial, optimised"]),
    "unknown unit": ("length: mm", "length: inch", ["units.length", "'inch'", "mm"]),
    "unknown mechanism": ("mechanism: parallel_drive", "mechanism: delta", ["'delta'", "parallel_drive"]),
    "missing mechanism": ("    mechanism: parallel_drive\n", "", ["missing", "mechanism"]),
    "duplicate key": ("name: hexapod", "name: a\nname: hexapod", ["duplicate key"]),
    "unknown top-level key": ("name: hexapod", "name: hexapod\nnmae: x", ["nmae", "allowed"]),
    "negative mass": ("{mass: 120,", "{mass: -1,", ["body.mass", "-1"]),
    "mass without number": ("{mass: 120, ", "{", ["missing", "mass"]),
    "bad leg name": ("  left_front:", "  left front:", ["left front"]),
    "short vector": ("position: [450, 300, 0]", "position: [450, 300, 0], rpy: [0, 0]", ["legs.left_front.mount.rpy", "short"]),
    "NaN in a mount": ("[450, 300, 0]", "[450, .nan, 0]", ["mount.position.1", "nan"]),
    "text for a boolean": ("mirrored: true", "mirrored: maybe", ["mirrored", "boolean"]),
    "joint name of a passive joint": (
        "type: optimised\n    mount: {position: [450",
        "type: optimised\n    joint_names: {crank_1: left_front_r1}\n    mount: {position: [450",
        ["'left_front_r1'", "already used", "left_front"],
    ),
    "joint name used twice": (
        "type: optimised\n    mount: {position: [450",
        "type: optimised\n    joint_names: {crank_1: m, crank_2: m}\n    mount: {position: [450",
        ["'m'", "already used", "left_front"],
    ),
    "YAML syntax": ("legs:\n", "legs: [\n", ["expected"]),
    "undefined anchor": ("*initial_geometry", "*nowhere", ["nowhere"]),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named(edited, old, new, words):
    path = edited(old, new)
    with pytest.raises(DescriptionError) as error:
        load_robot(path)
    message = str(error.value)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_the_line_of_a_mistake_is_told(edited):
    path = edited("rod_length: 220", "rod_length: -220")
    line = 1 + path.read_text().splitlines().index(
        next(text for text in path.read_text().splitlines() if "-220" in text)
    )
    with pytest.raises(DescriptionError, match=f"robot.yaml:{line}:"):
        load_robot(path)


def test_all_mistakes_are_told_at_once(edited):
    path = edited("rod_length: 220", "rod_length: -1")
    path.write_text(path.read_text().replace("platform_arm: 55", "platform_arm: x", 1))
    with pytest.raises(DescriptionError) as error:
        load_robot(path)
    assert len(str(error.value).splitlines()) == 2


@pytest.mark.parametrize("content", ["", "null", "[]", "3", "\x00", "a: &a [*a]"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path, content):
    path = tmp_path / "empty.yaml"
    path.write_text(content)
    with pytest.raises(DescriptionError, match=r"empty.yaml"):
        load_robot(path)


@pytest.mark.parametrize("name", ["robot_1/lf-hip", "1st.frame", "a/b/c"])
def test_frames_and_joints_have_the_names_that_others_gave_them(edited, name):
    old = "    mirrored: true\n"
    leg = next(iter(load_robot(edited(old, f"{old}    frame: {name}\n")).legs.values()))
    assert leg.frame == name
    leg = next(
        iter(load_robot(edited(old, f"{old}    joint_names: {{crank_1: {name}}}\n")).legs.values())
    )
    assert leg.joint_names[0] == name
    assert load_robot(edited("base_frame: base_link", f"base_frame: {name}")).base_frame == name


@pytest.mark.parametrize("name", ["/base_link", "base_link/", "a//b", "base link", "a:b"])
def test_names_that_no_tree_of_frames_has_are_refused(edited, name):
    with pytest.raises(DescriptionError, match="base_frame"):
        load_robot(edited("base_frame: base_link", f"base_frame: '{name}'"))


def test_a_missing_file_and_an_unknown_robot_are_told(tmp_path):
    with pytest.raises(DescriptionError, match="does not exist"):
        load_robot(tmp_path / "none.yaml")
    with pytest.raises(DescriptionError, match="hexapod"):
        load_robot("octopus")
    (tmp_path / "latin.yaml").write_bytes(b"name: \xff")
    with pytest.raises(DescriptionError, match=r"latin.yaml"):
        load_robot(tmp_path / "latin.yaml")


def test_a_mass_and_its_centre_are_read(edited):
    centre = "center_of_mass: [0, 0, 0]"
    found = load_robot(edited(centre, "center_of_mass: [10, 0, -50]")).body
    assert found.mass == 120.0
    assert found.center_of_mass == pytest.approx((0.01, 0.0, -0.05))
    assert load_robot(edited(f", {centre}", "")).body.center_of_mass == (0.0, 0.0, 0.0)
    assert load_robot("quadruped").body is None


def test_drives_tell_positions_by_scale_and_zero(edited):
    leg = "  left_front:\n    type: optimised\n"
    drives = "    drives: {crank_1: {scale: -2, zero: 90}, crank_3: {zero: -10}}\n"
    found = load_robot(edited(leg, leg + drives))
    assert found.leg("left_rear").drives is None
    drives = found.leg("left_front").drives
    np.testing.assert_allclose(drives.scale, [-2.0, 1.0, 1.0])
    np.testing.assert_allclose(drives.zero, np.radians([90.0, 0.0, -10.0]))
    told = np.radians([[80.0, 5.0, 0.0]])
    np.testing.assert_allclose(drives.positions(told), np.radians([[20.0, 5.0, 10.0]]))
    np.testing.assert_allclose(drives.told_positions(drives.positions(told)), told)
    power = drives.efforts(np.ones(3)) * drives.velocities(np.ones(3))
    np.testing.assert_allclose(power, 1.0)


@pytest.mark.parametrize(
    ("drives", "message"),
    [
        ("{crank_9: {scale: 1}}", r"unknown key 'crank_9'"),
        ("{crank_1: {sign: -1}}", r"unknown key 'sign'; allowed: scale, zero"),
        ("{crank_1: {scale: 0}}", r"drives\.crank_1\.scale: 0: the scale of a drive must not be 0"),
    ],
)
def test_wrong_drives_are_told(edited, drives, message):
    leg = "  left_front:\n    type: optimised\n"
    with pytest.raises(DescriptionError, match=message):
        load_robot(edited(leg, f"{leg}    drives: {drives}\n"))
