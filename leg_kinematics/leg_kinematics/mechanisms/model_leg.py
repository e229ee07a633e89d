# SPDX-License-Identifier: Apache-2.0
"""`model`: legs read from robot models, see `leg_kinematics.model`.

There are two kinds of them, and `model_leg` chooses: `SerialLeg`, three revolute joints in a row
with an inverse in closed form, and `NewtonLeg` for any other chain, with or without loops.

The leg frame has the axes of the robot's base link, x forward, y left, z up, and its origin on the
first joint on the way to the foot. Joints, their zeros and senses are the file's.

What the inverse tells with other than three actuated joints: with fewer, the joint positions whose
foot is nearest, if it is within 1 µm, otherwise UNREACHABLE; with more, those nearest to the
initial posture.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, StatusArray, as_array, wrapped_angles
from leg_kinematics.assembly_modes import flipped_modes, mode_signs
from leg_kinematics.errors import GeometryError
from leg_kinematics.geometry import check_ranges
from leg_kinematics.kernels.scalars import LIMIT_TOLERANCE
from leg_kinematics.mechanism import Joint, Linkage, Mechanism, Posture
from leg_kinematics.model import newton, three_revolute
from leg_kinematics.model.leg_tree import LegTree
from leg_kinematics.model.newton import Equations
from leg_kinematics.model.postures import (
    FEET_ARE_GIVEN,
    JOINTS_ARE_GIVEN,
    Postures,
    assembled,
    independent_rows,
    known_postures,
)
from leg_kinematics.status import Status

Ranges = tuple[tuple[float, float], ...]
WHOLE_TURN = 2.0 * math.pi - 1e-9
SAME = 1e-6  # rad or m, within which two solutions are one posture
ISOTROPIC = 0.05  # ratio of singular values of J below which a posture is near a singularity
BENDS = 5  # trial positions of each joint, where the zero posture is singular
WIDEST_BEND = 1.5  # rad, of these


@dataclass(frozen=True)
class ModelLeg(Mechanism):
    """A leg of a robot model.

    Attributes:
        tree: The chain.
        actuated: Names of the actuated joints.
        postures: All joint positions (N) of a posture of each assembly mode, by the modes' names;
            the first is the initial posture.
        joint_ranges: Ranges of the actuated joints [rad or m].
        passive_joint_ranges: Ranges of the passive joints' excursions [rad or m].

    Raises:
        GeometryError: If the chain makes no leg.
    """

    name: ClassVar[str] = "model"

    tree: LegTree
    actuated: tuple[str, ...]
    postures: tuple[tuple[str, tuple[float, ...]], ...]
    joint_ranges: Ranges
    passive_joint_ranges: Ranges

    def __post_init__(self) -> None:
        """Check the ranges and the freedoms."""
        check_ranges("joint_ranges", self.joint_ranges, self.joints)
        check_ranges("passive_joint_ranges", self.passive_joint_ranges, self.excursions)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The actuated joints (n)."""
        kinds = {joint.name: joint.type for joint in self.tree.joints}
        return tuple(Joint(name, kinds[name]) for name in self.actuated)

    @cached_property
    def passive_joints(self) -> tuple[Joint, ...]:
        """The joints without an actuator (p)."""
        return tuple(
            Joint(joint.name, joint.type)
            for joint in self.tree.joints
            if joint.name not in self.actuated
        )

    @property
    def closure_names(self) -> tuple[str, ...]:
        """Names of the passive joints, whose positions close the loops."""
        return tuple(joint.name for joint in self.passive_joints)

    @cached_property
    def joint_limits(self) -> FloatArray:
        """Ranges of the actuated joints (n, 2) [rad or m]."""
        return np.array(self.joint_ranges, dtype=np.float64).reshape(-1, 2)

    @cached_property
    def passive_joint_limits(self) -> FloatArray:
        """Ranges of the excursions of the passive joints (p, 2) [rad or m]."""
        return np.array(self.passive_joint_ranges, dtype=np.float64).reshape(-1, 2)

    @property
    def mass(self) -> float:
        """Mass of the moving links [kg]; NaN if the model does not tell it of all."""
        return math.fsum(joint.mass for joint in self.tree.joints)

    @cached_property
    def _equations(self) -> Equations:
        names = [joint.name for joint in self.tree.joints]
        actuated = [names.index(name) for name in self.actuated]
        passive = [k for k in range(len(names)) if k not in actuated]
        initial = np.array(self.postures[0][1])
        return Equations(
            self.tree.chain,
            self.tree.loops,
            self.tree.foot,
            independent_rows(self.tree, initial),
            np.array(actuated, dtype=np.float64),
            np.array(passive, dtype=np.float64),
            initial[actuated],
            np.zeros(2),
        )

    @cached_property
    def _order(self) -> tuple[Any, Any]:
        """Numbers of the actuated and of the passive joints in the tree."""
        equations = self._equations
        return equations.actuated.astype(np.int64), equations.passive.astype(np.int64)

    def _all_joints(self, posture: Posture) -> FloatArray:
        """Return the positions of all joints in the order of the tree (..., N)."""
        actuated, passive = self._order
        q = np.empty((*np.shape(posture.status), len(self.tree.joints)))
        q[..., actuated], q[..., passive] = posture.joint_positions, posture.closure
        return q

    @property
    def initial_posture(self) -> Posture:
        """The reference posture."""
        actuated, _ = self._order
        return self.forward(np.array(self.postures[0][1])[actuated])

    @abstractmethod
    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""

    def jacobian(self, posture: Posture) -> FloatArray:
        """J of v = J q' (..., 3, n)."""
        return self.twist_jacobian(posture)[..., :3, :]

    def angular_jacobian(self, posture: Posture) -> FloatArray:
        """J_omega of omega = J_omega q', of the link with the foot (..., 3, n)."""
        return self.twist_jacobian(posture)[..., 3:, :]

    def passive_joint_positions(self, posture: Posture) -> FloatArray:
        """Positions of the passive joints (..., p) [rad or m], with the file's zeros and senses."""
        if not self.passive_joints:
            return posture.closure
        turning = np.array([joint.type == "revolute" for joint in self.passive_joints])
        rest = np.array(self.postures[0][1])[self._order[1]]
        rest = np.where(turning, wrapped_angles(rest), rest)
        moved = posture.closure - rest
        return rest + np.where(turning, wrapped_angles(moved), moved)

    def holding_efforts(self, posture: Posture, gravity: ArrayLike) -> FloatArray:
        """Efforts that hold the links' own weight (..., n) [N.m or N]; see `Mechanism`."""
        if not self.has_masses:
            return super().holding_efforts(posture, gravity)
        chain, loops, _, rows, actuated, passive, *_ = self._equations
        vector = as_array("gravity", gravity, 3)
        q = self._all_joints(posture)
        return newton.holding_efforts(
            chain, loops, self.tree.masses, rows, actuated, passive, q, vector
        )

    @property
    def has_masses(self) -> bool:
        """Whether the masses of all moving links are known."""
        return math.isfinite(self.mass)

    def linkage(self, posture: Posture) -> Linkage:
        """Joints, loops' points and foot of this posture; bars connect what is on one body."""
        joints = self.tree.joints
        places = newton.joint_places(self.tree.chain, self._all_joints(posture))
        foot = posture.foot_position
        bars = [(joint.parent - 1, k) for k, joint in enumerate(joints) if joint.parent > 0]
        names = (*(joint.name for joint in joints), "foot")
        bars.append((self.tree.foot_body - 1, len(joints)))
        points = np.concatenate([places, foot[..., None, :]], axis=-2)
        return Linkage(names, points, tuple(bars))


@dataclass(frozen=True)
class SerialLeg(ModelLeg):
    """Three revolute joints in a row, of which two neighbours meet or are parallel."""

    @cached_property
    def assembly_modes(self) -> tuple[str, ...]:
        """The initial mode, and those with hip, knee or both bent the other way."""
        return flipped_modes(self.postures[0][0], ("hip", "knee"))

    @cached_property
    def _numbers(self) -> FloatArray:
        numbers = three_revolute.three_revolute_numbers(self.tree)
        if numbers is None:
            raise GeometryError("no two neighbouring axes of the leg meet or are parallel")
        numbers[three_revolute.MIDDLE] = self.joint_limits.mean(axis=1)
        return numbers

    @cached_property
    def _signs(self) -> FloatArray:
        """Signs of the levers in the initial posture: of the last joint solved, of the middle."""
        q = np.array(self.postures[0][1])
        foot, _ = three_revolute.forward(self._numbers, np.ones(2), self.joint_limits, q)
        levers = three_revolute.levers(self._numbers, q, foot)
        if not np.abs(levers).min() > three_revolute.DEAD_CENTRE:
            raise GeometryError(
                f"the initial posture {dict(zip(self.actuated, q.tolist(), strict=True))} is "
                "singular (a straight leg, or the foot on the axis of the hip): bend it"
            )
        return np.sign(levers)

    def _of_mode(self, assembly_mode: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        hip, knee = mode_signs(self, assembly_mode, ("hip", "knee"))
        from_foot = self._numbers[three_revolute.PLAN, 2] == 1.0
        flips = np.array([hip, knee] if from_foot else [knee, hip])
        return self._numbers, self._signs * flips, self.joint_limits

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot; a posture of another mode is SINGULAR."""
        q = as_array("joint_positions", joint_positions, 3)
        foot, status = three_revolute.forward(*self._of_mode(assembly_mode), q)
        return Posture(q, q[..., :0], foot, status)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the joints, in closed form."""
        foot = as_array("foot_position", foot_position, 3)
        q, status = three_revolute.inverse(*self._of_mode(assembly_mode), foot)
        return Posture(q, q[..., :0], foot, status)

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        foot = as_array("foot_position", foot_position, 3)
        q, status, twist = three_revolute.inverse_with_twist(*self._of_mode(assembly_mode), foot)
        return Posture(q, q[..., :0], foot, status), twist

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, 3)."""
        return three_revolute.twist_jacobian(self._numbers, posture.joint_positions)


@dataclass(frozen=True)
class NewtonLeg(ModelLeg):
    """Any chain: followed from known postures, see `leg_kinematics.model.newton`."""

    @property
    def assembly_modes(self) -> tuple[str, ...]:
        """The branches of the given postures; the first is the default."""
        return tuple(name for name, _ in self.postures)

    @cached_property
    def _tables(self) -> dict[int, Postures]:
        return {}

    def _table(self, assembly_mode: str) -> Postures:
        """Return the known postures of a mode, reached when they are first needed."""
        index = self.mode_index(assembly_mode)
        if index not in self._tables:
            posture = np.array(self.postures[index][1])
            self._tables[index] = known_postures(self._equations, self.joint_limits, posture)
        return self._tables[index]

    def _branch(self, assembly_mode: str, signs: FloatArray) -> Equations:
        """Return the equations with what is a mode's own."""
        posture = np.array(self.postures[self.mode_index(assembly_mode)][1])
        return self._equations._replace(rest=posture[self._order[0]], signs=signs)

    def forward(self, joint_positions: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the foot.

        Where the loops close but the inverse of that foot is another posture, the posture is of
        another branch: SINGULAR.
        """
        return self.forward_with_twist(joint_positions, assembly_mode)[0]

    def forward_with_twist(
        self, joint_positions: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`forward` and `twist_jacobian` of the same points."""
        n = len(self.joints)
        given = as_array("joint_positions", joint_positions, n)
        goal = given.reshape(-1, n)
        table = self._table(assembly_mode)
        start = table.joints[table.nearest_to_joints(goal)]
        begin = start[:, self._order[0]]
        signs = np.array([table.signs[0], 0.0])
        with np.errstate(invalid="ignore"):  # infinite joint positions stay without an answer
            end = self._near_turn(goal, begin)
        q, foot, twist, _, status = newton.follow_postures(
            *self._branch(assembly_mode, signs), start, begin, end, JOINTS_ARE_GIVEN
        )
        solved = status == Status.OK
        back = self._followed(foot[solved], assembly_mode)[0]
        same = np.abs(self._turned(back - q[solved])).max(axis=1, initial=0.0) <= SAME
        q[:, self._order[0]] = goal
        status[solved] = np.where(same, self._limited(q[solved]), Status.SINGULAR)
        posture = self._posture(q, foot, status, given.shape[:-1])
        return posture._replace(joint_positions=given), twist.reshape(*given.shape[:-1], 6, n)

    def inverse(self, foot_position: ArrayLike, assembly_mode: str = "") -> Posture:
        """Solve for the joints."""
        return self.inverse_with_twist(foot_position, assembly_mode)[0]

    def inverse_with_twist(
        self, foot_position: ArrayLike, assembly_mode: str = ""
    ) -> tuple[Posture, FloatArray]:
        """`inverse` and `twist_jacobian` of the same points."""
        foot = as_array("foot_position", foot_position, 3)
        q, twist, status = self._followed(foot.reshape(-1, 3), assembly_mode)
        solved = status == Status.OK
        q[solved] = self._in_ranges(q[solved])
        status[solved] = self._limited(q[solved])
        batch = foot.shape[:-1]
        posture = self._posture(q, foot.reshape(-1, 3), status, batch)
        return posture._replace(foot_position=foot), twist.reshape(*batch, 6, len(self.joints))

    def twist_jacobian(self, posture: Posture) -> FloatArray:
        """`jacobian` above `angular_jacobian` (..., 6, n)."""
        return newton.twist_jacobian(*self._equations, self._all_joints(posture))

    def _followed(self, feet: FloatArray, mode: str) -> tuple[FloatArray, FloatArray, StatusArray]:
        """Return all joint positions (m, N), twists and status of feet (m, 3)."""
        table = self._table(mode)
        near = table.nearest_to_feet(feet)
        q, _, twist, _, status = newton.follow_postures(
            *self._branch(mode, table.signs),
            *(table.joints[near], table.feet[near], feet, FEET_ARE_GIVEN),
        )
        return q, twist, status

    def _posture(
        self, q: FloatArray, foot: FloatArray, status: StatusArray, batch: tuple[int, ...]
    ) -> Posture:
        actuated, passive = self._order
        return Posture(
            q[:, actuated].reshape(*batch, len(actuated)),
            q[:, passive].reshape(*batch, len(passive)),
            foot.reshape(*batch, 3),
            status.reshape(batch),
        )

    @cached_property
    def _turning(self) -> Any:
        return np.array([joint.type == "revolute" for joint in self.tree.joints])

    def _turned(self, differences: FloatArray) -> FloatArray:
        """Return differences of all joints (m, N) without whole turns."""
        return np.where(self._turning, wrapped_angles(differences), differences)

    def _near_turn(self, goal: FloatArray, start: FloatArray) -> FloatArray:
        """Return actuated joints (m, n) by the whole turns nearest to others."""
        turning = self._turning[self._order[0]]
        return np.where(turning, start + wrapped_angles(goal - start), goal)

    def _in_ranges(self, q: FloatArray) -> FloatArray:
        """Return joint positions (m, N), the actuated ones by the turn that their range holds."""
        actuated, _ = self._order
        middle = self.joint_limits.mean(axis=1)
        q[:, actuated] = self._near_turn(
            q[:, actuated], np.broadcast_to(middle, (len(q), len(middle)))
        )
        return q

    def _limited(self, q: FloatArray) -> StatusArray:
        """Return the status of postures (m, N) on their branch."""
        actuated, passive = self._order
        status = np.full(len(q), Status.OK, dtype=np.uint8)
        rest = np.array(self.postures[0][1])
        excursions = self._turned(q - rest)[:, passive]
        for values, limits, code, turning in (
            (
                excursions,
                self.passive_joint_limits,
                Status.PASSIVE_JOINT_LIMIT,
                self._turning[passive],
            ),
            (q[:, actuated], self.joint_limits, Status.JOINT_LIMIT, self._turning[actuated]),
        ):
            endless = turning & (np.diff(limits, axis=1)[:, 0] >= WHOLE_TURN)
            within = (values >= limits[:, 0] - LIMIT_TOLERANCE) & (
                values <= limits[:, 1] + LIMIT_TOLERANCE
            )
            status[~(within | endless).all(axis=1)] = code
        return status


def model_leg(
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
    if leg.initial_posture.status == Status.SINGULAR:
        raise GeometryError(
            f"the initial posture {dict(zip(names, initial.round(6).tolist(), strict=True))} is "
            "singular: give one in which every actuator moves the foot"
        )
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
    equations = Equations(tree.chain, tree.loops, tree.foot, none, every, none, rest, np.zeros(2))
    room = newton.new_room(n, 0, n)

    def condition_and_depth(q: FloatArray) -> tuple[float, float]:
        foot, _, _ = newton.evaluate(equations, q, room)
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
