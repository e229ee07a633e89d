# SPDX-License-Identifier: Apache-2.0
"""The service about stances: the library's answers for candidates of feet and of body poses."""

import numpy as np
import pytest
from leg_msgs.msg import StanceVerdict as StanceVerdictMessage
from leg_msgs_py import errors
from scipy.spatial.transform import Rotation

from leg_statics import (
    BodyPose,
    Load,
    StanceVerdict,
    evaluate_stances,
    margin_along,
    payload,
    robot_load,
    robot_stance,
    support_region,
)
from leg_statics.grounds import load_grounds

TRIPOD = ("left_front", "right_middle", "left_rear")
CENTER = np.array([0.02, 0.03, 0.05])
same = {"rtol": 1e-12, "atol": 1e-12, "equal_nan": True}


@pytest.fixture(scope="module")
def feet(hexapod):
    return {name: hexapod.leg(name).mount.to_base((0.05, 0.0, -0.65)) for name in TRIPOD}


@pytest.fixture(scope="module")
def candidates(hexapod):
    rng = np.random.default_rng(3)
    offsets = rng.uniform([-0.3, -0.3, -0.75], [0.3, 0.3, -0.55], (6, 4, 3))
    return hexapod.leg("right_middle").mount.to_base(offsets)


def assert_same(answer, found):
    for name in ("verdict", "load_factor", "utilisation", "limit", "limiting_leg"):
        np.testing.assert_allclose(getattr(answer, name), getattr(found, name), **same)
    np.testing.assert_array_equal(answer.limiting_joint, found.limiting_joint)


def test_candidates_of_one_foot_have_the_librarys_answers(suite, hexapod, feet, candidates):
    ahead = np.array([1.0, 0.2, 0.0])
    answer = suite.client.query_stance(
        {**feet, "right_middle": candidates},
        "cement",
        center_of_mass=CENTER,
        payload_position=(0.1, 0.0, 0.2),
        margin_direction=ahead,
        directions=8,
        forces=True,
    )
    mu = load_grounds().find("cement").friction_low
    stance = robot_stance(hexapod, {**feet, "right_middle": candidates}, mu)
    load = robot_load(hexapod)._replace(center_of_mass=CENTER)
    found, region = evaluate_stances(stance, load), support_region(stance, load, 8)
    assert_same(answer, found)
    assert len({*answer.verdict.ravel()}) >= 3  # the sample is worth testing
    np.testing.assert_array_equal(answer.status, stance.status)
    np.testing.assert_allclose(answer.margin, region.margin, **same)
    np.testing.assert_allclose(answer.margin_error, region.error, **same)
    np.testing.assert_allclose(answer.region, region.vertices, **same)
    np.testing.assert_allclose(answer.force, found.force, **same)
    np.testing.assert_allclose(answer.joint_efforts, found.joint_efforts.reshape(6, 4, -1), **same)
    assert answer.joint_names == sum((hexapod.leg(name).joint_names for name in TRIPOD), ())
    more = payload(stance, load, (0.1, 0.0, 0.2)).multiple
    np.testing.assert_allclose(answer.payload, more, **same)
    along = margin_along(stance, load, ahead).multiple
    np.testing.assert_allclose(answer.margin_along, along, **same)
    assert answer.mass == hexapod.body.mass
    assert answer.weight_counted == (False,) * 3
    standing = np.flatnonzero(found.stands)
    assert sorted(answer.ranking) == standing.tolist()
    assert answer.best == standing[np.argmax(region.margin.ravel()[standing])]


def test_body_poses_over_the_same_feet_have_the_librarys_answers(suite, hexapod, feet):
    rng = np.random.default_rng(5)
    position = rng.uniform([-0.05, -0.05, 0.62], [0.05, 0.05, 0.68], (20, 3))
    turns = Rotation.from_rotvec(rng.uniform(-0.15, 0.15, (20, 3)))
    on_map = {name: np.add(foot, (0.0, 0.0, 0.65)) for name, foot in feet.items()}
    friction = [0.4, 0.5, 0.6]
    answer = suite.client.query_stance(
        on_map,
        friction,
        base_position=position,
        base_orientation=turns.as_quat(),
        mass=90.0,
        center_of_mass=CENTER,
        acceleration=(0.3, 0.0, 0.0),
        force=(20.0, 0.0, 0.0),
    )
    pose = BodyPose(position, turns.as_matrix())
    load = Load(90.0, pose.from_base(CENTER), acceleration=(0.3, 0.0, 0.0), force=(20.0, 0.0, 0.0))
    stance = robot_stance(hexapod, on_map, friction, pose)
    found = evaluate_stances(stance, load)
    np.testing.assert_array_equal(answer.verdict, found.verdict)
    np.testing.assert_allclose(answer.load_factor, found.load_factor, rtol=1e-6)
    assert found.stands.any()
    assert answer.best == found.best
    assert np.isnan(answer.margin).all()
    assert answer.region.shape == (20, 0, 3)


def test_no_candidates_give_an_empty_answer(suite, feet):
    answer = suite.client.query_stance({**feet, "right_middle": np.empty((0, 3))}, 0.4)
    assert answer.verdict.shape == (0,)
    assert answer.best == -1


def test_what_the_client_cannot_send_raises(suite, feet):
    client = suite.client
    with pytest.raises(errors.InvalidInputError, match="at least one leg"):
        client.query_stance({}, 0.4)
    with pytest.raises(errors.InvalidInputError, match=r"left_front must have shape"):
        client.query_stance({"left_front": [0.0, 0.0]}, 0.4)
    with pytest.raises(errors.InvalidInputError, match="do not broadcast"):
        client.query_stance(
            {**feet, "right_middle": np.zeros((3, 3))}, 0.4, base_position=np.zeros((2, 3))
        )


def test_the_verdicts_of_the_message_are_those_of_the_library():
    for verdict in StanceVerdict:
        assert getattr(StanceVerdictMessage, verdict.name) == verdict.value
