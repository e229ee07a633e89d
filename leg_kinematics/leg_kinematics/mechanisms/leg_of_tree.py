# SPDX-License-Identifier: Apache-2.0
"""The mechanism of a leg of a robot model: what is actuated, its ranges, its initial postures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import GeometryError
from leg_kinematics.mechanisms.model_leg import ModelLeg
from leg_kinematics.mechanisms.newton_leg import NewtonLeg
from leg_kinematics.mechanisms.serial_leg import SerialLeg
from leg_kinematics.model import three_revolute
from leg_kinematics.model.equations import Equations, evaluate, new_room
from leg_kinematics.model.leg_tree import WHOLE_TURN
from leg_kinematics.model.postures import assembled, independent_rows

ISOTROPIC = 0.05  # ratio of singular values of J below which a posture is near a singularity
BENDS = 5  # trial positions of each joint, where the zero posture is singular
WIDEST_BEND = 1.5  # rad, of these


def leg_of_tree(
    tree: LegTree,
    actuated: Sequence[str] = (),
    assembly: Mapping[str, Mapping[str, float]] | None = None,
) -> ModelLeg:
    """Return the mechanism of a leg of a robot model.

    Args:
        tree: The leg.
        actuated: Names of the actuated joints; none for those with an effort limit, and all of a
            chain without loops.
        assembly: Positions of joints in the initial posture of each assembly mode, by the modes'
            names; what is not told is as in the first mode, zero there, or the middle of the range
            if that leaves zero out. Where zero is singular and nothing is told, the best
            conditioned of a grid of postures.

    Raises:
        GeometryError: If the loops do not close, there are more or fewer actuators than freedoms,
            or the initial posture is singular.
    """
    names = [joint.name for joint in tree.joints]
    unknown = [name for name in (*actuated, *_told(assembly)) if name not in names]
    if unknown:
        raise GeometryError(
            f"no joint {', '.join(map(repr, unknown))} in the leg; its joints: {', '.join(names)}"
        )
    driven = tuple(actuated) or _driven(tree)
    postures = _postures(tree, driven, assembly or {})
    initial = np.array(postures[0][1])
    rows = independent_rows(tree, initial)
    freedoms = len(names) - len(rows)
    if len(driven) != freedoms:
        raise GeometryError(
            f"the leg has {freedoms} freedom(s) and {len(driven)} actuated joint(s)"
            f" ({', '.join(driven)}); name {freedoms} of: {', '.join(names)}"
        )
    passive = [k for k, name in enumerate(names) if name not in driven]
    limits = {joint.name: joint.limits for joint in tree.joints}
    kind = SerialLeg if three_revolute.three_revolute_numbers(tree) is not None else NewtonLeg
    order = [names.index(name) for name in driven]
    leg = kind(
        tree,
        driven if kind is NewtonLeg else tuple(names),
        postures,
        tuple(
            _range(tree, k, limits[names[k]]) for k in (order if kind is NewtonLeg else range(3))
        ),
        tuple(_excursion(tree, k, initial[k]) for k in passive),
    )
    leg.initial_posture  # noqa: B018  raises GeometryError
    return leg


def _told(assembly: Mapping[str, Mapping[str, float]] | None) -> list[str]:
    return [name for posture in (assembly or {}).values() for name in posture]


def _driven(tree: LegTree) -> tuple[str, ...]:
    if not tree.coincidences:
        return tuple(joint.name for joint in tree.joints)
    return tuple(joint.name for joint in tree.joints if joint.effort is not None)


def _range(tree: LegTree, k: int, limits: tuple[float, float]) -> tuple[float, float]:
    """Return the range of an actuated joint; one turn where nothing bounds it."""
    if tree.joints[k].type == "revolute":
        lower, upper = limits
        return (lower, upper) if np.isfinite(limits).all() else (-math.pi, math.pi)
    if not np.isfinite(limits).all():
        raise GeometryError(f"joint {tree.joints[k].name!r} slides without limits: give some")
    return limits


def _excursion(tree: LegTree, k: int, initial: float) -> tuple[float, float]:
    """Return the range of a passive joint's excursion from the initial posture."""
    lower, upper = tree.joints[k].limits
    if tree.joints[k].type == "revolute" and not upper - lower < WHOLE_TURN:
        return -math.pi, math.pi
    return lower - initial, upper - initial


def _postures(
    tree: LegTree, driven: Sequence[str], assembly: Mapping[str, Mapping[str, float]]
) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Return the initial posture of each mode, the loops closed."""
    names = [joint.name for joint in tree.joints]
    rest = np.array([_middle(joint.limits) for joint in tree.joints])
    if not assembly:
        closed = assembled(tree, rest, [names.index(name) for name in driven])
        if not tree.coincidences:
            closed = _bent(tree, closed)
        return (("initial", tuple(closed.tolist())),)
    found: list[tuple[str, tuple[float, ...]]] = []
    for mode, told in assembly.items():
        guess = rest.copy()
        for name, value in told.items():
            guess[names.index(name)] = value
        held = [names.index(name) for name in driven if name in told or not found]
        rest = assembled(tree, guess, held)
        found.append((mode, tuple(rest.tolist())))
        rest = np.array(found[0][1])
    return tuple(found)


def _middle(limits: tuple[float, float]) -> float:
    lower, upper = limits
    return 0.0 if lower <= 0.0 <= upper else 0.5 * (lower + upper)


def _bent(tree: LegTree, rest: FloatArray) -> FloatArray:
    """Return a posture of an open chain that is not singular, the given one if it is not.

    Of a grid of postures it is the one with the best of condition and depth of the foot.
    """
    n = len(rest)
    every = np.arange(n, dtype=np.float64)
    none = every[:0]
    signs = np.zeros(3), np.zeros(2)
    equations = Equations(tree.chain, tree.loops, tree.foot, none, every, none, rest, *signs)
    room = new_room(n, 0, n)

    def condition_and_depth(q: FloatArray) -> tuple[float, float]:
        foot, _, _ = evaluate(equations, q, room)
        values = np.linalg.svd(room.twist[:3], compute_uv=False)
        return values[min(n, 3) - 1] / values[0], -foot[2]

    if condition_and_depth(rest)[0] > ISOTROPIC:
        return rest
    axes = []
    for joint in tree.joints:
        lower, upper = joint.limits
        if joint.type == "revolute":
            lower, upper = max(lower, -WIDEST_BEND), min(upper, WIDEST_BEND)
        if not (lower <= upper and np.isfinite([lower, upper]).all()):
            lower = upper = _middle(joint.limits)
        axes.append(np.linspace(lower, upper, BENDS if n <= 3 else 2))
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, n)
    found = np.array([condition_and_depth(q) for q in grid])
    score = found[:, 0] * np.maximum(found[:, 1], 0.0)
    chosen: FloatArray = grid[int(np.argmax(np.round(score, 6)))]
    return chosen
