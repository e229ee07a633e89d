# SPDX-License-Identifier: Apache-2.0
"""Robots written as URDF and MJCF: what reads them finds the same robot."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from mechanism_zoo import chosen, random_joints
from model_legs import five_bar

from leg_kinematics import Leg, Mirrored, Mount, ParallelDrive, Robot, Status, load_robot
from leg_kinematics.export.mjcf import mjcf_text
from leg_kinematics.export.named_legs import UNLIMITED
from leg_kinematics.export.urdf import urdf_text
from leg_kinematics.export_robot import main, write_mjcf, write_urdf

SHIPPED = ("hexapod", "quadruped", "walker", "gantry", "solo12")
TURNED_OVER = {"crank", "foot"}  # plates of six-bars; no motion of the bodies reaches these modes
MOUNT = Mount(
    np.array([0.3, -0.2, 0.1]), np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0, 0]])
)


def own_robot():
    """Return a robot of others' legs: a five-bar model, and a mirrored, turned parallel drive."""
    bar, drive = Leg.of(five_bar(), (-30.0, 40.0)), Leg.of(Mirrored(ParallelDrive()))
    drive = replace(drive, name="drive", frame="drive_leg", mount=MOUNT)
    bar = replace(bar, name="bar", frame="bar_leg")
    return Robot("own", "trunk", {leg.name: leg for leg in (bar, drive)})


ROBOTS = {name: load_robot(name) for name in SHIPPED} | {"own": own_robot()}
robots = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


def some_legs(robot):
    """Return the first and the last leg, which is another or mirrored."""
    legs = list(robot.legs.values())
    return {leg.name: leg for leg in (legs[0], legs[-1])}.values()


def solved(leg, mode, count):
    posture = leg.mechanism.forward(random_joints(leg.mechanism, count), mode)
    return chosen(posture, posture.status == Status.OK)


def place_in_mujoco(model, data, leg, positions):
    """Put the joints of a leg where a mechanism's tree has them, and find all bodies."""
    for name, position in zip(leg.tree_joint_names(), positions, strict=True):
        data.joint(name).qpos[0] = position
    mujoco.mj_kinematics(model, data)


@robots
@pytest.mark.parametrize("write", [write_urdf, write_mjcf])
def test_read_back_as_a_model_every_leg_is_the_same_in_every_mode(robot, write, tmp_path):
    back = load_robot(write(robot, tmp_path)[1])
    assert (back.name, back.base_frame, list(back.legs)) == (
        robot.name,
        robot.base_frame,
        list(robot.legs),
    )
    assert robot.body in (None, back.body)
    for leg in some_legs(robot):
        other = back.leg(leg.name)
        order = [leg.joint_names.index(name) for name in other.joint_names]
        limits = np.clip(leg.effort_limits[order], -UNLIMITED, UNLIMITED)
        np.testing.assert_array_equal(other.effort_limits, limits)
        assert other.mechanism.has_masses == leg.mechanism.has_masses
        compared = 0
        for mode in leg.mechanism.assembly_modes:
            posture = solved(leg, mode, 600)
            if mode not in other.mechanism.assembly_modes:
                turned = TURNED_OVER & {*mode.removeprefix("flipped_").split("+")}
                assert turned or not len(posture.status), mode
                continue
            same, twist = other.mechanism.forward_with_twist(
                posture.joint_positions[:, order], mode
            )
            compared += len(posture.status)
            foot = leg.mount.to_base(posture.foot_position[:, :3])
            there = other.mount.to_base(same.foot_position)
            np.testing.assert_allclose(there, foot, rtol=0, atol=1e-9)
            wanted = leg.mechanism.twist_jacobian(posture)[:, [0, 1, 2, -3, -2, -1]]
            wanted = leg.mount.rotation @ wanted.reshape(-1, 2, 3, len(order))
            found = twist.reshape(wanted.shape)[..., np.argsort(order)]
            scale = np.maximum(1.0, np.abs(wanted).max(axis=(1, 2, 3), keepdims=True))
            np.testing.assert_allclose(found / scale, wanted / scale, rtol=0, atol=1e-7)
        assert compared > 250


@robots
def test_mujoco_finds_the_loops_closed_the_foot_there_and_the_motors_limited(robot):
    model = mujoco.MjModel.from_xml_string(mjcf_text(robot))
    data = mujoco.MjData(model)
    assert {model.actuator(k).name for k in range(model.nu)} == {
        name for leg in robot.legs.values() for name in leg.joint_names
    }
    for leg in some_legs(robot):
        for name, limits in zip(leg.joint_names, leg.effort_limits, strict=True):
            motor = model.actuator(name)
            assert motor.forcelimited == np.isfinite(limits).all()
            if motor.forcelimited:
                np.testing.assert_array_equal(motor.forcerange, limits)
        posture = chosen(solved(leg, "", 200), slice(40))
        assert len(posture.status) == 40
        feet = leg.mount.to_base(posture.foot_position[:, :3])
        for q, foot in zip(leg.mechanism.tree_positions(posture), feet, strict=True):
            place_in_mujoco(model, data, leg, q)
            np.testing.assert_allclose(data.site(f"{leg.name}_foot").xpos, foot, atol=1e-9)
            assert_loops_closed(model, data, leg.name)


def assert_loops_closed(model, data, leg):
    for k in range(model.neq):
        first, second = model.eq_obj1id[k], model.eq_obj2id[k]
        if model.site(first).name.startswith(f"{leg}_loop"):
            gap = data.site_xpos[first] - data.site_xpos[second]
            np.testing.assert_allclose(gap, 0.0, rtol=0, atol=1e-9)


@robots
def test_the_key_of_an_mjcf_is_the_initial_posture_of_all_legs(robot):
    model = mujoco.MjModel.from_xml_string(mjcf_text(robot))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("initial").id)
    mujoco.mj_kinematics(model, data)
    for leg in robot.legs.values():
        foot = leg.mount.to_base(leg.mechanism.initial_posture.foot_position[:3])
        np.testing.assert_allclose(data.site(f"{leg.name}_foot").xpos, foot, atol=1e-9)
        assert_loops_closed(model, data, leg.name)


@robots
def test_mujocos_reader_of_urdf_finds_leg_frames_and_feet(robot):
    spec = mujoco.MjSpec.from_string(urdf_text(robot))
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6
    spec.compiler.fusestatic = False
    model = spec.compile()
    data = mujoco.MjData(model)
    for leg in some_legs(robot):
        posture = solved(leg, "", 60)
        place_in_mujoco(model, data, leg, leg.mechanism.tree_positions(posture)[-1])
        foot = leg.mount.to_base(posture.foot_position[-1, :3])
        np.testing.assert_allclose(data.body(f"{leg.name}_foot").xpos, foot, atol=1e-9)
        np.testing.assert_allclose(data.body(leg.frame).xpos, leg.mount.position, atol=1e-12)
        turned = data.body(leg.frame).xmat.reshape(3, 3)
        np.testing.assert_allclose(turned, leg.mount.rotation, atol=1e-12)


def test_a_robot_with_masses_is_as_heavy_when_it_is_read_back(tmp_path):
    leg = ROBOTS["solo12"].leg("HL")
    posture = leg.mechanism.forward(random_joints(leg.mechanism, 50))
    gravity = np.array([1.0, -2.0, -9.0])
    for write in (write_urdf, write_mjcf):
        other = load_robot(write(ROBOTS["solo12"], tmp_path)[1]).leg("HL").mechanism
        same = other.forward(posture.joint_positions)
        np.testing.assert_allclose(
            other.holding_efforts(same, gravity),
            leg.mechanism.holding_efforts(posture, gravity),
            atol=1e-12,
        )


def test_the_links_of_robots_with_prefixes_have_different_names():
    one, two = (ROBOTS["quadruped"].with_frame_prefix(p) for p in ("robot_1/", "robot_2/"))
    names = [
        {link.get("name") for link in ElementTree.fromstring(urdf_text(robot)).iter("link")}
        for robot in (one, two)
    ]
    assert one.base_frame in names[0]
    assert {leg.frame for leg in one.legs.values()} < names[0]
    assert {name.replace("robot_1/", "robot_2/") for name in names[0]} == names[1]
    assert not names[0] & names[1]


def test_the_command_writes_both_files_and_tells_what_is_wrong(tmp_path, capsys):
    assert main(["walker", "--urdf", "--folder", str(tmp_path / "new")]) == 0
    told = capsys.readouterr().out.split()
    assert told == ["wrote", str(tmp_path / "new/walker.urdf"), "wrote", *told[3:]]
    assert (tmp_path / "new/walker_urdf.yaml").is_file()
    assert main(["wolf", "--mjcf"]) == 1
    assert "shipped robots" in capsys.readouterr().err
    (tmp_path / "file").touch()
    assert main(["walker", "--mjcf", "--folder", str(tmp_path / "file" / "x")]) == 1
    assert capsys.readouterr().err.startswith("export_robot: ")
    with pytest.raises(SystemExit):
        main(["walker"])
