# SPDX-License-Identifier: Apache-2.0
"""Masses on named bars of a linkage, and the efforts that hold their weight."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_matching
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError, UnknownNameError
from leg_kinematics.geometry import Dimensioned
from leg_kinematics.mechanism import Posture
from leg_kinematics.model import solved
from leg_kinematics.model.chain import place_bodies
from leg_kinematics.model.postures import independent_rows

SAMPLES = 200  # joint positions, of whose postures some tell what moves together
COMPARED = 8  # of them
TOGETHER = 1e-9  # m, within which a point stays in place on a body


class BarMass(NamedTuple):
    """A mass on a linkage.

    Attributes:
        points: Names of the two ends of a bar, or of one point.
        mass: The mass [kg].
        at: Where on the bar it is, from the first point (0) to the second (1).
    """

    points: tuple[str, ...]
    mass: float
    at: float = 0.5


class Loads(NamedTuple):
    """What `solved.holding_efforts` needs of the bodies.

    Attributes:
        tree: The bodies.
        masses: One row a joint: mass and centre of the body it moves (N, 4).
        rows: Independent equations of the loops (m,).
        actuated: Numbers of the actuated joints (n,).
        passive: Numbers of the others (m,).
    """

    tree: LegTree
    masses: FloatArray
    rows: FloatArray
    actuated: FloatArray
    passive: FloatArray


class Weighed(Dimensioned):
    """Base of the mechanisms given by dimensions whose bars may have masses.

    Attributes:
        bar_masses: The masses; none if they are not known.
    """

    bar_masses: tuple[BarMass, ...]

    def check_fields(self) -> None:
        """Check every field by itself.

        Raises:
            GeometryError: If one is wrong.
        """
        super().check_fields()
        for bar in self.bar_masses:
            if not (0.0 <= bar.mass < math.inf and 0.0 <= bar.at <= 1.0):
                raise GeometryError(f"mass {bar.mass} [kg] at {bar.at}: must be >= 0 at 0 .. 1")

    @property
    def has_masses(self) -> bool:
        """Whether masses are told."""
        return bool(self.bar_masses)

    @property
    def mass(self) -> float:
        """Sum of the masses [kg]."""
        return math.fsum(bar.mass for bar in self.bar_masses)

    def holding_efforts(self, posture: Posture, gravity: ArrayLike) -> FloatArray:
        """Efforts that hold the masses of the bars (..., n) [N.m or N]; see `Mechanism`.

        By virtual work of the bodies, their loops closed.
        """
        if not self.bar_masses:
            return super().holding_efforts(posture, gravity)
        batch = np.shape(posture.status)
        vector = np.broadcast_to(as_matching("gravity", gravity, (3,), batch), (*batch, 3))
        q = self.tree_positions(posture)
        efforts = np.full((*batch, len(self.joints)), np.nan)
        modes = self._body_modes(posture)
        for mode in np.unique(modes):
            tree, masses, rows, actuated, passive = self.loads(self.assembly_modes[mode])
            here = modes == mode
            efforts[here] = solved.holding_efforts(
                *(tree.chain, tree.loops, masses, rows, actuated, passive, q[here], vector[here])
            )
        return efforts

    def _body_modes(self, posture: Posture) -> Any:
        """Return indices of modes (...) that have the bodies of postures."""
        return np.zeros(np.shape(posture.status), dtype=np.int64)

    @cached_property
    def _known_loads(self) -> dict[str, Loads]:
        return {}

    def loads(self, assembly_mode: str = "") -> Loads:
        """Return the bodies of a mode with their masses.

        Raises:
            GeometryError: If a bar is not on one body.
            UnknownNameError: If the linkage has no such point.
        """
        if assembly_mode not in self._known_loads:
            self._known_loads[assembly_mode] = self._loads(assembly_mode)
        return self._known_loads[assembly_mode]

    def _loads(self, assembly_mode: str) -> Loads:
        tree = self.body_tree(assembly_mode)
        lower, upper = np.clip(self.joint_limits, -math.pi, math.pi).T
        rng = np.random.default_rng(0)
        posture = self.forward(rng.uniform(lower, upper, (SAMPLES, len(lower))), assembly_mode)
        known = np.flatnonzero(np.isfinite(posture.closure).all(axis=-1))[:COMPARED]
        q, closure, foot, status = posture
        posture = Posture(q[known], closure[known], foot[known], status[known])
        positions, linkage = self.tree_positions(posture), self.linkage(posture)
        placed = [_placed(tree, q) for q in positions]
        carried = np.zeros((len(tree.joints) + 1, 4))
        for bar in self.bar_masses:
            for name in bar.points:
                if name not in linkage.names:
                    raise UnknownNameError("point", name, linkage.names)
            ends = [linkage.points[:, linkage.names.index(name)] for name in bar.points]
            at = [_on_bodies(placed, end) for end in ends]  # (k, N + 1, 3) each
            still = [np.ptp(on, axis=0).max(axis=-1) <= TOGETHER for on in at]
            bodies = np.flatnonzero(np.logical_and.reduce(still))
            if not len(bodies):
                raise GeometryError(
                    f"{'-'.join(bar.points)} is no bar: its ends are not on one body; masses on a "
                    "cylinder are given at its points"
                )
            body = bodies[-1]
            first, last = at[0][0, body], at[-1][0, body]
            carried[body, 0] += bar.mass
            carried[body, 1:] += bar.mass * (first + bar.at * (last - first))
        mass = carried[1:, :1]
        centres = np.divide(carried[1:, 1:], mass, out=np.zeros((len(mass), 3)), where=mass > 0.0)
        names = [joint.name for joint in tree.joints]
        actuated = [names.index(joint.name) for joint in self.joints]
        passive = [k for k in range(len(names)) if k not in actuated]
        return Loads(
            tree,
            np.concatenate([mass, centres], axis=1),
            independent_rows(tree, positions[0]),
            np.array(actuated, dtype=np.float64),
            np.array(passive, dtype=np.float64),
        )


def _placed(tree: LegTree, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotations (N + 1, 3, 3) and origins (N + 1, 3) of the bodies."""
    n = len(tree.joints)
    rotations, origins = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    place_bodies(tree.chain, q, rotations, origins, np.empty((n, 3)))
    return rotations, origins


def _on_bodies(placed: list[tuple[FloatArray, FloatArray]], points: FloatArray) -> FloatArray:
    """Return points (k, 3) of k postures in the frames of all bodies (k, N + 1, 3)."""
    found = [
        np.einsum("bji,bj->bi", rotations, point - origins)
        for (rotations, origins), point in zip(placed, points, strict=True)
    ]
    return np.array(found)
