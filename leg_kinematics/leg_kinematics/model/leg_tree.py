# SPDX-License-Identifier: Apache-2.0
"""One leg of a robot model, as little as its mathematics needs: moving joints, loops, foot, masses.

The leg frame has the axes of the base, and its origin in that of the first joint on the way to the
foot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from leg_kinematics.bodies import Coincidence, LegJoint, LegTree, Vector, as_vector
from leg_kinematics.errors import DescriptionError
from leg_kinematics.model.tree import Closure, ModelJoint, ModelTree

MOST_JOINTS = 40  # of a leg
WHOLE_TURN = 2.0 * math.pi - 1e-9  # rad, the least range of a joint that nothing bounds


class Foot(NamedTuple):
    """The point that stands on the ground.

    Attributes:
        link: Name of a link.
        position: The point in the link's frame [m].
    """

    link: str
    position: Vector = (0.0, 0.0, 0.0)


def leg_tree(tree: ModelTree, base: str, foot: Foot, held: Sequence[str] = ()) -> LegTree:
    """Return one leg of a robot: what moves between the base and the foot, and its loops.

    Joints of the leg are those on the way from base to foot and, if a loop has a link of it, on the
    way to the loop's ends. What else hangs on the leg's links is held at zero and only weighs.

    Args:
        tree: The robot.
        base: Name of the link that carries the leg.
        foot: The foot.
        held: Names of joints that are held at zero.

    Raises:
        DescriptionError: If there is no such leg; the message tells where, and what is allowed.
    """
    for name in (base, foot.link):
        tree.link(name)
    frames = tree.frames(base)
    if foot.link not in frames:
        raise DescriptionError(
            f"{tree.place}: link {foot.link!r} is not below {base!r}; below it are: "
            f"{', '.join(name for name in frames if name != base)}"
        )
    held_joints = set(held)
    chosen = _moving(tree, base, foot.link, held_joints)
    if not chosen:
        raise DescriptionError(f"{tree.place}: no joint moves {foot.link!r} against {base!r}")
    first = chosen[0]
    closures: list[Closure] = []
    grown = True
    while grown:  # loops bring joints, and these other loops
        grown = False
        bodies = {joint.child for joint in chosen}
        for closure in tree.closures:
            ends = [
                _moving(tree, base, end, held_joints) if end in frames else None
                for end in (closure.first, closure.second)
            ]
            touched = any(j.child in bodies for end in ends for j in end or ())
            if any(closure is known for known in closures) or not touched:
                continue
            if None in ends:
                raise DescriptionError(
                    f"{closure.place}: closes a loop with a link that is not below {base!r}"
                )
            closures.append(closure)
            for joint in (*(ends[0] or ()), *(ends[1] or ())):
                if joint not in chosen:
                    chosen.append(joint)
                    grown = True
            if grown:
                break
    order = [name for name in tree.below(base) if name != base]
    chosen.sort(key=lambda joint: (len(tree.path(joint.child)), order.index(joint.child)))
    if len(chosen) > MOST_JOINTS:
        raise DescriptionError(
            f"{tree.place}: {len(chosen)} joints move {foot.link!r}; allowed: {MOST_JOINTS}"
        )
    return _compact(tree, base, foot, chosen, closures, first)


def _moving(tree: ModelTree, base: str, link: str, held: set[str]) -> list[ModelJoint]:
    """Return the joints that move a link against the base."""
    above = {joint.child for joint in tree.path(base)}
    return [
        joint
        for joint in tree.path(link)
        if joint.child not in above and joint.type != "fixed" and joint.name not in held
    ]


def _compact(
    tree: ModelTree,
    base: str,
    foot: Foot,
    joints: Sequence[ModelJoint],
    closures: Sequence[Closure],
    first: ModelJoint,
) -> LegTree:
    frames = tree.frames(base)
    number = {joint.child: k + 1 for k, joint in enumerate(joints)}

    def body(link: str) -> int:
        while link != base and link not in number:
            link = tree.joints[link].parent
        return 0 if link == base else number[link]

    origin = frames[first.child][1]
    origins = [origin, *(frames[joint.child][1] for joint in joints)]

    def point(link: str, position: Any) -> Vector:
        """Return a point of a link from its body's origin, all joints at zero."""
        rotation, place = frames[link]
        return as_vector(place + rotation @ np.asarray(position) - origins[body(link)])

    masses = [
        [
            (link.mass, point(name, link.centre))
            for name, link in tree.links.items()
            if name in frames and body(name) == k + 1
        ]
        for k in range(len(joints))
    ]
    legs = []
    for k, joint in enumerate(joints):
        parent = body(joint.parent)
        mass, centre = _together(masses[k])
        legs.append(
            LegJoint(
                joint.name,
                "prismatic" if joint.type == "prismatic" else "revolute",
                parent,
                as_vector(frames[joint.child][0] @ joint.axis),
                as_vector(origins[k + 1] - origins[parent]),
                joint.limits,
                joint.effort,
                mass,
                centre,
            )
        )
    coincidences = tuple(
        Coincidence(body(c.first), point(c.first, one), body(c.second), point(c.second, other))
        for c in closures
        for one, other in zip(c.first_points, c.second_points, strict=True)
    )
    return LegTree(
        tuple(legs),
        coincidences,
        body(foot.link),
        point(foot.link, foot.position),
        as_vector(origin),
    )


def _together(parts: Sequence[tuple[float | None, Vector]]) -> tuple[float, Vector]:
    """Return mass and centre of links that are one body; NaN if no link of it has a mass."""
    known = [(mass, np.array(centre)) for mass, centre in parts if mass is not None]
    if not known:
        return math.nan, (0.0, 0.0, 0.0)
    mass = math.fsum(m for m, _ in known)
    moment = sum((m * centre for m, centre in known), np.zeros(3))
    return mass, as_vector(moment / mass) if mass > 0.0 else (0.0, 0.0, 0.0)


def with_numbers(
    leg: LegTree,
    joint_limits: dict[str, tuple[float, float]],
    effort_limits: dict[str, tuple[float, float]],
) -> LegTree:
    """Return a leg in which numbers of the file are replaced, by the names of joints."""
    return replace(
        leg,
        joints=tuple(
            joint._replace(
                limits=joint_limits.get(joint.name, joint.limits),
                effort=effort_limits.get(joint.name, joint.effort),
            )
            for joint in leg.joints
        ),
    )
