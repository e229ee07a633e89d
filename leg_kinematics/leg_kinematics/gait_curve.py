# SPDX-License-Identifier: Apache-2.0
"""The foot curve of a leg driven by one crank, and how a unit of two such legs walks on it.

The two legs of a unit share a frame and their cranks stand half a turn apart, so the lower foot
carries the body for half a turn each. Works with any mechanism that has one actuator which turns
endlessly and a foot that stays in a plane y = const.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import NotSupportedError, ValueRangeError
from leg_kinematics.mechanism import Mechanism

SAMPLES = 3600


@dataclass(frozen=True)
class GaitCurve:
    """The foot of a one-crank leg over one turn of its crank.

    Attributes:
        crank_angles: Evenly spaced joint positions over one turn (m,) [rad]; m is even.
        foot: Foot positions in the leg frame (m, 3) [m].
    """

    crank_angles: FloatArray
    foot: FloatArray

    @property
    def step_height(self) -> float:
        """Height of the whole curve [m]."""
        return float(np.ptp(self.foot[:, 2]))

    @property
    def length(self) -> float:
        """Extent of the whole curve in the walking direction [m]."""
        return float(np.ptp(self.foot[:, 0]))

    @cached_property
    def support(self) -> FloatArray:
        """The foot's path while it carries a two-leg unit, from one double support to the next [m].

        Shape (k, 3). The foot carries while it is lower than the other leg's, half a turn away; at
        the ends both feet are equally high.
        """
        other = np.roll(self.foot, -(len(self.foot) // 2), axis=0)
        above = self.foot[:, 2] - other[:, 2]
        starts = np.flatnonzero((above <= 0.0) & (np.roll(above, 1) > 0.0))
        if not len(starts):  # both feet always at one height
            return self.foot
        runs = [np.roll(above, -start) <= 0.0 for start in starts]
        lengths = [int(np.argmin(run)) for run in runs]
        start, length = int(starts[np.argmax(lengths)]), int(np.max(lengths))
        index = np.arange(start - 1, start + length + 1) % len(self.foot)
        path, above = self.foot[index].copy(), above[index]
        for outside, inside in ((0, 1), (-1, -2)):  # the samples beyond move to the crossing
            part = above[inside] / (above[inside] - above[outside])
            path[outside] = path[inside] + part * (path[outside] - path[inside])
        return path

    @property
    def stride(self) -> float:
        """How far the body moves while one foot carries it [m]; twice that in a crank turn."""
        return float(np.ptp(self.support[:, 0]))

    @property
    def flatness(self) -> float:
        """Root mean square of the carrying foot's height about its mean [m]; 0 is flat."""
        return float(np.std(self.support[:, 2]))

    @property
    def body_path(self) -> FloatArray:
        """Path of the body over one step of a two-leg unit (k, 2) [m]: x from the start, z.

        From r_GD = r_D - r_G, equation (18), where the paper misprints r_D - 2 r_G. The carrying
        foot does not slip; the body's point is the origin of the leg frame, z its height.
        """
        path = self.support
        return np.stack([path[0, 0] - path[:, 0], -path[:, 2]], axis=-1)

    @property
    def body_fluctuation(self) -> float:
        """How much the body of a two-leg unit rises and falls [m]."""
        return float(np.ptp(self.support[:, 2]))

    def deviation(self, other: GaitCurve) -> FloatArray:
        """Return the distance between the feet of two legs at equal crank angles (m,) [m].

        Raises:
            ValueRangeError: If the curves are sampled at different crank angles.
        """
        if self.crank_angles.shape != other.crank_angles.shape or not np.allclose(
            self.crank_angles, other.crank_angles
        ):
            raise ValueRangeError("the two curves must be sampled at the same crank angles")
        distance: FloatArray = np.linalg.norm(self.foot - other.foot, axis=-1)
        return distance


def gait_curve(mechanism: Mechanism, samples: int = SAMPLES, assembly_mode: str = "") -> GaitCurve:
    """Return the foot curve of a leg over one turn of its only actuator.

    Args:
        mechanism: A leg with one revolute actuator.
        samples: Number of crank angles, even and at least 4.
        assembly_mode: One of the mechanism's assembly modes.

    Raises:
        NotSupportedError: If the mechanism has more than one actuator, or one that cannot turn all
            the way round.
        ValueRangeError: If `samples` is odd or too small.
    """
    if len(mechanism.joints) != 1 or mechanism.joints[0].type != "revolute":
        raise NotSupportedError(
            f"a gait curve needs a leg with one revolute actuator; {mechanism.name} has "
            f"{', '.join(joint.name for joint in mechanism.joints)}"
        )
    if samples < 4 or samples % 2:
        raise ValueRangeError(f"samples must be even and >= 4, got {samples}")
    angles = np.arange(samples) * (2.0 * np.pi / samples)
    foot = mechanism.forward(angles[:, None], assembly_mode).foot_position
    if not np.isfinite(foot).all():
        raise NotSupportedError(
            f"the crank of this {mechanism.name} cannot turn all the way round: the bars do not "
            f"close at {np.degrees(angles[np.isnan(foot[:, 1])][0]):.1f}°"
        )
    return GaitCurve(angles, foot)
