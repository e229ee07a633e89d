# SPDX-License-Identifier: Apache-2.0
"""Joint states that come in pieces, such as one joint a message, put together to whole legs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Robot
from leg_statics.joint_stream import joint_fields

SPAN = 100_000_000  # pieces further apart are not of one moment [ns]


class WholeLegs(NamedTuple):
    """Joint states of whole legs, as one message would have them.

    Attributes:
        names: Names of the joints (N).
        position: Their positions (N,) [rad or m].
        velocity: Their velocities (N,) [rad/s or m/s]; NaN if not known.
        effort: Their efforts (N,) [N.m or N]; NaN if not known.
    """

    names: tuple[str, ...]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray


class JointPieces:
    """Keeps what messages tell of joints until all joints of a leg are known.

    Args:
        robot: The robot.

    Attributes:
        lacking: Joints that are missing of legs whose other joints came again meanwhile, by leg.
    """

    def __init__(self, robot: Robot) -> None:
        self.lacking: dict[str, tuple[str, ...]] = {}
        self._joints = {leg.name: leg.joint_names for leg in robot.legs.values()}
        self._leg_of = {joint: leg for leg, joints in self._joints.items() for joint in joints}
        self._known: dict[str, dict[str, tuple[int, FloatArray]]] = {
            leg: {} for leg in self._joints
        }

    def add(
        self,
        time: int,
        names: Sequence[str],
        position: ArrayLike,
        velocity: ArrayLike = (),
        effort: ArrayLike = (),
    ) -> WholeLegs | None:
        """Take up a message, and return the legs that it completes; None if there are none.

        Args:
            time: When it came [ns].
            names: Names of N joints; those of no leg are ignored.
            position: Their positions (N,) [rad or m].
            velocity: Their velocities (N,) [rad/s or m/s]; empty if not known.
            effort: Their efforts (N,) [N.m or N]; empty if not known.

        Raises:
            JointStateError: If a length is wrong.
        """
        fields = joint_fields(len(names), position, velocity, effort)
        values = np.stack([f if len(f) else np.full(len(names), np.nan) for f in fields], axis=-1)
        self.lacking = {}
        touched = dict.fromkeys(self._leg_of[name] for name in names if name in self._leg_of)
        for name, row in zip(names, values, strict=True):
            if name in self._leg_of:
                leg = self._leg_of[name]
                known = self._known[leg]
                if name in known:
                    missing = (joint for joint in self._joints[leg] if joint not in known)
                    self.lacking[leg] = tuple(missing)
                known[name] = time, row
        return self._complete([leg for leg in touched if self._is_whole(leg, time)])

    def _is_whole(self, leg: str, time: int) -> bool:
        """Forget what is old of a leg, and tell whether all the rest is known."""
        known = self._known[leg]
        for joint in [joint for joint, (when, _) in known.items() if time - when > SPAN]:
            del known[joint]
        return len(known) == len(self._joints[leg])

    def _complete(self, legs: Sequence[str]) -> WholeLegs | None:
        if not legs:
            return None
        names = tuple(joint for leg in legs for joint in self._joints[leg])
        rows = np.array([self._known[self._leg_of[joint]][joint][1] for joint in names])
        for leg in legs:
            self._known[leg].clear()
            self.lacking.pop(leg, None)
        return WholeLegs(names, *rows.T)
