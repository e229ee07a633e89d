# SPDX-License-Identifier: Apache-2.0
"""Presses a leg in MuJoCo with a growing load until a motor gives way or the foot slips.

The leg hangs from a fixed base with its loops closed by constraints. Motors hold their place as
stiff springs, up to their effort limits. A plate that slides along the vertical presses the foot
from below, with an elliptic friction cone between both. There is no gravity: what moves the plate
is the load alone, so bodies may have any mass; inertia only keeps what gives way slow.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np

from leg_kinematics import Leg, Posture, Robot
from leg_kinematics.arrays import FloatArray
from leg_kinematics.export.mjcf import mjcf_text
from leg_kinematics.export.named_legs import NamedLeg
from leg_kinematics.robot import Mount
from leg_statics.capacity.problem import load_capacity

STEP = 1e-3  # s
BEGINNING = 0.5  # until the first load is put on [s]
GROWTH = 0.1  # of the load after that, relative to itself [1/s]
FIRST = 0.5  # the first load, relative to the one that is tried
MOST = 2.0  # load at which it ends, the same
GIVEN = 0.006  # way of the plate that counts as giving way, relative to the longest bar
YIELDING = 2e-3  # way in which motors come to their limits, relative to the same
SERVO = 200.0  # natural frequency of each motor by itself [rad/s], for which it is heavy enough
HARD = (0.999, 0.9999, 1e-3, 0.5, 2.0)  # impedance of constraints and contacts
QUICK = (4.0 * STEP, 1.0)  # and their time constant and damping ratio


class Pressed(NamedTuple):
    """What came of pressing a leg.

    Attributes:
        load: The load at which it gave way [N]; NaN if it held all that was tried.
        joint_positions: Where the motors stood then (n,) [rad or m].
        slip: Ratio of tangential to normal force at the foot shortly before.
    """

    load: float
    joint_positions: FloatArray
    slip: float


def press(leg: Leg, posture: Posture, friction: float, tried: float) -> Pressed:
    """Press a leg in one posture.

    Args:
        leg: The leg, whose motors have limits.
        posture: Where it stands.
        friction: Friction coefficient of the ground.
        tried: Size of the loads that are tried [N].
    """
    model, data, plate = _pressed_model(leg, posture, friction, tried)
    _hold(model, data, leg, posture)
    at, push = plate.qposadr[0], plate.dofadr[0]
    given = float(data.qpos[at]) + GIVEN * NamedLeg(leg).longest_bar
    slips: list[float] = []
    for load in tried * _loads():
        data.qfrc_applied[push] = load
        mujoco.mj_step(model, data)
        slips.append(_slip(model, data))
        if data.qpos[at] > given:
            q = np.array([data.joint(name).qpos[0] for name in leg.joint_names])
            return Pressed(load, q, float(np.nanmedian(slips[-150:-20])))
    return Pressed(np.nan, np.full(len(leg.joint_names), np.nan), np.nan)


def _loads() -> FloatArray:
    """Return the loads of all steps, relative to the one that is tried."""
    first = np.linspace(0.0, 1.0, int(BEGINNING / STEP))
    steps = np.arange(int(np.log(MOST / FIRST) / (GROWTH * STEP)))
    grown = FIRST * np.exp(GROWTH * STEP * steps)
    return np.concatenate([FIRST * first**2 * (3.0 - 2.0 * first), grown])


def _pressed_model(leg: Leg, posture: Posture, friction: float, tried: float) -> Any:
    """Return model, data and the plate's joint, the foot touching the plate."""
    level = replace(leg, mount=Mount(np.zeros(3), np.eye(3)), frame="leg")
    spec = mujoco.MjSpec.from_string(mjcf_text(Robot("pressed", "base", {leg.name: level})))
    size = NamedLeg(level).longest_bar
    radius = 1e-3 * size
    option = spec.option
    option.gravity, option.timestep = np.zeros(3), STEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 100.0
    option.iterations, option.tolerance = 200, 1e-12
    mass = 0.1 * tried / (YIELDING * size * SERVO**2)
    spec.compiler.boundmass, spec.compiler.boundinertia = mass, 0.02 * mass * size**2
    for key in list(spec.keys):
        spec.delete(key)
    for geom in list(spec.geoms):
        spec.delete(geom)
    for equality in spec.equalities:
        equality.solref, equality.solimp = QUICK, HARD
    for joint in spec.joints:
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    contact = {"solref": QUICK, "solimp": HARD, "friction": (friction, 0.0, 0.0), "condim": 3}
    foot = spec.site(f"{leg.name}_foot")
    foot.parent.add_geom(
        name="foot", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(radius, 0, 0), pos=foot.pos, **contact
    )
    place = posture.foot_position - np.array([0.0, 0.0, radius])
    plate = spec.worldbody.add_body(name="plate", pos=place - np.array([0.0, 0.0, 0.1 * size]))
    plate.add_joint(name="press", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1))
    plate.add_geom(
        name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=(size, size, 0.1 * size), **contact
    )
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 1
    model = spec.compile()
    data = mujoco.MjData(model)
    for name, position in zip(
        leg.tree_joint_names(), leg.mechanism.tree_positions(posture), strict=True
    ):
        data.joint(name).qpos[0] = position
    mujoco.mj_forward(model, data)
    return model, data, model.joint("press")


def _hold(model: Any, data: Any, leg: Leg, posture: Posture) -> None:
    """Let the motors hold their place: stiff, damped, and both within their limits."""
    way = YIELDING * NamedLeg(leg).longest_bar
    most = np.abs(leg.effort_limits).max(axis=1)
    reach = np.linalg.norm(leg.mechanism.jacobian(posture), axis=0)
    for k, name in enumerate(leg.joint_names):
        stiffness = most[k] * max(reach[k], 1e-9) / way
        model.dof_armature[model.joint(name).dofadr[0]] = stiffness / SERVO**2
        motor = model.actuator(name).id
        model.actuator_biastype[motor] = mujoco.mjtBias.mjBIAS_AFFINE
        model.actuator_gainprm[motor, 0] = stiffness
        model.actuator_biasprm[motor, 1:3] = -stiffness, -2.0 / SERVO * stiffness
        data.ctrl[motor] = posture.joint_positions[k]


def _slip(model: Any, data: Any) -> float:
    """Return the ratio of tangential to normal force at the foot; NaN without contact."""
    if not data.ncon:
        return np.nan
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    return float(np.hypot(force[1], force[2]) / force[0]) if force[0] > 0.0 else np.nan


def predicted(leg: Leg, posture: Posture, friction: float) -> tuple[float, str]:
    """Return the load capacity of a leg and its reason: "friction" or "effort"."""
    jacobian: FloatArray = leg.mechanism.jacobian(posture)
    lower, upper = leg.effort_limits.T
    capacity = float(load_capacity(jacobian, lower, upper, friction).capacity)
    rough = float(load_capacity(jacobian, lower, upper, np.inf).capacity)
    return capacity, "friction" if rough > 1.001 * capacity else "effort"
