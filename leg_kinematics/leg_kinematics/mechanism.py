# SPDX-License-Identifier: Apache-2.0
"""What every leg mechanism offers: the one protocol that all layers above are written against."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, StatusArray
from leg_kinematics.bodies import LegTree
from leg_kinematics.errors import NotSupportedError, UnknownNameError

POINT_FOOT = ("x", "y", "z")  # task coordinates of a foot that the ground can push


@dataclass(frozen=True)
class Joint:
    """One joint of a mechanism.

    Attributes:
        name: Name within the mechanism, e.g. "crank_1".
        type: "revolute" or "prismatic".
    """

    name: str
    type: Literal["revolute", "prismatic"] = "revolute"

    @property
    def dimension(self) -> Literal["angle", "length"]:
        """What the joint position measures."""
        return "angle" if self.type == "revolute" else "length"

    @property
    def unit(self) -> str:
        """SI unit of the joint position."""
        return "rad" if self.type == "revolute" else "m"

    @property
    def effort_unit(self) -> str:
        """SI unit of the joint effort."""
        return "N.m" if self.type == "revolute" else "N"


@dataclass(frozen=True)
class Excursion:
    """How far passive joints have moved from the initial posture, which a limit bounds.

    Often it is that of one joint and has its name; joints that move alike share one, and a ball
    joint, which has no joint position, has the angle of a cone.

    Attributes:
        name: Name within the mechanism, e.g. "s1_cone".
        dimension: "angle" or "length".
    """

    name: str
    dimension: Literal["angle", "length"] = "angle"

    @property
    def unit(self) -> str:
        """SI unit of the excursion."""
        return "rad" if self.dimension == "angle" else "m"


class Posture(NamedTuple):
    """A solved leg: where the actuators stand, how the loops close, where the foot is.

    Attributes:
        joint_positions: Actuated joints (..., n) [rad or m].
        closure: Dependent coordinates that close the loops (..., m), named by the mechanism's
            `closure_names`; with the joint positions they fix every point of the linkage.
        foot_position: Foot in the leg frame (..., t) [m]; t = 3 for a point foot.
        status: `Status` of each point (...,).
    """

    joint_positions: FloatArray
    closure: FloatArray
    foot_position: FloatArray
    status: StatusArray


class Linkage(NamedTuple):
    """The points of a posture and the bars between them, for drawing.

    Attributes:
        names: Name of each point.
        points: Points in the leg frame (..., p, 3) [m].
        bars: Polylines as tuples of indices into `points`.
    """

    names: tuple[str, ...]
    points: FloatArray
    bars: tuple[tuple[int, ...], ...]

    def point(self, name: str) -> FloatArray:
        """Return a point by its name (..., 3) [m].

        Raises:
            UnknownNameError: If there is none of that name.
        """
        if name not in self.names:
            raise UnknownNameError("point", name, self.names)
        return self.points[..., self.names.index(name), :]

    def segments(self) -> FloatArray:
        """Return the straight pieces of the bars by their two ends (..., s, 2, 3) [m]."""
        pairs = [pair for bar in self.bars for pair in pairwise(bar)]
        return self.points[..., np.array(pairs, dtype=np.int64).reshape(-1, 2), :]


class Mechanism(ABC):
    """A leg mechanism in SI units: immutable, hashable, picklable.

    Leg frame: x forward, y left, z up (REP-103). All arrays follow the one shape rule: any leading
    batch axes, the same leading axes back. n is the number of actuated joints, p that of passive
    ones, e that of excursions, t that of the task coordinates: the foot's x, y, z, and for a
    manipulator its orientation after them.

    A mechanism defines what is abstract; class attributes serve as properties. It overrides the
    twist methods where one pass is cheaper than its parts, and the abilities that it has of those
    that raise a NotSupportedError here.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the kind of mechanism, e.g. "parallel_drive"."""

    @property
    @abstractmethod
    def joints(self) -> tuple[Joint, ...]:
        """The actuated joints (n)."""

    @property
    @abstractmethod
    def passive_joints(self) -> tuple[Joint, ...]:
        """The joints without an actuator that have a position, revolute or prismatic (p).

        A universal joint is two of them; a ball joint is none.
        """

    @property
    def excursions(self) -> tuple[Excursion, ...]:
        """What the limits of the passive joints bound (e); each passive joint unless told."""
        return tuple(Excursion(joint.name, joint.dimension) for joint in self.passive_joints)

    @property
    @abstractmethod
    def closure_names(self) -> tuple[str, ...]:
        """Names of the dependent coordinates that close the loops."""

    @property
    @abstractmethod
    def assembly_modes(self) -> tuple[str, ...]:
        """Names of the branches of the closed chain; the first is the default."""

    @property
    def task_coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of the foot that the joints control (t)."""
        return POINT_FOOT

    @property
    def task_units(self) -> tuple[str, ...]:
        """SI units of the task coordinates (t)."""
        return ("m",) * len(POINT_FOOT)

    @property
    def has_point_foot(self) -> bool:
        """Whether the foot is a point x, y, z that the ground can push."""
        return self.task_coordinates == POINT_FOOT

    @property
    @abstractmethod
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""

    @property
    @abstractmethod
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the excursions of the passive joints (e, 2) [rad or m]."""

    @property
    @abstractmethod
    def initial_posture(self) -> Posture:
        """The reference posture, from which excursions and assembly modes count."""

    @abstractmethod
    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot.

        Args:
            joint_positions: Actuated joints (..., n) [rad or m].
            assembly_mode: One of `assembly_modes`; "" is the first.

        Raises:
            ShapeError: If the joint positions are not numbers (..., n).
            UnknownNameError: If there is no such mode.
        """

    @abstractmethod
    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the actuators.

        Args:
            foot_position: The foot by its task coordinates in the leg frame (..., t) [m].
            assembly_mode: One of `assembly_modes`; "" is the first.

        Raises:
            ShapeError: If the foot position is not numbers (..., t).
            UnknownNameError: If there is no such mode.
        """

    @abstractmethod
    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q', foot velocity from joint velocities (..., t, n)."""

    @abstractmethod
    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q', angular velocity of the foot's body (..., 3, n)."""

    @abstractmethod
    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Positions of the passive joints (..., p) [rad or m].

        Each is the angle or displacement between the two bodies that the joint connects, continuous
        where the posture is: angles are those within half a turn of the initial posture's, which
        are in [-pi, pi). The mechanism tells their zeros and senses.
        """

    def passive_joint_excursions(self, posture: Posture) -> FloatArray:
        """Excursions of the passive joints from the initial posture (..., e) [rad or m]."""
        rest = self.passive_joint_positions(self.initial_posture)
        return self.passive_joint_positions(posture) - rest

    @abstractmethod
    def linkage(self, posture: Posture) -> Linkage:
        """Points and bars of the leg in this posture."""

    def positions_by_name(self, posture: Posture) -> dict[str, FloatArray]:
        """Positions (...) of all joints by name, the actuated ones first [rad or m]."""
        names = [joint.name for joint in (*self.joints, *self.passive_joints)]
        parts = posture.joint_positions, self.passive_joint_positions(posture)
        return dict(zip(names, np.moveaxis(np.concatenate(parts, axis=-1), -1, 0), strict=True))

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., t + 3, n): the twist of the foot's body."""
        return np.concatenate([self.jacobian(posture), self.angular_jacobian(posture)], axis=-2)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        posture = self.inverse(foot_position, assembly_mode)
        return posture, self.twist_jacobian(posture)

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` of the same points."""
        posture = self.forward(joint_positions, assembly_mode)
        return posture, self.twist_jacobian(posture)

    def offers(self, ability: Callable[..., Any]) -> bool:
        """Tell whether the mechanism has an optional ability, such as `Mechanism.acceleration`."""
        return getattr(type(self), ability.__name__) is not ability

    def acceleration(
        self, posture: Posture, joint_velocities: ArrayLike, joint_accelerations: ArrayLike
    ) -> FloatArray:
        """Second derivatives of the task coordinates (..., t), an optional ability.

        Args:
            posture: The leg's posture (...).
            joint_velocities: Of the actuated joints (..., n) [rad/s or m/s].
            joint_accelerations: Of the actuated joints (..., n) [rad/s² or m/s²].

        Raises:
            NotSupportedError: If the mechanism does not tell them.
        """
        raise NotSupportedError(f"mechanism {self.name!r} does not tell accelerations")

    def body_tree(self, assembly_mode: str = "") -> LegTree:
        """The bodies of the leg and the joints between them, an optional ability.

        Joints have the mechanism's names, zeros and senses; loops are cut at points that two bodies
        share. Masses and efforts are not told by dimensions.

        Args:
            assembly_mode: One of `assembly_modes`; "" is the first. Modes that turn a body over
                have other bodies.

        Raises:
            NotSupportedError: If the mechanism does not tell its bodies.
            UnknownNameError: If there is no such mode.
            GeometryError: If the loops close nowhere in this mode.
        """
        raise NotSupportedError(f"mechanism {self.name!r} does not tell its bodies")

    def tree_positions(self, posture: Posture) -> FloatArray:
        """Positions of the joints of `body_tree` in their order (..., N) [rad or m].

        Raises:
            NotSupportedError: If the mechanism does not tell its bodies.
        """
        positions = self.positions_by_name(posture)
        return np.stack([positions[joint.name] for joint in self.body_tree().joints], axis=-1)

    def constraint_jacobian(self, posture: Posture) -> FloatArray:
        """Constraint wrenches of the drive (..., c, 6), force then moment; an optional ability.

        Raises:
            NotSupportedError: If the mechanism does not tell them.
        """
        raise NotSupportedError(f"mechanism {self.name!r} does not tell constraint wrenches")

    def holding_efforts(self, posture: Posture, gravity: ArrayLike) -> FloatArray:
        """Efforts that hold the links' own weight (..., n) [N.m or N], an optional ability.

        Args:
            posture: The leg's posture (...).
            gravity: Acceleration of gravity in the leg frame (..., 3) [m/s²].

        Raises:
            NotSupportedError: If the masses of the links are not known.
        """
        raise NotSupportedError(f"the masses of mechanism {self.name!r} are not known")

    @property
    def has_masses(self) -> bool:
        """Whether the masses of the links are known, and so what holds their weight."""
        return False

    def planar_jacobian(self, posture: Posture) -> FloatArray:
        """Jacobian of the foot in the leg's plane (..., 2, 2), an optional ability.

        Rows are the foot's velocity along the walking direction and up in the leg's plane, columns
        the speeds of the first two actuated joints.

        Raises:
            NotSupportedError: If the mechanism has no planar part with two actuators.
        """
        raise NotSupportedError(f"mechanism {self.name!r} has no planar part with two actuators")

    def mode_index(self, assembly_mode: str) -> int:
        """Return the index of an assembly mode; "" is the first one, the default.

        Raises:
            UnknownNameError: If the mechanism has no such mode.
        """
        if isinstance(assembly_mode, str) and not assembly_mode:
            return 0
        try:
            return self.assembly_modes.index(assembly_mode)
        except ValueError:  # also of arrays, which have no truth
            raise UnknownNameError("assembly mode", assembly_mode, self.assembly_modes) from None
