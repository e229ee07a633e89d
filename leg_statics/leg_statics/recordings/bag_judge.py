# SPDX-License-Identifier: Apache-2.0
"""What a recording tells about the legs: the node's own answers, many messages at once.

Joint states go through `JointStream`, as in the statics node. Beside its states, the judge works
out how much of each joint's effort limit and range is used, and, if the foot's wrench is recorded,
what share of the load capacity and which friction it takes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.recordings.bags import Bag, BagMessage
from leg_msgs_py.recordings.errors import BagError
from numpy.typing import NDArray

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import LegError, ValueRangeError
from leg_kinematics.mechanism import Posture
from leg_kinematics.nodes.frames import robot_frame
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status
from leg_statics.efforts import joint_efforts, utilisation
from leg_statics.joint_pieces import JointPieces, WholeLegs
from leg_statics.joint_stream import CONTACT_FORCE, JointStateError, JointStream, StampOrder
from leg_statics.leg_state import LegStates
from leg_statics.recordings.judged_stances import JudgedStances
from leg_statics.weight import level_gravity, weight_efforts

JOINT_STATE = "sensor_msgs/msg/JointState"
LIMITS = "leg_msgs/msg/EffortLimits"
WRENCH = "geometry_msgs/msg/WrenchStamped"
BATCH = 4096  # joint states that are judged at once
HOLD = 100_000_000  # a wrench or an effort counts for so long after it was recorded [ns]
MOST_REASONS = 100  # of refusals that are told apart
OTHER_REASONS = "other reasons"


class Topics(NamedTuple):
    """Where the inputs of the judge are in a recording.

    Attributes:
        joint_states: Joint states; "" for none.
        efforts: Joint states whose efforts count instead; "" for those of `joint_states`.
        wrenches: Wrench that the ground applies to the foot, by leg.
        node: Name of the node whose effort limits count, if they were recorded.
    """

    joint_states: str = "/joint_states"
    efforts: str = ""
    wrenches: Mapping[str, str] = {}
    node: str = "/statics"

    @property
    def effort_limits(self) -> str:
        """Limits that the node put in force."""
        return f"{self.node}/effort_limits"

    def check(self, bag: Bag) -> set[str]:
        """Return the topics to read from a recording.

        Raises:
            ValueRangeError: If a topic is not in it, or has another type of messages.
        """
        wanted = dict.fromkeys(filter(None, (self.joint_states, self.efforts)), JOINT_STATE)
        wanted |= dict.fromkeys(self.wrenches.values(), WRENCH)
        wanted |= {self.effort_limits: LIMITS} if self.effort_limits in bag.topics else {}
        for name, kind in wanted.items():
            if name not in bag.topics:
                present = ", ".join(f"{t.name} ({t.type})" for t in sorted(bag.topics.values()))
                raise ValueRangeError(f"{bag.path}: no topic {name}; it has {present}")
            if bag.topics[name].type != kind:
                raise ValueRangeError(f"topic {name}: got {bag.topics[name].type}; allowed: {kind}")
        return set(wanted)


class Judgement(NamedTuple):
    """Judgement of one leg at T joint states.

    Shares are 1 at a limit and more beyond it. What is not known is NaN.

    Attributes:
        leg: The leg.
        message: Which joint state of the recording each is, counted from 0 (T,).
        time: When it was recorded (T,) [ns].
        stamp: Its stamp (T,) [ns].
        joint_positions: Actuated joints (T, n) [rad or m].
        status: `Status` of the poses (T,).
        foot_position: (T, 3) [m], in the leg frame as all vectors here.
        foot_velocity: (T, 3) [m/s].
        ground_force: Force of the ground that balances the joint efforts (T, 3) [N].
        contact: `ContactState` that it tells (T,).
        condition_number: (T,).
        load_capacity: (T,) [N].
        rated_friction: mu_e (T,).
        rated_friction_full: Its full form, with both horizontal components (T,).
        utilisation: Share of the effort limit that the worst joint uses (T,).
        joint_utilisation: The same of every joint (T, n).
        range_use: Largest share of the way from the middle of its range to its end that an
            actuated joint has gone (T,).
        passive_range_use: Largest share of its excursion limit that a passive joint uses (T,).
        force: Ground reaction on the foot (T, 3) [N].
        load: Its component along z of the base frame (T,) [N].
        load_share: load / load capacity (T,).
        friction_used: Horizontal / vertical ground reaction (T,).
        required_utilisation: Share of the effort limit that the wrench needs of every joint (T, n).
    """

    leg: str
    message: NDArray[np.int64]
    time: NDArray[np.int64]
    stamp: NDArray[np.int64]
    joint_positions: FloatArray
    status: NDArray[np.uint8]
    foot_position: FloatArray
    foot_velocity: FloatArray
    ground_force: FloatArray
    contact: NDArray[np.uint8]
    condition_number: FloatArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    utilisation: FloatArray
    joint_utilisation: FloatArray
    range_use: FloatArray
    passive_range_use: FloatArray
    force: FloatArray
    load: FloatArray
    load_share: FloatArray
    friction_used: FloatArray
    required_utilisation: FloatArray


@dataclass
class Tally:
    """What became of the inputs.

    Attributes:
        judged: Joint states that updated a leg.
        refused: Messages that could not be used, by reason.
        pieces: Joint states that name no leg's joints in full; put together they may be judged.
        foreign: Joint states that name no joint of the robot.
        foreign_names: What one of them names.
        missing: Messages that did not update a leg because joints lack, by leg and joints.
        disordered: Joint states whose stamp is not after the one before; they are judged.
        limit_changes: How often other effort limits came into force.
        first, last: When the first and the last joint state were recorded [ns].
        gaps: Number of pauses between joint states.
        longest_gaps: The longest of them: when each began [ns] and its length [ns].
    """

    judged: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    pieces: int = 0
    foreign: int = 0
    foreign_names: tuple[str, ...] = ()
    missing: Counter[str] = field(default_factory=Counter)
    disordered: int = 0
    limit_changes: int = 0
    first: int | None = None
    last: int | None = None
    gaps: int = 0
    longest_gaps: list[tuple[int, int]] = field(default_factory=list)

    def refuse(self, reason: str, count: int = 1) -> None:
        """Count messages that cannot be used."""
        known = reason in self.refused or len(self.refused) < MOST_REASONS
        self.refused[reason if known else OTHER_REASONS] += count


class _Row(NamedTuple):
    """A joint state that waits to be judged, with what else was known then."""

    message: int
    time: int
    stamp: int
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray
    wrenches: dict[str, FloatArray]


class BagJudge:
    """Takes the messages of a recording one by one and judges them in batches.

    Args:
        bag: The recording.
        robot: The robot, with its effort limits.
        friction: Friction coefficient of the ground.
        topics: Where the inputs are.
        contact_force: A foot with less vertical force is in the air [N].
        gap: A longer pause between joint states is told [s].

    Attributes:
        robot: The robot, with the effort limits in force.
        topics: Where the inputs are.
        gap: A longer pause between joint states is told [s].
        inputs: Names of the topics to take.
        tally: What became of the inputs so far.
        stances: How the robot stood.

    Raises:
        UnknownNameError: If a leg is not known.
        ValueRangeError: If a topic is missing or has another type of messages.
    """

    def __init__(
        self,
        bag: Bag,
        robot: Robot,
        friction: float,
        topics: Topics,
        contact_force: float = CONTACT_FORCE,
        gap: float = 0.1,
    ) -> None:
        self.robot = robot
        self.topics = topics
        self.gap = gap
        self.inputs = topics.check(bag)
        self.tally = Tally()
        self.stances = JudgedStances()
        self._bag = bag
        self._friction = friction
        self._stream = JointStream(robot, friction, contact_force)
        self._pieces = JointPieces(robot)
        self._order = StampOrder()
        self._contact_force = contact_force
        self._legs_by_topic = {topic: robot.leg(leg) for leg, topic in topics.wrenches.items()}
        self._wrenches: dict[str, tuple[int, FloatArray]] = {}
        self._efforts: dict[str, tuple[int, float]] = {}
        self._joints, _ = robot.effort_limits()
        self._waiting: dict[tuple[Any, ...], list[_Row]] = {}
        self._judged: list[Judgement] = []
        self._messages = 0
        self._count = 0

    @property
    def full(self) -> bool:
        """Whether so much waits that it should be judged, or taken, now."""
        return self._count >= BATCH or bool(self._judged)

    def take(self, message: BagMessage) -> None:
        """Take a message of the topics; others are ignored."""
        try:
            if message.topic == self.topics.efforts:
                self._take_efforts(message)
            if message.topic == self.topics.joint_states:
                self._take_joint_state(message)
            elif message.topic in self._legs_by_topic:
                self._take_wrench(message)
            elif message.topic == self.topics.effort_limits:
                self._take_limits(message)
        except (BagError, LegError) as error:
            self.tally.refuse(str(error))

    def judge(self) -> list[Judgement]:
        """Judge what waits; one judgement a leg for all joint states with the same names."""
        waiting, self._waiting, self._count = self._waiting, {}, 0
        judgements, self._judged = self._judged, []
        for (names, *_), rows in waiting.items():
            position = np.stack([row.position for row in rows])
            velocity = np.stack([row.velocity for row in rows])
            effort = np.stack([row.effort for row in rows])
            try:
                states = self._stream.read(names, position, velocity, effort)
            except JointStateError as error:
                self.tally.refuse(f"{self.topics.joint_states}: {error}", len(rows))
                continue
            self._count_missing(names, states, len(rows))
            self._judge_stances(rows, states)
            for k, name in enumerate(states.legs):
                leg = self.robot.leg(name)
                columns = [names.index(joint) for joint in leg.joint_names]
                efforts = effort[:, columns] if effort.shape[1] else None
                if efforts is not None and leg.drives is not None:
                    efforts = leg.drives.efforts(efforts)
                judgements.append(self._judgement(leg, rows, states, k, efforts))
        return judgements

    # ------------------------------------------------------------------ inputs

    def _take_joint_state(self, message: BagMessage) -> None:
        number, self._messages = self._messages, self._messages + 1
        self._note_time(message.time)
        joints = self._bag.decode(message)
        names, stamp = tuple(joints.name), _nanoseconds(joints.header.stamp)
        if not self._order.advances(names, stamp):
            self.tally.disordered += 1
        try:
            told = self._whole_legs(message.time, names, joints)
        except JointStateError as error:
            self.tally.refuse(f"{self.topics.joint_states}: {error}")
            return
        if told is None:
            return
        names, position, velocity, effort = told
        if self.topics.efforts:
            effort = np.array([self._held(self._efforts, name, message.time) for name in names])
        wrenches = {
            leg.name: self._held(self._wrenches, leg.name, message.time)
            for leg in self._legs_by_topic.values()
        }
        row = _Row(number, message.time, stamp, position, velocity, effort, wrenches)
        key = (names, len(position), len(velocity), len(effort))
        self._waiting.setdefault(key, []).append(row)
        self._count += 1

    def _whole_legs(self, time: int, names: tuple[str, ...], joints: Any) -> WholeLegs | None:
        """Return what a message tells, after what the pieces before it told if it is one itself.

        Raises:
            JointStateError: If a name appears more than once, or the lengths of a piece are wrong.
        """
        layout = self._stream.layout(names)
        if layout.legs or not layout.missing:
            return WholeLegs(names, joints.position, joints.velocity, joints.effort)
        self.tally.pieces += 1
        whole = self._pieces.add(time, names, joints.position, joints.velocity, joints.effort)
        for leg, missing in self._pieces.lacking.items():
            self.tally.missing[f"{leg} lacks {', '.join(missing)}"] += 1
        return whole

    def _take_efforts(self, message: BagMessage) -> None:
        joints = self._bag.decode(message)
        if len(joints.effort) != len(joints.name):
            raise JointStateError(
                f"{message.topic}: effort: got {len(joints.effort)} values; "
                f"allowed: {len(joints.name)} values, one a name"
            )
        for name, effort in zip(joints.name, joints.effort, strict=True):
            if name in self._joints:
                self._efforts[name] = (message.time, float(effort))

    def _take_wrench(self, message: BagMessage) -> None:
        leg = self._legs_by_topic[message.topic]
        stamped = self._bag.decode(message)
        frame = robot_frame(self.robot, leg, stamped.header.frame_id)
        parts = stamped.wrench.force, stamped.wrench.torque
        vectors = np.array([[part.x, part.y, part.z] for part in parts])
        self._wrenches[leg.name] = (message.time, frame.vectors_to_leg(vectors))

    def _take_limits(self, message: BagMessage) -> None:
        """Put recorded effort limits in force, as the node did."""
        limits = self._bag.decode(message)
        counts = [len(limits.joint_names), len(limits.lower), len(limits.upper)]
        if len(set(counts)) > 1:
            raise ValueRangeError(
                f"{message.topic}: got {counts} names, lower, upper limits; allowed: as many each"
            )
        pairs = np.stack([limits.lower, limits.upper], axis=-1)
        known = dict(zip(limits.joint_names, pairs, strict=True))
        legs = {}
        for name, leg in self.robot.legs.items():
            present = zip(leg.joint_names, leg.effort_limits, strict=True)
            rows = np.array([known.get(joint, old) for joint, old in present])
            legs[name] = replace(leg, effort_limits=rows)
        robot = replace(self.robot, legs=legs)
        if not np.array_equal(robot.effort_limits()[1], self.robot.effort_limits()[1]):
            # refuses limits that make no sense
            stream = JointStream(robot, self._friction, self._contact_force)
            self._judged = self.judge()
            self.robot, self._stream = robot, stream
            self.tally.limit_changes += 1

    def _held(self, known: Mapping[str, tuple[int, Any]], name: str, time: int) -> Any:
        """Return the last value of a name, or NaN if there is none or it is too old."""
        when, value = known.get(name, (-HOLD - 1, np.nan))
        return value if time - when <= HOLD else np.full_like(value, np.nan)

    def _note_time(self, time: int) -> None:
        tally = self.tally
        if tally.first is None:
            tally.first = time
        elif tally.last is not None and time - tally.last > self.gap * 1e9:
            tally.gaps += 1
            gaps = [*tally.longest_gaps, (tally.last, time - tally.last)]
            tally.longest_gaps = sorted(gaps, key=lambda gap: -gap[1])[:10]
        tally.last = time

    def _count_missing(self, names: tuple[str, ...], states: LegStates, count: int) -> None:
        for leg, joints in self._stream.layout(names).missing.items():
            self.tally.missing[f"{leg} lacks {', '.join(joints)}"] += count
        if states.legs:
            self.tally.judged += count
        elif not self._stream.layout(names).missing:
            self.tally.foreign += count
            self.tally.foreign_names = names

    # ------------------------------------------------------------------ judgement

    def _judge_stances(self, rows: list[_Row], states: LegStates) -> None:
        load = {}
        for name in self.topics.wrenches:
            force = np.stack([np.broadcast_to(row.wrenches[name], (2, 3))[0] for row in rows])
            load[name] = self.robot.leg(name).mount.vectors_to_base(force)[:, 2]
        time = np.array([row.time for row in rows])
        self.stances.add(self.robot, self._friction, states, load, self._contact_force, time)

    def _judgement(
        self, leg: Leg, rows: list[_Row], states: LegStates, k: int, efforts: FloatArray | None
    ) -> Judgement:
        positions, mechanism = states.joint_positions[k], leg.mechanism
        posture = mechanism.forward(positions)
        excursions = mechanism.passive_joint_excursions(posture)
        unknown: FloatArray = np.full(positions.shape, np.nan)
        force: FloatArray = np.full((len(rows), 3), np.nan)
        required = unknown
        if leg.name in self.topics.wrenches:
            wrench = np.stack([np.broadcast_to(r.wrenches[leg.name], (2, 3)) for r in rows])
            force = wrench[:, 0]
            required = _required_utilisation(leg, posture, force, wrench[:, 1])
        load = leg.mount.vectors_to_base(force)[:, 2]
        touches = load >= self._contact_force
        with np.errstate(divide="ignore", invalid="ignore"):
            load_share = load / states.load_capacity[:, k]
            slope = np.hypot(force[:, 0], force[:, 1]) / force[:, 2]
        return Judgement(
            leg=leg.name,
            message=np.array([row.message for row in rows]),
            time=np.array([row.time for row in rows]),
            stamp=np.array([row.stamp for row in rows]),
            joint_positions=positions,
            status=states.status[:, k],
            foot_position=states.foot_position[:, k],
            foot_velocity=states.foot_velocity[:, k],
            ground_force=states.ground_force[:, k],
            contact=states.contact[:, k],
            condition_number=states.condition_number[:, k],
            load_capacity=states.load_capacity[:, k],
            rated_friction=states.rated_friction[:, k],
            rated_friction_full=states.rated_friction_full[:, k],
            utilisation=states.utilisation[:, k],
            joint_utilisation=unknown if efforts is None else _shares(efforts, leg.effort_limits),
            range_use=_range_use(positions, mechanism.joint_limits),
            passive_range_use=utilisation(excursions, mechanism.passive_joint_limits)[0],
            force=force,
            load=load,
            load_share=load_share,
            friction_used=np.where(touches, slope, np.nan),
            required_utilisation=required,
        )


def _required_utilisation(
    leg: Leg, posture: Posture, force: FloatArray, moment: FloatArray
) -> FloatArray:
    """Return the share of its limit that every joint needs to hold a wrench (T, n)."""
    jacobian = leg.mechanism.jacobian(posture)
    efforts = joint_efforts(jacobian, leg.mechanism.angular_jacobian(posture), force, moment)
    efforts += weight_efforts(leg.mechanism, posture, level_gravity(leg))
    efforts[posture.status != Status.OK] = np.nan
    return _shares(efforts, leg.effort_limits)


def _shares(efforts: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the share of its limit that every joint uses (T, n)."""
    return utilisation(efforts[..., None], limits[:, None, :])[0]


def _range_use(positions: FloatArray, limits: FloatArray) -> FloatArray:
    """Return how far the worst joint is from the middle of its range; 1 is at the end (T,)."""
    middle, half = np.mean(limits, axis=-1), 0.5 * np.ptp(limits, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        use = np.max(np.abs(positions - middle) / half, axis=-1)
    return np.where(np.isfinite(positions).all(axis=-1), use, np.nan)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)
