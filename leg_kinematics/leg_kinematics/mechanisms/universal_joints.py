# SPDX-License-Identifier: Apache-2.0
"""A shaft that two universal joints and a sliding sleeve couple to a tilting platform.

This is the auxiliary RUPUR chain F F1 F2 F3 F' of paper 004. The input shaft turns by theta about
the normal Z' of the fixed platform, the output shaft by gamma about the normal Z'' of the moving
one; between them runs the middle shaft from F = (0, ee, 0) to F' = (x, ee' cos beta,
z + ee' sin beta), along the unit vector m. The platform is tilted by beta about X.

The pins of the two forks of the middle shaft are parallel. The pin of the input fork is
p = (-sin theta, cos theta, 0); each joint's second pin is perpendicular to its first and to its
shaft, so the pin of the output fork is along (m x p) x Z'' = p (m . Z'') - m (p . Z''), and with
the lengths, that is times |F F'|,

    tan gamma = (P sin theta - Q cos theta) / (R cos theta)
    P = z cos beta + ee sin beta = |F F'| cos phi_2
    Q = x sin beta
    R = z + ee' sin beta = |F F'| cos phi_1

Equation (27) of the paper has no Q: it is exact for x = 0 or beta = 0 only. The printed cos phi_2
has ee' where ee belongs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array, as_matching
from leg_kinematics.kernels.kernel import kernel, scalar
from leg_kinematics.kernels.points_kernel import points_kernel
from leg_kinematics.kernels.scalars import wrapped


class OutputMotion(NamedTuple):
    """Motion of the output shaft; NaN where a joint would bend by 90° or more.

    Attributes:
        angle: gamma about Z'' (...) [rad]; it follows the input over whole turns.
        velocity: gamma' (...) [rad/s].
        acceleration: gamma'' (...) [rad/s²].
        angular_velocity: Of the shaft in the leg frame, with the platform's (..., 3) [rad/s].
        angular_acceleration: Of the shaft in the leg frame (..., 3) [rad/s²].
    """

    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    angular_velocity: FloatArray
    angular_acceleration: FloatArray


# --------------------------------------------------------------------------- scalar mathematics


class Jet(NamedTuple):
    """A quantity and its first and second derivative by time."""

    value: float
    rate: float
    acceleration: float


@scalar
def scaled(u: Jet, factor: float) -> Jet:
    """Return u times a constant."""
    return Jet(factor * u.value, factor * u.rate, factor * u.acceleration)


@scalar
def turned(u: Jet, v: Jet, angle: Jet) -> Jet:
    """Return u sin(angle) + v cos(angle)."""
    sine, cosine = math.sin(angle.value), math.cos(angle.value)
    u_rate = u.rate - v.value * angle.rate
    v_rate = v.rate + u.value * angle.rate
    u_acceleration = (
        u.acceleration
        - 2.0 * v.rate * angle.rate
        - v.value * angle.acceleration
        - u.value * angle.rate**2
    )
    v_acceleration = (
        v.acceleration
        + 2.0 * u.rate * angle.rate
        + u.value * angle.acceleration
        - v.value * angle.rate**2
    )
    return Jet(
        u.value * sine + v.value * cosine,
        u_rate * sine + v_rate * cosine,
        u_acceleration * sine + v_acceleration * cosine,
    )


@scalar
def direction(y: Jet, x: Jet) -> Jet:
    """Return the angle atan2(y, x)."""
    squared = x.value**2 + y.value**2
    rate = (y.rate * x.value - x.rate * y.value) / squared
    bend = y.acceleration * x.value - x.acceleration * y.value
    stretch = 2.0 * (x.value * x.rate + y.value * y.rate)
    return Jet(math.atan2(y.value, x.value), rate, (bend - rate * stretch) / squared)


@scalar
def shaft(ee: float, ee_prime: float, x: Jet, z: Jet, beta: Jet) -> tuple[Jet, Jet, Jet]:
    """Return P, Q, R [m]; for z < 0, with the shafts pointing down, all with the other sign."""
    zero = Jet(0.0, 0.0, 0.0)
    p = turned(Jet(ee, 0.0, 0.0), z, beta)
    q = turned(x, zero, beta)
    rise = turned(Jet(ee_prime, 0.0, 0.0), zero, beta)
    r = Jet(z.value + rise.value, z.rate + rise.rate, z.acceleration + rise.acceleration)
    side = math.copysign(1.0, z.value)
    return scaled(p, side), scaled(q, side), scaled(r, side)


@scalar
def output(p: Jet, q: Jet, r: Jet, theta: Jet) -> Jet:
    """Return gamma of the input angle theta; NaN where a joint would bend by 90° or more."""
    if not (p.value > 0.0 and r.value > 0.0):
        return Jet(math.nan, math.nan, math.nan)
    gamma = direction(turned(p, scaled(q, -1.0), theta), turned(Jet(0.0, 0.0, 0.0), r, theta))
    angle = theta.value + wrapped(gamma.value - theta.value)
    return Jet(angle, gamma.rate, gamma.acceleration)


@scalar
def shaft_state(
    ee: float, ee_prime: float, x: float, z: float, beta: float
) -> tuple[float, float, float]:
    """Return the bends phi_1, phi_2 of the two joints and the length F F'."""
    cb, sb = math.cos(beta), math.sin(beta)
    rise = z + ee_prime * sb
    side = math.copysign(1.0, z)
    forward = ee_prime * cb - ee
    phi_1 = math.atan2(math.hypot(x, forward), side * rise)
    phi_2 = math.atan2(math.hypot(x, ee_prime - ee * cb + z * sb), side * (z * cb + ee * sb))
    return phi_1, phi_2, math.hypot(math.hypot(x, forward), rise)


# --------------------------------------------------------------------------- kernels


@scalar
def put_motion(gamma: Jet, beta: Jet, motion: FloatArray) -> None:
    """Fill gamma, gamma', gamma'' and the output shaft's angular velocity and acceleration."""
    cb, sb = math.cos(beta.value), math.sin(beta.value)
    motion[0], motion[1], motion[2] = gamma.value, gamma.rate, gamma.acceleration
    motion[3], motion[4], motion[5] = beta.rate, -gamma.rate * sb, gamma.rate * cb
    motion[6] = beta.acceleration
    motion[7] = -gamma.acceleration * sb - gamma.rate * beta.rate * cb
    motion[8] = gamma.acceleration * cb - gamma.rate * beta.rate * sb


MOTION_SIZE = 9


@kernel(
    "(g),(t),(t),(t),(j),(m)->(m)",
    "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _exact(offsets, position, velocity, acceleration, drive, shape, motion):  # type: ignore[no-untyped-def]
    """Output motion by the vector model; `drive` is theta, theta', theta''."""
    x = Jet(position[0], velocity[0], acceleration[0])
    z = Jet(position[2], velocity[2], acceleration[2])
    beta = Jet(position[3], velocity[3], acceleration[3])
    p, q, r = shaft(offsets[0], offsets[1], x, z, beta)
    put_motion(output(p, q, r, Jet(drive[0], drive[1], drive[2])), beta, motion)


@kernel(
    "(g),(t),(t),(t),(j),(m)->(m)",
    "f8[:], f8[:], f8[:], f8[:], f8[:], f8[:], f8[:]",
)
def _approximate(offsets, position, velocity, acceleration, drive, shape, motion):  # type: ignore[no-untyped-def]
    """Output motion by (27), which is without Q; `drive` is theta, theta', theta''."""
    x = Jet(position[0], velocity[0], acceleration[0])
    z = Jet(position[2], velocity[2], acceleration[2])
    beta = Jet(position[3], velocity[3], acceleration[3])
    p, _, r = shaft(offsets[0], offsets[1], x, z, beta)
    none = Jet(0.0, 0.0, 0.0)
    put_motion(output(p, none, r, Jet(drive[0], drive[1], drive[2])), beta, motion)


@points_kernel("(2),(points,4)->(points,3)", "f8 f8 f8")
def _state(offsets, position, state):  # type: ignore[no-untyped-def]
    """Bends and length of the middle shaft."""
    for i in range(len(position)):
        x, z, beta = position[i, 0], position[i, 2], position[i, 3]
        state[i, 0], state[i, 1], state[i, 2] = shaft_state(offsets[0], offsets[1], x, z, beta)


# --------------------------------------------------------------------------- chain


@dataclass(frozen=True)
class AuxiliaryChain:
    """The RUPUR chain between the fixed and the moving platform.

    Positions are those of the moving platform: x, y, z, beta (..., 4) [m, m, m, rad].

    Attributes:
        base_offset: Y of the input joint F on the fixed platform, ee [m].
        platform_offset: Y'' of the output joint F' on the moving platform, ee' [m].
    """

    base_offset: float
    platform_offset: float

    @cached_property
    def _offsets(self) -> FloatArray:
        return np.array([self.base_offset, self.platform_offset])

    def bends(self, position: ArrayLike) -> FloatArray:
        """Bends phi_1, phi_2 of the universal joints at F and F' (..., 2) [rad]."""
        return self._state(position)[..., :2]

    def length(self, position: ArrayLike) -> FloatArray:
        """Length F F' of the middle shaft (...,) [m]."""
        return self._state(position)[..., 2]

    def _state(self, position: ArrayLike) -> FloatArray:
        state: FloatArray = _state(self._offsets, as_array("position", position, 4))
        return state

    def output_angle(self, position: ArrayLike, input_angle: ArrayLike) -> FloatArray:
        """Output angle gamma (...,) [rad] of input angles theta (...,) [rad]."""
        still = np.zeros(4)
        return self.output_motion(position, still, still, input_angle, 0.0, 0.0).angle

    def approximate_output_angle(self, position: ArrayLike, input_angle: ArrayLike) -> FloatArray:
        """Output angle by the paper's equation (27) (...,) [rad]."""
        still = np.zeros(4)
        return self.approximate_output_motion(position, still, still, input_angle, 0.0, 0.0).angle

    def output_motion(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        input_angle: ArrayLike,
        input_velocity: ArrayLike,
        input_acceleration: ArrayLike,
    ) -> OutputMotion:
        """Motion of the output shaft.

        Args:
            position: Platform x, y, z, beta (..., 4) [m, rad].
            velocity: Their rates (..., 4) [m/s, rad/s].
            acceleration: Their second derivatives (..., 4) [m/s², rad/s²].
            input_angle: theta (...) [rad].
            input_velocity: theta' (...) [rad/s].
            input_acceleration: theta'' (...) [rad/s²].
        """
        platform = _platform(position, velocity, acceleration)
        drive = _drive(platform[0].shape[:-1], input_angle, input_velocity, input_acceleration)
        return _motion(_exact(self._offsets, *platform, drive, np.zeros(MOTION_SIZE)))

    def approximate_output_motion(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        input_angle: ArrayLike,
        input_velocity: ArrayLike,
        input_acceleration: ArrayLike,
    ) -> OutputMotion:
        """Motion of the output shaft by (27) and its derivatives; see `output_motion`."""
        platform = _platform(position, velocity, acceleration)
        drive = _drive(platform[0].shape[:-1], input_angle, input_velocity, input_acceleration)
        return _motion(_approximate(self._offsets, *platform, drive, np.zeros(MOTION_SIZE)))


def _platform(
    position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the platform's motion, checked and broadcast."""
    r = as_array("position", position, 4)
    v = as_matching("velocity", velocity, (4,), r.shape[:-1])
    batch = np.broadcast_shapes(r.shape[:-1], v.shape[:-1])
    a = as_matching("acceleration", acceleration, (4,), batch)
    r, v, a = np.broadcast_arrays(r, v, a)
    return r, v, a


def _drive(
    batch: tuple[int, ...], angle: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike
) -> FloatArray:
    """Return theta, theta', theta'' (..., 3), checked."""
    parts: list[FloatArray] = []
    named = {
        "input_angle": angle,
        "input_velocity": velocity,
        "input_acceleration": acceleration,
    }
    for name, value in named.items():
        parts.append(as_matching(name, value, (), batch))
        batch = np.broadcast_shapes(batch, parts[-1].shape)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def _motion(values: FloatArray) -> OutputMotion:
    return OutputMotion(
        values[..., 0], values[..., 1], values[..., 2], values[..., 3:6], values[..., 6:9]
    )
