# SPDX-License-Identifier: Apache-2.0
"""A robot model as files tell it: links, the joints between them, and the loops they close."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError, UnknownNameError

FRAME = 0.1 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # points of a weld [m]


class ModelLink(NamedTuple):
    """A rigid body.

    Attributes:
        name: Its name.
        mass: Its mass [kg]; None if the file does not tell.
        centre: Its centre of mass in its frame (3,) [m].
    """

    name: str
    mass: float | None
    centre: FloatArray


class ModelJoint(NamedTuple):
    """What holds a link: its place on the parent link, and how it may move there.

    Attributes:
        name: Its name.
        type: How it moves.
        parent: Name of the link it stands on.
        child: Name of the link it holds, whose frame is the joint's where its position is zero.
        rotation: Turns coordinates of the child's frame into those of the parent's (3, 3).
        position: Origin of the child's frame in the parent's (3,) [m].
        axis: Unit vector in the child's frame (3,).
        limits: Range of its position [rad or m]; infinite if nothing bounds it.
        effort: Least and most effort of its actuator [N.m or N]; None if it has none.
        place: File and line where it stands.
    """

    name: str
    type: Literal["revolute", "prismatic", "fixed"]
    parent: str
    child: str
    rotation: FloatArray
    position: FloatArray
    axis: FloatArray
    limits: tuple[float, float]
    effort: tuple[float, float] | None
    place: str


class Closure(NamedTuple):
    """Points of two links that coincide, and so close a loop.

    One point is a ball joint, two are a pin along their line, three a weld.

    Attributes:
        first: Name of a link.
        first_points: Points in its frame (k, 3) [m].
        second: Name of another link.
        second_points: The same points in the frame of that one (k, 3) [m].
        place: Where it is told.
    """

    first: str
    first_points: FloatArray
    second: str
    second_points: FloatArray
    place: str


@dataclass(frozen=True)
class ModelTree:
    """The links of a robot, each but the root held by one joint.

    Attributes:
        name: Name of the robot.
        links: The links by name.
        joints: The joints by the name of the link they hold.
        closures: What closes loops.
        place: The file.
    """

    name: str
    links: Mapping[str, ModelLink]
    joints: Mapping[str, ModelJoint]
    closures: tuple[Closure, ...]
    place: str

    def __post_init__(self) -> None:
        """Check that the joints make a tree.

        Raises:
            DescriptionError: If a joint names a link that is not there, or links hold each other.
        """
        for joint in self.joints.values():
            for link in (joint.parent, joint.child):
                if link not in self.links:
                    raise DescriptionError(
                        f"{joint.place}: joint {joint.name!r} names link {link!r}, which is not "
                        f"there; links: {', '.join(self.links)}"
                    )
        for link in self.links:
            self.path(link)

    def link(self, name: str) -> ModelLink:
        """Return a link.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        if name not in self.links:
            raise UnknownNameError("link", name, self.links)
        return self.links[name]

    @property
    def root(self) -> str:
        """Name of the first link that no joint holds."""
        return next(name for name in self.links if name not in self.joints)

    def path(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the joints from the root to a link.

        Raises:
            DescriptionError: If they go round in a circle.
        """
        found: list[ModelJoint] = []
        while link in self.joints:
            joint = self.joints[link]
            if joint in found[:1] or len(found) > len(self.joints):
                raise DescriptionError(f"{joint.place}: joint {joint.name!r} holds its own parent")
            found.append(joint)
            link = joint.parent
        return tuple(reversed(found))

    def below(self, link: str) -> Iterator[str]:
        """Yield the names of a link and of all links that it carries."""
        children: dict[str, list[str]] = {}
        for joint in self.joints.values():
            children.setdefault(joint.parent, []).append(joint.child)
        waiting = [link]
        while waiting:
            name = waiting.pop()
            yield name
            waiting += reversed(children.get(name, []))

    def frames(self, base: str) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return rotation and origin of each link in a base link's frame, all joints at zero.

        Only links that the base carries are told.
        """
        found: dict[str, tuple[FloatArray, FloatArray]] = {base: (np.eye(3), np.zeros(3))}
        for name in self.below(base):
            if name != base:
                joint = self.joints[name]
                rotation, origin = found[joint.parent]
                found[name] = rotation @ joint.rotation, origin + rotation @ joint.position
        return found
