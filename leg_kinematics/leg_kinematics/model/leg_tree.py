# SPDX-License-Identifier: Apache-2.0
"""One leg of a robot model, as little as its mathematics needs: moving joints, loops, foot, masses.

Bodies are numbered: 0 is the base, k + 1 is what joint k moves. With all joints at zero every
body's frame has the axes of the base, and its origin is on its joint. A posture is therefore found
without any constant rotation:

    R_(k+1) = R_parent Rot(axis_k, q_k)       p_(k+1) = p_parent + R_parent offset_k      (revolute)
    R_(k+1) = R_parent     p_(k+1) = p_parent + R_parent (offset_k + axis_k q_k)         (prismatic)

The leg frame has the axes of the base, and its origin in that of the first joint on the way to the
foot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError
from leg_kinematics.model.tree import Closure, ModelJoint, ModelTree

Vector = tuple[float, float, float]
MOST_JOINTS = 40  # of a leg
BASE = 0  # the body that does not move
WHOLE_TURN = 2.0 * math.pi - 1e-9  # rad, the least range of a joint that nothing bounds
STRAIGHT = 1e-12  # components of axes and offsets below that are rounding


class Foot(NamedTuple):
    """The point that stands on the ground.

    Attributes:
        link: Name of a link.
        position: The point in the link's frame [m].
    """

    link: str
    position: Vector = (0.0, 0.0, 0.0)


class LegJoint(NamedTuple):
    """A joint of a leg and the body it moves.

    Attributes:
        name: Name of the joint.
        type: "revolute" or "prismatic".
        parent: Number of the body it stands on.
        axis: Unit vector, all joints at zero.
        offset: From the parent's origin to the joint, all joints at zero [m].
        limits: Range of the joint position [rad or m].
        effort: Least and most effort of its actuator [N.m or N]; None without one.
        mass: Mass of the body [kg]; NaN if the file does not tell.
        centre: The body's centre of mass from its origin, all joints at zero [m].
    """

    name: str
    type: Literal["revolute", "prismatic"]
    parent: int
    axis: Vector
    offset: Vector
    limits: tuple[float, float]
    effort: tuple[float, float] | None
    mass: float
    centre: Vector


class Coincidence(NamedTuple):
    """A point of one body that stays at a point of another, which closes a loop.

    Attributes:
        first: Number of a body.
        first_point: The point from its origin, all joints at zero [m].
        second: Number of another body.
        second_point: The same of that one.
    """

    first: int
    first_point: Vector
    second: int
    second_point: Vector


@dataclass(frozen=True)
class LegTree:
    """The chain of a leg, open or with loops.

    Attributes:
        joints: Its joints, each after those that carry it.
        coincidences: What closes its loops.
        foot_body: Number of the body with the foot.
        foot_point: The foot from that body's origin, all joints at zero [m].
        origin: Origin of the leg frame in the base link's frame [m].
    """

    joints: tuple[LegJoint, ...]
    coincidences: tuple[Coincidence, ...]
    foot_body: int
    foot_point: Vector
    origin: Vector

    @cached_property
    def chain(self) -> FloatArray:
        """One row a joint: parent, whether it is prismatic, axis, offset (N, 8)."""
        rows = [(j.parent, j.type == "prismatic", *j.axis, *j.offset) for j in self.joints]
        return np.array(rows, dtype=np.float64).reshape(-1, 8)

    @cached_property
    def loops(self) -> FloatArray:
        """One row a coincidence: body and point of the first, and of the second (L, 8)."""
        rows = [(c.first, *c.first_point, c.second, *c.second_point) for c in self.coincidences]
        return np.array(rows, dtype=np.float64).reshape(-1, 8)

    @cached_property
    def foot(self) -> FloatArray:
        """Body and point of the foot (4,)."""
        return np.array([self.foot_body, *self.foot_point])

    @cached_property
    def masses(self) -> FloatArray:
        """One row a joint: mass and centre of the body it moves (N, 4)."""
        rows = [(joint.mass, *joint.centre) for joint in self.joints]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    @property
    def is_serial(self) -> bool:
        """Whether each joint stands on the one before it and the foot on the last."""
        in_line = all(joint.parent == k for k, joint in enumerate(self.joints))
        return in_line and not self.coincidences and self.foot_body == len(self.joints)


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
            if closure in closures or not touched:
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
        return _vector(place + rotation @ np.asarray(position) - origins[body(link)])

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
                _vector(frames[joint.child][0] @ joint.axis),
                _vector(origins[k + 1] - origins[parent]),
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
        _vector(origin),
    )


def _together(parts: Sequence[tuple[float | None, Vector]]) -> tuple[float, Vector]:
    """Return mass and centre of links that are one body; NaN if no link of it has a mass."""
    known = [(mass, np.array(centre)) for mass, centre in parts if mass is not None]
    if not known:
        return math.nan, (0.0, 0.0, 0.0)
    mass = math.fsum(m for m, _ in known)
    moment = sum((m * centre for m, centre in known), np.zeros(3))
    return mass, _vector(moment / mass) if mass > 0.0 else (0.0, 0.0, 0.0)


def _vector(values: FloatArray) -> Vector:
    """Return three numbers; what is zero but for rounding is zero."""
    x, y, z = (0.0 if abs(v) < STRAIGHT else float(v) for v in values)
    return x, y, z


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
