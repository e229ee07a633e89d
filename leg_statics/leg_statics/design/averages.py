# SPDX-License-Identifier: Apache-2.0
"""Averages over the workspace, refined until their error is as small as asked.

The integrands are smooth, but the poses that a leg can take end abruptly inside of the actuator
box, at passive joint limits and singularities: the error of a grid shows only on a much finer one.
So the box is sampled by a few independently scrambled Sobol' sequences instead. Each converges as
fast as the best grid would, all points count when the sample is doubled, and how far the sequences
differ from each other tells how far their mean may be off.

The points are the same for every mechanism and every call: the same question has the same answer,
and two designs are compared more closely than either is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.mechanism import Mechanism, Posture
from leg_kinematics.status import Status
from leg_statics.workspace import volume_factor

SEQUENCES = 8  # fewer tell the error badly, with more each of them is coarser
FIRST_LENGTH = 64  # points of each sequence to start with
CONFIDENCE = 0.95
FEWEST_POINTS = SEQUENCES * FIRST_LENGTH
MOST_POINTS = 2**15  # by default


class Averages(NamedTuple):
    """Averages of K functions over the workspace, by its volume.

    Each error is the relative half-width of a 95 % confidence interval; NaN if it is not known.

    Attributes:
        values: The averages (K,); NaN if no pose is OK, infinite if a function is so
            at one of the poses.
        errors: Their errors (K,).
        volume: Volume of the workspace in the units of the task coordinates, [m³] for a point foot;
            its area or length if there are only two actuators or one.
        volume_error: Error of the volume.
        usable: Share of the actuator box whose poses are OK.
        usable_error: Error of that share.
        points: Number of poses that were evaluated.
    """

    values: FloatArray
    errors: FloatArray
    volume: float
    volume_error: float
    usable: float
    usable_error: float
    points: int

    @property
    def error(self) -> float:
        """The largest of the errors; infinite if one is not known."""
        errors = np.array([*self.errors, self.volume_error, self.usable_error])
        return float(np.max(np.where(np.isnan(errors), np.inf, errors)))


def average(
    mechanism: Mechanism,
    functions: Callable[[Posture], FloatArray],
    tolerance: float = 0.005,
    most_points: int = MOST_POINTS,
    seed: int = 0,
) -> Averages:
    """Average functions of the posture over the workspace.

    With dW = |det J| dq an average over the foot's workspace W, such as (4), (29) and (32) of paper
    000, becomes one over the actuator box; of a workspace that is a surface or a curve,
    dW = sqrt(det JᵀJ) dq.

    Args:
        mechanism: The leg's mechanism, with no more actuators than task coordinates.
        functions: Values (..., K) of postures (...,); only those of OK postures count.
        tolerance: Error of the averages, the volume and the usable share to stop at.
        most_points: Poses to evaluate at most. The search ends earlier if it is plain that they
            will not do, as for a function whose integral does not exist.
        seed: Which scrambling of the sequences to take.

    Returns:
        The averages; `error` tells whether the tolerance was reached.

    Raises:
        ValueRangeError: If most_points does not allow the first sample.
    """
    if most_points < FEWEST_POINTS:
        raise ValueRangeError(f"most_points must be >= {FEWEST_POINTS}, got {most_points}")
    longest = most_points // SEQUENCES
    lower, upper = mechanism.joint_limits.T
    points = _sequences(len(lower), longest, seed)
    box = float(np.prod(upper - lower))
    sums: FloatArray = np.zeros(())
    start, end = 0, FIRST_LENGTH
    while True:
        posture = mechanism.forward(lower + points[:, start:end] * (upper - lower))
        sums = sums + _sums(mechanism, functions, posture)
        result = _averages(sums / end, box, SEQUENCES * end)
        hopeless = _is_hopeless(result, tolerance, most_points, len(lower))
        if result.error <= tolerance or hopeless or 2 * end > longest:
            return result
        start, end = end, 2 * end


def heights_by_volume(mechanism: Mechanism, count: int) -> FloatArray:
    """Heights of the foot in the middle of equal shares of the workspace's volume (count,) [m].

    There are none if no pose is OK.
    """
    lower, upper = mechanism.joint_limits.T
    points = _sequences(len(lower), FIRST_LENGTH, 0).reshape(-1, len(lower))
    posture = mechanism.forward(lower + points * (upper - lower))
    ok = np.asarray(posture.status) == Status.OK
    z = posture.foot_position[ok, 2]
    if not len(z):
        return np.empty(0)
    order = np.argsort(z)
    volume = np.cumsum(volume_factor(mechanism.jacobian(posture))[ok][order])
    share = (np.arange(count) + 0.5) / count
    return np.interp(share, volume / volume[-1], z[order])


def _is_hopeless(result: Averages, tolerance: float, most_points: int, joints: int) -> bool:
    """Tell whether all further points would not reach the tolerance.

    Where a smooth function ends abruptly the error falls as points^-(1/2 + 1/(2 joints)), slower if
    it is not bounded. There is no hope without any OK pose or if a function is infinite; an error
    that is not known yet, because one of the sequences has no OK pose, leaves hope.
    """
    if result.usable == 0.0 or not np.isfinite(result.values).all():
        return True
    gain = (most_points / result.points) ** (0.5 + 0.5 / joints)
    return bool(np.isfinite(result.error) and result.error > gain * tolerance)


def _sums(
    mechanism: Mechanism, functions: Callable[[Posture], FloatArray], posture: Posture
) -> FloatArray:
    """Sum 1, dW/dq and dW/dq times each function over the OK poses of each sequence (s, 2 + K)."""
    ok = np.asarray(posture.status) == Status.OK
    volume = volume_factor(mechanism.jacobian(posture))[..., None]
    terms = np.concatenate([np.ones_like(volume), volume, volume * functions(posture)], axis=-1)
    total: FloatArray = np.sum(terms, axis=1, where=ok[..., None])
    return total


def _averages(means: FloatArray, box: float, points: int) -> Averages:
    """Return the averages from the means over the actuator box, one row a sequence."""
    overall = means.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        samples = means.copy()
        samples[:, 2:] /= means[:, 1:2]
        values = overall[2:] / overall[1]
        errors = _errors(samples, np.concatenate([overall[:2], values]))
    usable_error, volume_error = errors[:2].tolist()
    return Averages(
        values,
        errors[2:],
        float(overall[1]) * box,
        volume_error,
        float(overall[0]),
        usable_error,
        points,
    )


def _errors(samples: FloatArray, values: FloatArray) -> FloatArray:
    """Relative half-width of the confidence interval of values, the means of samples (s, m)."""
    spread = np.std(samples, axis=0, ddof=1)
    quantile = stdtrit(SEQUENCES - 1, 0.5 + 0.5 * CONFIDENCE)  # of Student's t
    width = quantile * spread / np.sqrt(SEQUENCES)
    return np.where(width == 0.0, 0.0, width / np.abs(values))


@lru_cache(maxsize=8)
def _sequences(dimensions: int, length: int, seed: int) -> FloatArray:
    """Independently scrambled Sobol' points of the unit box (SEQUENCES, length, dimensions)."""
    from scipy.stats import qmc  # slow to import

    seeds = np.random.SeedSequence(seed).spawn(SEQUENCES)
    power = math.ceil(math.log2(length))
    return np.stack(
        [qmc.Sobol(dimensions, seed=np.random.default_rng(s)).random_base2(power) for s in seeds]
    )
