# SPDX-License-Identifier: Apache-2.0
"""Outcome of one point of a batched computation."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of one point; the values equal those of `leg_msgs/PointStatus`.

    Attributes:
        OK: The answer is valid.
        UNREACHABLE: The loop equations have no real solution; the answer is NaN.
        JOINT_LIMIT: Solved, but an actuated joint is outside its range.
        PASSIVE_JOINT_LIMIT: Solved, but a passive joint is outside its range.
        SINGULAR: Solved, but at or beyond a singularity: the leg cannot get there from its
            initial pose without passing a pose in which the actuators lose control of the foot.
        INVALID_INPUT: The input of this point is not finite; the answer is NaN.
    """

    OK = 0
    UNREACHABLE = 1
    JOINT_LIMIT = 2
    PASSIVE_JOINT_LIMIT = 3
    SINGULAR = 4
    INVALID_INPUT = 5
