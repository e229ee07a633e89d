# SPDX-License-Identifier: Apache-2.0
"""A walk on level ground, for a robot that is not there: what its joints and feet do in a cycle.

    cycle = gait_cycle(load_robot("hexapod"), Gait(period=2.0), samples=100)
    cycle.positions   # (100, joints), in the order of `cycle.names`

Legs that stand next to each other on the body take turns: tripods of six legs, diagonals of four.
It is kinematics and statics only: no body, no dynamics.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status
from leg_statics.capacity.problem import load_capacity
from leg_statics.efforts import joint_efforts

HAND_OVER = 0.05  # share of a cycle in which a foot takes up its load, and puts it down
LIFT = 0.3  # height of a swing, as a share of the stride
LONGEST_STRIDE, SHORTEST_STRIDE = 1.0 / 3.0, 0.01  # as shares of the height of the leg
USED_CAPACITY = 0.5  # share of the weakest leg's capacity without friction that a foot bears


@dataclass(frozen=True)
class Gait:
    """What may be chosen of a walk.

    Attributes:
        period: Time of a cycle [s].
        stride: Length of a stance [m]; 0 for one that suits the legs.
        load: Vertical force on a standing foot [N]; 0 for half of what the weakest leg bears.
    """

    period: float = 2.0
    stride: float = 0.0
    load: float = 0.0


class GaitCycle(NamedTuple):
    """What the joints and feet of a robot do at T instants of a cycle, evenly spaced.

    Attributes:
        names: Joint names (N), in the order of the robot.
        positions: Of the joints, as their drives tell them (T, N) [rad or m].
        velocities: Of the joints, as their drives tell them (T, N) [rad/s or m/s].
        efforts: That hold the feet, as the drives tell them (T, N) [N.m or N]; 0 where nothing
            pushes.
        forces: Ground reaction on each foot, in its leg frame (T, 3) [N]; of point feet only.
        stride: Length of a stance [m]; NaN if all legs have one crank, which fixes it.
        load: Vertical force on a standing foot [N].
    """

    names: tuple[str, ...]
    positions: FloatArray
    velocities: FloatArray
    efforts: FloatArray
    forces: Mapping[str, FloatArray]
    stride: float
    load: float


def gait_cycle(robot: Robot, gait: Gait, samples: int) -> GaitCycle:
    """Return a cycle of a walk.

    Raises:
        ValueRangeError: If a value of the gait is out of range, or the legs cannot make the stride.
    """
    _check(gait)
    shifts = phase_shifts(robot)
    phases = {name: (np.arange(samples) / samples + shifts[name]) % 1.0 for name in robot.legs}
    stride = _fitting_stride(robot, gait.stride, samples)
    postures = {name: _posture(leg, phases[name], stride) for name, leg in robot.legs.items()}
    feet = [leg for leg in robot.legs.values() if leg.mechanism.has_point_foot]
    reactions = {leg.name: _unit_reaction(leg, phases[leg.name]) for leg in feet}
    load = gait.load or USED_CAPACITY * min(
        (_least_capacity(leg, postures[leg.name], reactions[leg.name]) for leg in feet), default=0.0
    )
    forces = {name: load * reaction for name, reaction in reactions.items()}
    told = [
        _told(
            leg,
            postures[name].joint_positions,
            _rates(leg, phases[name], stride) / gait.period,
            _efforts(leg, postures[name], forces.get(name)),
        )
        for name, leg in robot.legs.items()
    ]
    positions, velocities, efforts = (
        np.concatenate(part, axis=-1) for part in zip(*told, strict=True)
    )
    names = robot.effort_limits()[0]
    return GaitCycle(names, positions, velocities, efforts, forces, stride, load)


def phase_shifts(robot: Robot) -> dict[str, float]:
    """Return by how much of a cycle each leg is ahead: every second leg around the body by half.

    Legs with one crank are mounted half a turn apart already, in their geometry.
    """
    around = sorted(
        (leg for leg in robot.legs.values() if not _is_crank(leg.mechanism)),
        key=lambda leg: math.atan2(leg.mount.position[1], leg.mount.position[0]),
    )
    shifts = {leg.name: 0.5 * (k % 2) for k, leg in enumerate(around)}
    return {name: shifts.get(name, 0.0) for name in robot.legs}


def foot_path(neutral: FloatArray, phase: FloatArray, stride: float, lift: float) -> FloatArray:
    """Return task coordinates of a foot (T, t) [m]: a straight stance, then an arc forward.

    Args:
        neutral: Task coordinates in the middle of the stance (t,) [m].
        phase: Shares of a cycle (T,), from 0 at touchdown; a half is lift-off.
        stride: Length of the stance [m].
        lift: Height of the arc [m].
    """
    swing = 2.0 * (phase % 1.0) - 1.0  # 0 to 1 in the second half
    path = np.repeat(neutral[None], len(phase), axis=0)
    path[:, 0] += stride * np.where(swing < 0.0, -0.5 - swing, -0.5 * np.cos(math.pi * swing))
    path[:, 2] += lift * np.where(swing < 0.0, 0.0, np.sin(math.pi * swing) ** 2)
    return path


def ground_reaction(phase: FloatArray, load: float) -> FloatArray:
    """Return the force on a foot (T, 3) [N]: it takes its load over and hands it on smoothly.

    A little of it drives: braking at first, then pushing.

    Args:
        phase: As for `foot_path`.
        load: Vertical force in between [N].
    """
    share = np.clip(np.minimum(phase, 0.5 - phase) / HAND_OVER, 0.0, 1.0)
    vertical = load * share
    return np.stack([0.1 * (4.0 * phase - 1.0) * vertical, np.zeros_like(phase), vertical], -1)


def _check(gait: Gait) -> None:
    for name, value, least in (
        ("period", gait.period, 0.1),
        ("stride", gait.stride, 0.0),
        ("load", gait.load, 0.0),
    ):
        if not least <= value < math.inf:
            raise ValueRangeError(f"{name}: got {value:g}; allowed: finite and >= {least:g}")


def _is_crank(mechanism: Mechanism) -> bool:
    """Tell whether one turning joint is all that moves the leg."""
    return len(mechanism.joints) == 1 and mechanism.joints[0].type == "revolute"


def _posture(leg: Leg, phase: FloatArray, stride: float) -> Posture:
    mechanism = leg.mechanism
    if _is_crank(mechanism):
        return mechanism.forward(2.0 * math.pi * phase[:, None])
    neutral = mechanism.initial_posture.foot_position
    return mechanism.inverse(foot_path(neutral, phase, stride, LIFT * stride))


def _fitting_stride(robot: Robot, stride: float, samples: int) -> float:
    """Return the stride asked for, or if that is 0 a long one that all legs can make [m]."""
    legs = [leg for leg in robot.legs.values() if not _is_crank(leg.mechanism)]
    if not legs:
        return math.nan
    phase = np.arange(samples) / samples
    heights = [abs(leg.mechanism.initial_posture.foot_position[2]) for leg in legs]
    tried = stride or LONGEST_STRIDE * min(heights)
    shortest = stride or SHORTEST_STRIDE * min(heights)
    while tried >= shortest:
        unable = [
            leg.name for leg in legs if np.any(_posture(leg, phase, tried).status != Status.OK)
        ]
        if not unable:
            return tried
        tried *= 0.8
    raise ValueRangeError(
        f"stride: {shortest:.3g} m is too long for {', '.join(unable)} of {robot.name}"
    )


def _rates(leg: Leg, phase: FloatArray, stride: float) -> FloatArray:
    """Return joint velocities in a cycle that lasts a second (T, n) [rad or m]."""
    step = 1e-5
    after, before = (_posture(leg, phase + d, stride).joint_positions for d in (step, -step))
    return (after - before) / (2.0 * step)


def _unit_reaction(leg: Leg, phase: FloatArray) -> FloatArray:
    """Return the force on a foot if a standing one bears 1 N (T, 3)."""
    if not _is_crank(leg.mechanism):
        return ground_reaction(phase, 1.0)
    height, other = (_posture(leg, p, 0.0).foot_position[:, 2] for p in (phase, phase + 0.5))
    return np.where((height < other)[:, None], [0.0, 0.0, 1.0], 0.0)


def _least_capacity(leg: Leg, posture: Posture, reaction: FloatArray) -> float:
    """Return the least vertical force that the leg bears while its foot stands [N]."""
    jacobian = leg.mechanism.jacobian(posture)
    lower, upper = leg.effort_limits.T
    borne = load_capacity(jacobian, lower, upper, friction=0.0).capacity
    return float(np.min(borne[reaction[:, 2] > 0.0]))


def _efforts(leg: Leg, posture: Posture, force: FloatArray | None) -> FloatArray:
    if force is None:
        return np.zeros_like(posture.joint_positions)
    mechanism = leg.mechanism
    jacobian, angular = mechanism.jacobian(posture), mechanism.angular_jacobian(posture)
    return joint_efforts(jacobian, angular, force)


def _told(
    leg: Leg, positions: FloatArray, rates: FloatArray, efforts: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and efforts as the drives of a leg tell them (T, n)."""
    if leg.drives is None:
        return positions, rates, efforts
    scale = leg.drives.scale
    return leg.drives.told_positions(positions), rates / scale, efforts * scale
