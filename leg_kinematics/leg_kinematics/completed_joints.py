# SPDX-License-Identifier: Apache-2.0
"""Joint states completed: where the passive joints stand, given what the drives tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.mirrored import without_reflection
from leg_kinematics.robot import Leg, Robot


class Positions(NamedTuple):
    """Where joints stand.

    Attributes:
        names: Their names (k).
        values: Their positions (k,) [rad or m].
    """

    names: tuple[str, ...]
    values: FloatArray


class CompletedJoints:
    """The positions of all joints of a robot's `body_tree`s, which its URDF has, too.

    What drives tell may come in any pieces: of each joint the last value counts, and a leg is known
    from when all of its drives have told.

    Args:
        robot: The robot.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
    """

    def __init__(self, robot: Robot) -> None:
        self._told: dict[str, float] = {}
        self._legs_of: dict[str, str] = {}  # by their actuated joints
        self._changed: set[str] = set()
        self._tree_names = {leg.name: leg.tree_joint_names() for leg in robot.legs.values()}
        self._groups: dict[Mechanism, list[Leg]] = {}
        for leg in robot.legs.values():
            self._legs_of |= dict.fromkeys(leg.joint_names, leg.name)
            self._groups.setdefault(without_reflection(leg.mechanism)[0], []).append(leg)

    def add(self, names: Sequence[str], values: FloatArray) -> None:
        """Take up what drives tell; names of other joints and missing values are passed over."""
        for name, value in zip(names, values.tolist(), strict=False):
            leg = self._legs_of.get(name)
            if leg is not None:
                self._told[name] = value
                self._changed.add(leg)

    def take(self) -> Positions:
        """Return the joints of the legs that have changed since the last call.

        Legs whose loops do not close there, which no real leg can tell, are left out.
        """
        names: list[str] = []
        values: list[FloatArray] = []
        for mechanism, legs in self._groups.items():
            known = [leg for leg in legs if leg.name in self._changed and self._is_known(leg)]
            if not known:
                continue
            posture = mechanism.forward(np.array([self._positions(leg) for leg in known]))
            for leg, row in zip(known, mechanism.tree_positions(posture), strict=True):
                if np.isfinite(row).all():
                    names += self._tree_names[leg.name]
                    values.append(row)
        self._changed.clear()
        return Positions(tuple(names), np.concatenate(values) if values else np.empty(0))

    def _is_known(self, leg: Leg) -> bool:
        return all(name in self._told for name in leg.joint_names)

    def _positions(self, leg: Leg) -> FloatArray:
        """Return the positions of a leg's actuated joints (n,)."""
        told = np.array([self._told[name] for name in leg.joint_names])
        return told if leg.drives is None else leg.drives.positions(told)
