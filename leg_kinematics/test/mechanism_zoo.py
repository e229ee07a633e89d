# SPDX-License-Identifier: Apache-2.0
"""The mechanisms that tests of the protocol are made with: defaults, mirror images, variations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from model_legs import MODEL_LEGS

from leg_kinematics import MECHANISMS, GeometryError, Mirrored, Posture, Status
from leg_kinematics.geometry import geometry_parameters

PLAIN = {name: kind() for name, kind in MECHANISMS.items()} | MODEL_LEGS
MIRRORED = {f"{n} mirrored": Mirrored(m) for n, m in PLAIN.items() if m.has_point_foot}
ALL = PLAIN | MIRRORED


def without_limits(mechanism):
    """Return a mechanism whose actuators may stand anywhere; limits are of the default mode."""
    if isinstance(mechanism, Mirrored):
        return Mirrored(without_limits(mechanism.original))
    wide = {"angle": (-math.pi, math.pi), "length": (-2.0, 2.0)}
    return replace(
        mechanism,
        joint_ranges=tuple(wide[joint.dimension] for joint in mechanism.joints),
        passive_joint_ranges=tuple(wide[e.dimension] for e in mechanism.excursions),
    )


def varied(kind, count, seed=1, spread=0.25):
    """Return so many mechanisms of a kind with other dimensions that can be assembled."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        dimensions = {}
        for f in geometry_parameters(kind):
            change = rng.uniform(-spread, spread)
            scale = f.default if f.metadata["positive"] else 0.2  # [m] of offsets, [rad] of angles
            dimensions[f.name] = f.default + change * scale
        try:
            found.append(kind(**dimensions))
        except GeometryError:
            continue
    return found


def random_joints(mechanism, count, seed=2, beyond=0.0):
    """Return joint positions (count, n) in the ranges, or beyond by a part of their widths."""
    lower, upper = np.clip(mechanism.joint_limits, -math.pi, math.pi).T
    wider = beyond * (upper - lower)
    rng = np.random.default_rng(seed)
    return rng.uniform(lower - wider, upper + wider, (count, len(lower)))


def chosen(posture, mask):
    """Return some of the postures of a batch."""
    return Posture(*(field[mask] for field in posture))


def ok_postures(mechanism, count, seed=2):
    """Return postures with status OK at random joint positions, at most `count`."""
    posture = mechanism.forward(random_joints(mechanism, 20 * count, seed))
    return chosen(posture, np.flatnonzero(posture.status == Status.OK)[:count])


def joint_distance(mechanism, first, second):
    """Return the largest difference of joint positions (...), for an angle but for whole turns."""
    difference = np.asarray(first) - second
    turning = [joint.type == "revolute" for joint in mechanism.joints]
    whole = 2.0 * math.pi * np.round(difference / (2.0 * math.pi))
    return np.abs(np.where(turning, difference - whole, difference)).max(axis=-1, initial=0.0)
