# SPDX-License-Identifier: Apache-2.0
"""MJCF against MuJoCo: feet, Jacobians, weight, and loops of its equality constraints."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_zoo import chosen, random_joints

from leg_kinematics import Status, load_robot
from leg_kinematics.model.postures import loop_state

mujoco = pytest.importorskip("mujoco", reason="MuJoCo has no wheel for this Python")

LEG = """
<mujoco>
  <compiler angle="degree"/>
  <worldbody>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.2 0.1 0.05" mass="5"/>
      <body name="hip" pos="0.3 0.1 0" euler="0 0 20">
        <joint name="roll" axis="1 0 0" pos="0 0 0.01" range="-40 40"/>
        <geom type="capsule" fromto="0 0 0 0 0.05 0" size="0.02" mass="0.4"/>
        <body name="rear_crank" pos="-0.05 0.05 -0.02">
          <joint name="rear" axis="0 1 0" range="-30 50"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.01" mass="0.3"/>
          <body name="shin" pos="0 0 -0.15">
            <joint name="knee" axis="0 1 0" range="-170 170"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.01" mass="0.2"/>
            <site name="toe" pos="0 0 -0.3"/>
          </body>
        </body>
        <body name="front_crank" pos="0.05 0.05 -0.02">
          <joint name="front" axis="0 1 0" range="-50 30"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.15" size="0.01" mass="0.3"/>
          <body name="rod" pos="0 0 -0.15">
            <joint name="pin" axis="0 1 0" range="-170 170"/>
            <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="0.1"/>
            <site name="tip" pos="0 0 -0.2"/>
          </body>
        </body>
      </body>
    </body>
    <!-- sites that meet -->
  </worldbody>
  <equality><connect site1="shin_tip" site2="tip"/></equality>
  <actuator>
    <motor joint="roll" gear="6" forcerange="-2 2" ctrlrange="-2 2"/>
    <motor joint="rear" gear="6" forcerange="-2 2"/>
    <motor joint="front" forcerange="-15 10"/>
  </actuator>
</mujoco>
""".replace('<site name="toe"', '<site name="shin_tip" pos="0 0 -0.2"/><site name="toe"')
ROBOT = """
name: r
base_frame: trunk
model: {file: leg.xml, base: trunk}
units: {length: m, angle: deg}
legs:
  leg: {foot: toe, assembly: {initial: {rear: 35, front: -35, knee: -70, pin: 70}}}
"""


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mjcf")
    (folder / "leg.xml").write_text(LEG)
    (folder / "robot.yaml").write_text(ROBOT)
    return load_robot(folder / "robot.yaml")


@pytest.fixture(scope="module")
def leg(robot):
    return robot.leg("leg")


def test_limits_efforts_and_loops_are_read(leg):
    assert leg.joint_names == ("roll", "rear", "front")
    assert leg.passive_joint_names == ("knee", "pin")
    np.testing.assert_allclose(leg.mechanism.joint_limits[0], np.radians([-40, 40]))
    np.testing.assert_allclose(leg.effort_limits, [[-12, 12], [-12, 12], [-15, 10]])
    np.testing.assert_allclose(leg.mechanism.mass, 1.3)


def test_mass_and_centre_of_the_robot_are_mujocos_in_the_initial_posture(robot, leg):
    model = mujoco.MjModel.from_xml_string(LEG)
    data, posture = mujoco.MjData(model), leg.mechanism.initial_posture
    names = ("roll", "rear", "front", "knee", "pin")
    for name, value in zip(names, [*posture.joint_positions, *posture.closure], strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    trunk = model.body("trunk").id
    assert robot.body.mass == pytest.approx(model.body_subtreemass[trunk])
    center = data.subtree_com[trunk] - data.xpos[trunk]
    np.testing.assert_allclose(robot.body.center_of_mass, center, atol=1e-9)


def test_foot_jacobian_and_weight_are_mujocos(leg):
    mechanism = leg.mechanism
    posture = mechanism.forward(random_joints(mechanism, 200))
    posture = chosen(posture, posture.status == Status.OK)
    assert len(posture.status) > 80
    model = mujoco.MjModel.from_xml_string(LEG)
    data, site = mujoco.MjData(model), model.site("toe").id
    names = ("roll", "rear", "front", "knee", "pin")
    dofs = [int(model.joint(name).dofadr[0]) for name in names]
    twist = mechanism.twist_jacobian(posture)
    held = mechanism.holding_efforts(posture, model.opt.gravity)
    for i in range(len(posture.status)):
        values = [*posture.joint_positions[i], *posture.closure[i]]
        for name, value in zip(names, values, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_forward(model, data)
        foot = np.add(leg.mount.to_base(posture.foot_position[i]), [0, 0, 1])
        np.testing.assert_allclose(data.site_xpos[site], foot, rtol=0, atol=1e-9)
        jac = np.zeros((6, model.nv))
        mujoco.mj_jacSite(model, data, jac[:3], jac[3:], site)
        rows = [np.zeros((3, model.nv)) for _ in range(2)]
        for row, name in zip(rows, ("shin_tip", "tip"), strict=True):
            mujoco.mj_jacSite(model, data, row, None, model.site(name).id)
        loops = (rows[0] - rows[1])[:, dofs]
        follows = -np.linalg.lstsq(loops[:, 3:], loops[:, :3], rcond=1e-9)[0]
        wanted = jac[:, dofs[:3]] + jac[:, dofs[3:]] @ follows
        np.testing.assert_allclose(twist[i], wanted, rtol=0, atol=1e-7)
        bias = data.qfrc_bias[dofs]
        np.testing.assert_allclose(held[i], bias[:3] + follows.T @ bias[3:], rtol=0, atol=1e-6)
        assert (
            np.abs(loop_state(mechanism.tree, mechanism._all_joints(posture)[i])[0]).max() < 1e-10
        )
