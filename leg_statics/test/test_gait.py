# SPDX-License-Identifier: Apache-2.0
"""A walk on level ground: legs that take turns, feet that do not slip, efforts that hold them."""

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.status import Status
from leg_statics.gait import Gait, gait_cycle, phase_shifts
from leg_statics.joint_stream import JointStream

SAMPLES = 200
SHIPPED = ("hexapod", "quadruped", "walker", "gantry")


@pytest.fixture(scope="module", params=SHIPPED)
def walk(request):
    robot = load_robot(request.param)
    return robot, gait_cycle(robot, Gait(period=2.0), SAMPLES)


def columns(robot, cycle, leg):
    return [cycle.names.index(joint) for joint in robot.leg(leg).joint_names]


def test_every_shipped_robot_walks_within_its_reach_and_limits(walk):
    robot, cycle = walk
    assert cycle.names == robot.effort_limits()[0]
    for leg in robot.legs.values():
        posture = leg.mechanism.forward(cycle.positions[:, columns(robot, cycle, leg.name)])
        assert (posture.status == Status.OK).all()


def test_velocities_are_the_derivatives_of_positions(walk):
    _, cycle = walk
    turn = 2.0 * np.pi  # a crank goes on where its angle begins again
    later, earlier = np.roll(cycle.positions, -1, axis=0), np.roll(cycle.positions, 1, axis=0)
    difference = (later - earlier + 0.5 * turn) % turn - 0.5 * turn
    mean = difference / (2.0 * 2.0 / SAMPLES)
    # the second derivative jumps at touchdown and lift-off
    away = np.abs(mean - cycle.velocities) < 2e-2 * np.abs(cycle.velocities).max()
    assert away.mean() > 0.95


def test_the_state_stream_finds_forces_held_within_the_limits(walk):
    robot, cycle = walk
    states = JointStream(robot, friction=0.4).read(
        cycle.names, cycle.positions, cycle.velocities, cycle.efforts
    )
    assert set(states.legs) == set(cycle.forces)
    for k, leg in enumerate(states.legs):
        loaded = cycle.forces[leg][:, 2] > 0.0
        assert 0.2 < loaded.mean() < 0.6
        assert states.utilisation[loaded, k].max() < 1.0
        assert (states.utilisation[~loaded, k] == 0.0).all()
        assert (cycle.forces[leg][loaded, 2] <= states.load_capacity[loaded, k]).all()


@pytest.mark.parametrize("name", ["hexapod", "quadruped"])
def test_a_standing_foot_moves_back_straight_at_constant_speed(name):
    robot = load_robot(name)
    cycle = gait_cycle(robot, Gait(period=1.0), SAMPLES)
    states = JointStream(robot, 0.4).read(cycle.names, cycle.positions, cycle.velocities)
    for k, leg in enumerate(states.legs):
        stands = cycle.forces[leg][:, 2] >= cycle.load
        np.testing.assert_allclose(
            states.foot_velocity[stands, k],
            [[-2.0 * cycle.stride, 0.0, 0.0]] * stands.sum(),
            atol=1e-6,
        )


@pytest.mark.parametrize(
    ("name", "together"),
    [
        ("hexapod", {"left_front", "left_rear", "right_middle"}),
        ("quadruped", {"left_front", "right_rear"}),
    ],
)
def test_tripods_and_diagonals_take_turns(name, together):
    shifts = phase_shifts(load_robot(name))
    assert {leg for leg, shift in shifts.items() if shift == shifts["left_front"]} == together
    assert set(shifts.values()) == {0.0, 0.5}


@pytest.mark.parametrize(
    ("gait", "message"),
    [
        (Gait(stride=0.9), r"stride: 0\.9 m is too long for left_front"),
        (Gait(period=0.0), r"period: got 0; allowed: finite and >= 0\.1"),
        (Gait(load=np.nan), "load: got nan"),
    ],
)
def test_what_cannot_be_walked_is_told(gait, message):
    with pytest.raises(ValueRangeError, match=message):
        gait_cycle(load_robot("hexapod"), gait, SAMPLES)
