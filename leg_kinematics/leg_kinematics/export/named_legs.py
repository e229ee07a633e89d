# SPDX-License-Identifier: Apache-2.0
"""The bodies of a robot's legs under the names that they have in a file."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status

BAR_WIDTH = 0.02  # diameter of a bar, relative to the longest of the leg
BALL = 0.25  # radius of a body whose inertia is not known, relative to the longest bar
UNLIMITED = 1e9  # N.m or N, for an actuator that nothing limits where a number is wanted
SHORTEST_BAR = 1e-6  # m
POSTURES = 500  # in which a good one of an assembly mode is looked for
ISOTROPIC = 0.05  # ratio of singular values of J below which a posture is near a singularity
PARTS = ("chain", "loops", "foot")  # of a tree, by which bodies are told apart


class Site(NamedTuple):
    """A point of a link.

    Attributes:
        link: Name of the link.
        point: The point in its frame [m].
    """

    link: str
    point: tuple[float, float, float]


class Bar(NamedTuple):
    """A straight piece of a link, to look at.

    Attributes:
        start: One end in the link's frame (3,) [m].
        end: The other.
    """

    start: FloatArray
    end: FloatArray


class NamedLeg:
    """A leg with the names of its joints and links in a robot.

    Body 0 is the leg frame, which is fixed to the robot's base; any other is named by its joint.

    Args:
        leg: The leg.
        prefix: What stands before the names of links, such as "robot_1/".

    Attributes:
        leg: The leg.
        tree: Its bodies; joints have the mechanism's names.
        joint_names: Names of the tree's joints in the robot.
        links: Names of the bodies.
        foot: Name of the link on the foot, with the axes of the foot's body.

    Raises:
        NotSupportedError: If the mechanism does not tell its bodies.
    """

    def __init__(self, leg: Leg, prefix: str = "") -> None:
        self.leg = leg
        self.tree: LegTree = leg.mechanism.body_tree()
        self.joint_names = leg.tree_joint_names()
        self.links = (leg.frame, *(f"{prefix}{name}_link" for name in self.joint_names))
        self.foot = f"{prefix}{leg.name}_foot"

    @cached_property
    def efforts(self) -> dict[str, tuple[float, float]]:
        """Least and most effort of the actuated joints by their names in the robot [N.m or N]."""
        limits = self.leg.effort_limits.tolist()
        return {n: (lo, hi) for n, (lo, hi) in zip(self.leg.joint_names, limits, strict=True)}

    @property
    def closures(self) -> tuple[tuple[Site, Site], ...]:
        """Pairs of points that coincide."""
        return tuple(
            (Site(self.links[c.first], c.first_point), Site(self.links[c.second], c.second_point))
            for c in self.tree.coincidences
        )

    def bars(self) -> Iterator[tuple[str, Bar]]:
        """Yield links and the bars on them, from their joint to what else is joined to them."""
        for number, link in enumerate(self.links):
            for end in self._ends(number):
                if np.linalg.norm(end) > SHORTEST_BAR:
                    yield link, Bar(np.zeros(3), end)
        for k, joint in enumerate(self.tree.joints):
            shortest = joint.limits[0]
            if joint.type == "prismatic" and SHORTEST_BAR < shortest < np.inf:
                way = shortest * np.array(joint.axis)
                yield self.links[joint.parent], Bar(np.array(joint.offset), joint.offset + way)
                yield self.links[k + 1], Bar(-way, np.zeros(3))

    def _ends(self, number: int) -> list[FloatArray]:
        """Return the points of a body that are joined to something [m]."""
        ends = [joint.offset for joint in self.tree.joints if joint.parent == number]
        joined = set()
        for c in self.tree.coincidences:
            if (c.first, c.second) not in joined:  # the second point of a pin is no bar
                joined.add((c.first, c.second))
                ends += [c.first_point] if c.first == number else []
                ends += [c.second_point] if c.second == number else []
        if self.tree.foot_body == number:
            ends.append(self.tree.foot_point)
        return [np.array(end) for end in ends]

    @cached_property
    def longest_bar(self) -> float:
        """Length of the longest bar [m]."""
        lengths = [float(np.linalg.norm(bar.end - bar.start)) for _, bar in self.bars()]
        return max(lengths, default=1.0)

    @property
    def bar_radius(self) -> float:
        """Radius of the bars [m]."""
        return 0.5 * BAR_WIDTH * self.longest_bar

    def inertia(self, mass: float) -> float:
        """Return the moment of inertia of a body of which only the mass is known [kg.m²]."""
        return 0.4 * mass * (BALL * self.longest_bar) ** 2

    @cached_property
    def assembly(self) -> dict[str, dict[str, float]]:
        """A posture of each assembly mode that has these bodies: joint positions by name.

        The first is the initial posture. Modes in which a body is turned over are left out.
        """
        mechanism = self.leg.mechanism
        found = {}
        for mode in mechanism.assembly_modes:
            if not self._has_these_bodies(mode):
                continue
            posture = good_posture(mechanism, mode)
            if posture is not None:
                positions = mechanism.tree_positions(posture).tolist()
                found[mode] = dict(zip(self.joint_names, positions, strict=True))
        return found

    def _has_these_bodies(self, mode: str) -> bool:
        try:
            other = self.leg.mechanism.body_tree(mode)
        except GeometryError:
            return False
        pairs = [
            (getattr(self.tree, key), getattr(other, key)) for key in ("chain", "loops", "foot")
        ]
        return all(np.allclose(one, two, rtol=0.0, atol=1e-9) for one, two in pairs)


def named_legs(robot: Robot) -> list[NamedLeg]:
    """Return the legs of a robot with the names of their bodies.

    Raises:
        NotSupportedError: If a mechanism does not tell its bodies.
    """
    return [NamedLeg(leg, robot.frame_prefix) for leg in robot.legs.values()]


def good_posture(mechanism: Mechanism, mode: str) -> Posture | None:
    """Return a posture of an assembly mode far from singularities; None if there is none.

    It is the initial one if that has a solution in this mode, else the best conditioned of many.
    """
    initial = mechanism.initial_posture.joint_positions
    if mode == mechanism.assembly_modes[0]:
        return mechanism.initial_posture
    lower, upper = np.clip(mechanism.joint_limits.T, initial - np.pi, initial + np.pi)
    tried = np.random.default_rng(0).uniform(lower, upper, (POSTURES, len(lower)))
    posture = mechanism.forward(np.concatenate([initial[None], tried]), mode)
    closed = np.isfinite(posture.closure).all(axis=-1) & np.isfinite(posture.foot_position).all(-1)
    solved = np.flatnonzero(closed & (posture.status != Status.SINGULAR))
    if not len(solved):
        return None
    values = np.linalg.svd(mechanism.jacobian(posture)[solved], compute_uv=False)
    conditions = values[:, -1] / values[:, 0]
    best = 0 if solved[0] == 0 and conditions[0] > ISOTROPIC else int(np.argmax(conditions))
    q, closure, foot, status = posture
    chosen = solved[best]
    return Posture(q[chosen], closure[chosen], foot[chosen], status[chosen])
