# SPDX-License-Identifier: Apache-2.0
"""How well a recorded robot stood: margin and load factor of its stance over time.

Wrenches tell which feet are on the ground. Known is a stance if the wrench on every foot is
recorded, every leg is told and the robot's mass is known; the ground is level.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Robot
from leg_statics.leg_state import LegStates
from leg_statics.stance.region import support_region
from leg_statics.stance.stances import load_factor
from leg_statics.stance.standing import measured_stance, robot_load

INTERVAL = 50_000_000  # one stance in this time is judged [ns]
DIRECTIONS = 12  # of the margin


class WorstStance(NamedTuple):
    """The worst value of a quantity of the stances.

    Attributes:
        value: The value.
        time: When it was recorded [ns].
    """

    value: float
    time: int


NONE_YET = WorstStance(np.inf, 0)


@dataclass
class JudgedStances:
    """Gathers how the robot stood, in constant memory.

    Attributes:
        known: How many stances were judged.
        carried: In how many of them the feet carry the robot.
        load_factor: How many times they do at least, 0 if not at all.
        margin: Least distance of the centre of mass from the border of the support region [m],
            negative outside; of stances in which the feet carry it somewhere.
    """

    known: int = 0
    carried: int = 0
    load_factor: WorstStance = NONE_YET
    margin: WorstStance = NONE_YET
    _last: int = -1

    def add(
        self,
        robot: Robot,
        friction: float,
        states: LegStates,
        load: Mapping[str, FloatArray],
        contact_force: float,
        time: NDArray[np.int64],
    ) -> None:
        """Judge one stance in each interval of a batch.

        Args:
            robot: The robot, with the effort limits in force.
            friction: Friction coefficient of the ground.
            states: States of the legs at T moments.
            load: Vertical force on the foot (T,) [N], by leg; NaN if not known.
            contact_force: A foot with less of it is in the air [N].
            time: When they were recorded (T,) [ns].
        """
        legs = [leg.name for leg in robot.legs.values() if leg.mechanism.has_point_foot]
        if robot.body is None or set(legs) != set(states.legs) or not set(legs) <= set(load):
            return
        forces = np.stack([load[leg] for leg in states.legs], axis=-1)
        _, first = np.unique(time // INTERVAL, return_index=True)
        chosen = first[np.isfinite(forces[first]).all(axis=-1)]
        chosen = chosen[time[chosen] // INTERVAL > self._last]
        if not len(chosen):
            return
        self._last = int(time[chosen[-1]] // INTERVAL)
        joints = {
            leg: q[chosen] for leg, q in zip(states.legs, states.joint_positions, strict=True)
        }
        stance = measured_stance(robot, joints, forces[chosen] >= contact_force, friction)
        weight = robot_load(robot)
        factor = np.nan_to_num(load_factor(stance, weight).multiple, posinf=np.inf)
        margin = support_region(stance, weight, DIRECTIONS).margin
        self.known += len(chosen)
        self.carried += int(np.sum(factor >= 1.0))
        self.load_factor = _worse(self.load_factor, factor, time[chosen])
        self.margin = _worse(self.margin, np.nan_to_num(margin, nan=np.inf), time[chosen])


def _worse(known: WorstStance, values: FloatArray, times: NDArray[np.int64]) -> WorstStance:
    k = int(np.argmin(values))
    return WorstStance(float(values[k]), int(times[k])) if values[k] < known.value else known
