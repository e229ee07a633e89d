# SPDX-License-Identifier: Apache-2.0
"""`model`: legs read from robot models, see `leg_kinematics.model`.

There are two kinds of them, and `leg_of_tree` chooses: `SerialLeg`, three revolute joints in a row
with an inverse in closed form, and `NewtonLeg` for any other chain, with or without loops. Here is
what they have in common.

The leg frame has the axes of the robot's base link, x forward, y left, z up, and its origin on the
first joint on the way to the foot. Joints, their zeros and senses are the file's.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, wrapped_angles
from leg_kinematics.bodies import LegTree
from leg_kinematics.geometry import check_ranges
from leg_kinematics.mechanism import Joint, Linkage, Mechanism, Posture
from leg_kinematics.model import solved
from leg_kinematics.model.equations import Equations, evaluate, new_room
from leg_kinematics.model.postures import independent_rows

Ranges = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class ModelLeg(Mechanism):
    """A leg of a robot model.

    Attributes:
        tree: The chain.
        actuated: Names of the actuated joints.
        postures: All joint positions (N) of a posture of each assembly mode, by the modes' names;
            the first is the initial posture.
        joint_ranges: Ranges of the actuated joints [rad or m].
        passive_joint_ranges: Ranges of the passive joints' excursions [rad or m].

    Raises:
        GeometryError: If the chain makes no leg.
    """

    name: ClassVar[str] = "model"

    tree: LegTree
    actuated: tuple[str, ...]
    postures: tuple[tuple[str, tuple[float, ...]], ...]
    joint_ranges: Ranges
    passive_joint_ranges: Ranges

    def __post_init__(self) -> None:
        """Check the ranges and the freedoms."""
        check_ranges("joint_ranges", self.joint_ranges, self.joints)
        check_ranges("passive_joint_ranges", self.passive_joint_ranges, self.excursions)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The actuated joints (n)."""
        kinds = {joint.name: joint.type for joint in self.tree.joints}
        return tuple(Joint(name, kinds[name]) for name in self.actuated)

    @cached_property
    def passive_joints(self) -> tuple[Joint, ...]:
        """The joints without an actuator (p)."""
        return tuple(
            Joint(joint.name, joint.type)
            for joint in self.tree.joints
            if joint.name not in self.actuated
        )

    @property
    def closure_names(self) -> tuple[str, ...]:
        """Names of the passive joints, whose positions close the loops."""
        return tuple(joint.name for joint in self.passive_joints)

    @cached_property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""
        return np.array(self.joint_ranges, dtype=np.float64).reshape(-1, 2)

    @cached_property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the excursions of the passive joints (p, 2) [rad or m]."""
        return np.array(self.passive_joint_ranges, dtype=np.float64).reshape(-1, 2)

    @property
    def mass(self) -> float:
        """Mass of the moving links [kg]; NaN if the model does not tell it of all."""
        return math.fsum(joint.mass for joint in self.tree.joints)

    @cached_property
    def _equations(self) -> Equations:
        names = [joint.name for joint in self.tree.joints]
        actuated = [names.index(name) for name in self.actuated]
        passive = [k for k in range(len(names)) if k not in actuated]
        initial = np.array(self.postures[0][1])
        equations = Equations(
            self.tree.chain,
            self.tree.loops,
            self.tree.foot,
            independent_rows(self.tree, initial),
            np.array(actuated, dtype=np.float64),
            np.array(passive, dtype=np.float64),
            initial[actuated],
            np.zeros(3),
            np.zeros(2),
        )
        if len(actuated) != 2:
            return equations
        room = new_room(len(names), len(self.tree.coincidences), 2)
        evaluate(equations, initial, room)
        normal = np.cross(*room.twist[:3].T) @ room.rotations[self.tree.foot_body]
        return equations._replace(normal=normal / max(np.linalg.norm(normal), 1e-300))

    @cached_property
    def _order(self) -> tuple[Any, Any]:
        """Numbers of the actuated and of the passive joints in the tree."""
        equations = self._equations
        return equations.actuated.astype(np.int64), equations.passive.astype(np.int64)

    def _all_joints(self, posture: Posture) -> FloatArray:
        """Return the positions of all joints in the order of the tree (..., N)."""
        actuated, passive = self._order
        q = np.empty((*np.shape(posture.status), len(self.tree.joints)))
        q[..., actuated], q[..., passive] = posture.joint_positions, posture.closure
        return q

    @property
    def initial_posture(self) -> Posture:
        """The reference posture."""
        actuated, _ = self._order
        return self.forward(np.array(self.postures[0][1])[actuated])

    @abstractmethod
    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q' (..., 3, n)."""
        return self.twist_jacobian(posture)[..., :3, :]

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q', of the link with the foot (..., 3, n)."""
        return self.twist_jacobian(posture)[..., 3:, :]

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Positions of the passive joints (..., p) [rad or m], with the file's zeros and senses."""
        if not self.passive_joints:
            return posture.closure
        turning = np.array([joint.type == "revolute" for joint in self.passive_joints])
        rest = np.array(self.postures[0][1])[self._order[1]]
        rest = np.where(turning, wrapped_angles(rest), rest)
        moved = posture.closure - rest
        return rest + np.where(turning, wrapped_angles(moved), moved)

    def holding_efforts(self, posture: Posture, gravity: ArrayLike) -> FloatArray:
        """Efforts that hold the links' own weight (..., n) [N.m or N]; see `Mechanism`."""
        if not self.has_masses:
            return super().holding_efforts(posture, gravity)
        chain, loops, _, rows, actuated, passive, *_ = self._equations
        vector = as_array("gravity", gravity, 3)
        q = self._all_joints(posture)
        return solved.holding_efforts(
            chain, loops, self.tree.masses, rows, actuated, passive, q, vector
        )

    @property
    def has_masses(self) -> bool:
        """Whether the masses of all moving links are known."""
        return math.isfinite(self.mass)

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """The chain of the leg, that of all assembly modes."""
        self.mode_index(assembly_mode)
        return self.tree

    def linkage(self, posture: Posture) -> Linkage:
        """Joints, loops' points and foot of this posture; bars connect what is on one body."""
        joints = self.tree.joints
        places = solved.joint_places(self.tree.chain, self._all_joints(posture))
        foot = posture.foot_position
        bars = [(joint.parent - 1, k) for k, joint in enumerate(joints) if joint.parent > 0]
        names = (*(joint.name for joint in joints), "foot")
        bars.append((self.tree.foot_body - 1, len(joints)))
        points = np.concatenate([places, foot[..., None, :]], axis=-2)
        return Linkage(names, points, tuple(bars))
