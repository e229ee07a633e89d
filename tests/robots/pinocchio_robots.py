# SPDX-License-Identifier: Apache-2.0
"""Legs of public quadrupeds against Pinocchio; `make robots` installs both and runs it."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from leg_kinematics import Status, load_robot
from leg_kinematics.mechanisms.serial_leg import SerialLeg

POSES = 200
GRAVITY = np.array([0.7, -1.1, -9.6])
FOLDER = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
# The URDF of each robot, its base and its feet.
ROBOTS = {
    "solo12": ("solo_description/robots/solo12.urdf", "base_link", "FL_FOOT HR_FOOT"),
    "anymal_b": ("anymal_b_simple_description/robots/anymal.urdf", "base", "LF_FOOT RH_FOOT"),
    "anymal_c": ("anymal_c_simple_description/urdf/anymal.urdf", "base", "LF_FOOT RH_FOOT"),
    "a1": ("a1_description/urdf/a1.urdf", "base", "FL_foot RR_foot"),
    "go1": ("go1_description/urdf/go1.urdf", "base", "FL_foot RR_foot"),
    "go2": ("go2_description/urdf/go2.urdf", "base", "FL_foot RR_foot"),
    "b1": ("b1_description/urdf/b1.urdf", "base", "FL_foot RR_foot"),
    "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", "base_link", "lf_foot rh_foot"),
    "laikago": ("laikago_description/urdf/laikago.urdf", "trunk", "FL_foot RR_foot"),
}
# All four legs of a robot have joints of their own names, axes and places.
OTHER_LEGS = {"FL": "FR", "HR": "HL", "LF": "RF", "RH": "LH", "RR": "RL", "lf": "rf", "rh": "lh"}


def leg_of(folder, name, foot):
    """Return a leg of a robot."""
    file, base, _ = ROBOTS[name]
    path = FOLDER / file
    description = {
        "name": name,
        "base_frame": base,
        "model": {"file": str(path), "base": base},
        "legs": {"leg": {"foot": foot}},
    }
    (folder / "robot.yaml").write_text(json.dumps(description))
    return load_robot(folder / "robot.yaml").leg("leg")


LEGS = [
    (name, foot)
    for name, (_, _, feet) in ROBOTS.items()
    for known in feet.split()
    for foot in (known, OTHER_LEGS[known[:2]] + known[2:])
]


@pytest.mark.parametrize(("name", "foot"), LEGS, ids=[f"{n} {f}" for n, f in LEGS])
def test_foot_jacobian_and_weight_are_pinocchios(tmp_path, name, foot):
    leg = leg_of(tmp_path, name, foot)
    mechanism = leg.mechanism
    model = pinocchio.buildModelFromUrdf(str(FOLDER / ROBOTS[name][0]))
    model.gravity.linear = GRAVITY
    data, frame = model.createData(), model.getFrameId(foot)
    base = model.getFrameId(ROBOTS[name][1])
    lower, upper = np.clip(mechanism.joint_limits, -np.pi, np.pi).T
    q = np.random.default_rng(0).uniform(lower, upper, (POSES, 3))
    posture = mechanism.forward(q)
    columns = [model.joints[model.getJointId(joint)].idx_v for joint in leg.joint_names]
    places = [model.joints[model.getJointId(joint)] for joint in leg.joint_names]
    numbers = posture.foot_position.copy(), mechanism.twist_jacobian(posture)
    # a posture of another mode has no answer in this one, but a foot
    for mode in mechanism.assembly_modes:
        other = mechanism.forward(q, mode)
        numbers[0][other.status == Status.OK] = other.foot_position[other.status == Status.OK]
    held = mechanism.holding_efforts(posture, GRAVITY)
    known = np.isfinite(numbers[0]).all(axis=1)
    assert known.mean() > 0.5
    for i in np.flatnonzero(known):
        full = pinocchio.neutral(model)
        for joint, value in zip(places, q[i], strict=True):
            turning = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
            full[joint.idx_q : joint.idx_q + joint.nq] = turning
        pinocchio.computeJointJacobians(model, data, full)
        pinocchio.updateFramePlacements(model, data)
        at = data.oMf[base].actInv(data.oMf[frame])
        close = {"rtol": 0, "atol": 1e-9}
        np.testing.assert_allclose(leg.mount.to_base(numbers[0][i]), at.translation, **close)
        whole = pinocchio.getFrameJacobian(
            model, data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        turn = data.oMf[base].rotation.T
        wanted = np.concatenate([turn @ whole[:3, columns], turn @ whole[3:, columns]])
        np.testing.assert_allclose(numbers[1][i], wanted, **close)
        weight = pinocchio.computeGeneralizedGravity(model, data, full)[columns]
        np.testing.assert_allclose(held[i], weight, **close)


@pytest.mark.parametrize(("name", "foot"), LEGS, ids=[f"{n} {f}" for n, f in LEGS])
def test_all_solutions_are_found(tmp_path, name, foot):
    """As many as a dense search by Newton's method finds, each of them once."""
    mechanism = leg_of(tmp_path, name, foot).mechanism
    assert isinstance(mechanism, SerialLeg)
    lower, upper = np.clip(mechanism.joint_limits, -np.pi, np.pi).T
    goals = mechanism.forward(np.random.default_rng(1).uniform(lower, upper, (6, 3)))
    goals = goals.foot_position[goals.status == Status.OK]
    starts = np.array(
        list(product(*(np.linspace(a, b, 13) for a, b in zip(lower, upper, strict=True))))
    )
    for goal in goals:
        answers = [mechanism.inverse(goal, mode) for mode in mechanism.assembly_modes]
        found = [a.joint_positions for a in answers if a.status == Status.OK]
        for answer in found:
            again = place(mechanism, answer[None])[0]
            np.testing.assert_allclose(again, goal, rtol=0, atol=1e-9)
        searched = search(mechanism, goal, starts)
        assert len(searched) == len(found)
        for answer in searched:
            assert min(np.abs(answer - other).max() for other in found) < 1e-6


def place(mechanism, q):
    """Return feet of joint positions in whatever mode (m, 3)."""
    feet = np.full((len(q), 3), np.nan)
    for mode in mechanism.assembly_modes:
        posture = mechanism.forward(q, mode)
        known = np.isfinite(posture.foot_position).all(axis=1)
        feet[known] = posture.foot_position[known]
    return feet


def search(mechanism, goal, starts):
    """Return the joint positions within the limits that reach a goal, each once."""
    q = starts.copy()
    for _ in range(40):
        posture = mechanism.forward(q)._replace(joint_positions=q)
        step = np.linalg.pinv(mechanism.jacobian(posture)) @ (goal - place(mechanism, q))[..., None]
        q = q + np.clip(np.nan_to_num(step[..., 0]), -0.3, 0.3)
    near = np.abs(place(mechanism, q) - goal).max(axis=1) < 1e-10
    lower, upper = mechanism.joint_limits.T
    middle = 0.5 * (lower + upper)
    q = q[near] - 2.0 * np.pi * np.round((q[near] - middle) / (2.0 * np.pi))
    inside = np.all((q >= lower - 1e-9) & (q <= upper + 1e-9), axis=1)
    found = []
    for answer in q[inside]:
        if all(np.abs(answer - other).max() > 1e-6 for other in found):
            found.append(answer)
    return found
