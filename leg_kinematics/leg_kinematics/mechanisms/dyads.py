# SPDX-License-Identifier: Apache-2.0
"""Planar linkages by dyads (Assur groups): position, velocity and acceleration, point after point.

A linkage of one crank is assembled as a textbook draws it. The crank's pin moves on a circle; two
bars that meet in a joint (an RRR dyad) hang each new joint on two points whose motion is known; a
rigid triangle carries a further point of a bar. `M` turns a vector by +90°:

    pin       = center + length u(angle)
    joint     = p + along (q - p) + across M (q - p)        bars p-joint and q-joint, two solutions
    triangle  = p + along (q - p) + across M (q - p)        with constant coefficients

This is the form of equations (2)-(4) of paper 003; `along` and `across` are its q1 ... q6.
Everything is a function of one point for use inside kernels, without branches, so that a kernel
assembles several linkages with one instruction; taken in where it is used, so that a kernel that
wants positions only computes no velocities and accelerations. A dyad that does not close gives NaN.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from leg_kinematics.kernels.kernel import inlined

# A dyad stretched or folded to within rounding is closed; its joint is then on the line p-q.
CLOSED = 1e-13


class Point(NamedTuple):
    """Position, velocity and acceleration of a point of the plane."""

    x: float
    y: float
    vx: float
    vy: float
    ax: float
    ay: float


@inlined
def fixed(x: float, y: float) -> Point:
    """Return a point of the frame."""
    return Point(x, y, 0.0, 0.0, 0.0, 0.0)


@inlined
def crank_pin(
    center: Point, length: float, angle: float, rate: float, acceleration: float
) -> Point:
    """Return the pin of a crank that turns about a fixed point."""
    x, y = length * math.cos(angle), length * math.sin(angle)
    return Point(
        center.x + x,
        center.y + y,
        -y * rate,
        x * rate,
        -x * rate * rate - y * acceleration,
        -y * rate * rate + x * acceleration,
    )


@inlined
def dyad_coefficients(
    p: Point, q: Point, first: float, second: float, side: float
) -> tuple[float, float]:
    """Return `along` and `across` of the joint of two bars p-joint and q-joint.

    Args:
        p: End of the first bar.
        q: End of the second bar.
        first: Length of the bar p-joint.
        second: Length of the bar q-joint.
        side: +1 if the joint lies to the left of the line from p to q, -1 to the right.
    """
    dx, dy = q.x - p.x, q.y - p.y
    inverse = 1.0 / (dx * dx + dy * dy)
    reach = first * first * inverse
    along = 0.5 * (1.0 + reach - second * second * inverse)
    square = reach - along * along
    closed = (-CLOSED * (1.0 + reach) < square) & (square < 0.0)
    return along, side * math.sqrt(0.0 if closed else square)


@inlined
def dyad(p: Point, q: Point, along: float, across: float) -> Point:
    """Return the joint of two bars of constant lengths, given its coefficients.

    With the bars u = joint - p and w = joint - q, constant lengths mean u·u' = w·w' = 0 and
    u·u'' = -u'·u', w·w'' = -w'·w': two linear equations for the joint's velocity and two for its
    acceleration.
    """
    dx, dy = q.x - p.x, q.y - p.y
    x = p.x + along * dx - across * dy
    y = p.y + along * dy + across * dx
    ux, uy, wx, wy = x - p.x, y - p.y, x - q.x, y - q.y
    determinant = ux * wy - uy * wx

    s, t = ux * p.vx + uy * p.vy, wx * q.vx + wy * q.vy
    vx, vy = (s * wy - t * uy) / determinant, (t * ux - s * wx) / determinant
    s = ux * p.ax + uy * p.ay - (vx - p.vx) ** 2 - (vy - p.vy) ** 2
    t = wx * q.ax + wy * q.ay - (vx - q.vx) ** 2 - (vy - q.vy) ** 2
    ax, ay = (s * wy - t * uy) / determinant, (t * ux - s * wx) / determinant
    return Point(x, y, vx, vy, ax, ay)


@inlined
def transmission(p: Point, q: Point, across: float, first: float, second: float) -> float:
    """Return |sin| of the angle between the two bars of a dyad: 0 at its dead point."""
    squared = (q.x - p.x) ** 2 + (q.y - p.y) ** 2
    return abs(across) * squared / (first * second)


@inlined
def triangle_coefficients(
    base: float, first: float, second: float, side: float
) -> tuple[float, float]:
    """Return the constant `along` and `across` of the tip of a rigid triangle on the base p-q.

    Args:
        base: Length p-q.
        first: Length p-tip.
        second: Length q-tip.
        side: +1 if the tip lies to the left of the line from p to q, -1 to the right.
    """
    reach = first * first / (base * base)
    along = 0.5 * (1.0 + reach - second * second / (base * base))
    return along, side * math.sqrt(max(0.0, reach - along * along))


@inlined
def rigid_point(p: Point, q: Point, along: float, across: float) -> Point:
    """Return the point of the body through p and q that has constant coefficients."""
    return Point(
        p.x + along * (q.x - p.x) - across * (q.y - p.y),
        p.y + along * (q.y - p.y) + across * (q.x - p.x),
        p.vx + along * (q.vx - p.vx) - across * (q.vy - p.vy),
        p.vy + along * (q.vy - p.vy) + across * (q.vx - p.vx),
        p.ax + along * (q.ax - p.ax) - across * (q.ay - p.ay),
        p.ay + along * (q.ay - p.ay) + across * (q.ax - p.ax),
    )


@inlined
def turning_rate(p: Point, q: Point) -> float:
    """Return the angular velocity of the body through p and q, counter-clockwise."""
    dx, dy = q.x - p.x, q.y - p.y
    return (dx * (q.vy - p.vy) - dy * (q.vx - p.vx)) / (dx * dx + dy * dy)
