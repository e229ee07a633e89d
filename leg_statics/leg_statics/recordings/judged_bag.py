# SPDX-License-Identifier: Apache-2.0
"""A copy of a recording with the leg states that the statics node would have published."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np
from leg_msgs_py.recordings.bag_types import installed_types
from leg_msgs_py.recordings.bag_writer import BagWriter, offered_qos
from leg_msgs_py.recordings.bags import Bag, BagMessage

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.robot import Robot
from leg_statics.recordings.bag_judge import Judgement
from leg_statics.weight import LEVEL_GRAVITY

LEG_STATES = "leg_msgs/msg/LegStates"
MOST_WAITING = 64 * 2**20  # of copied messages until the states between them are known [B]


class JudgedBag:
    """Writes messages and leg states in the order of their times; use it in a `with` statement.

    Args:
        path: Folder to make.
        bag: The recording that is copied.
        robot: The robot.
        topic: Topic of the leg states.

    Attributes:
        left_out: Topics that cannot be copied, because their type is not known.

    Raises:
        ValueRangeError: If the recording has this topic already.
        BagError: If the folder exists or cannot be made.
    """

    def __init__(self, path: str | os.PathLike[str], bag: Bag, robot: Robot, topic: str) -> None:
        if topic in bag.topics:
            raise ValueRangeError(f"topic {topic} of leg states: the recording has it already")
        self.left_out = [t.name for t in bag.topics.values() if t.type not in bag.types.fielddefs]
        self._types = installed_types([LEG_STATES])
        self._robot = robot
        self._topic = topic
        self._waiting: list[tuple[int, str, Any]] = []
        self._size = 0
        self._writer = BagWriter(path)
        for each in bag.topics.values():
            if each.name not in self.left_out:
                self._writer.copy_topic(each, bag.types)
        self._writer.add_topic(topic, LEG_STATES, offered_qos(10))

    @property
    def full(self) -> bool:
        """Whether so much waits that it should be written now."""
        return self._size >= MOST_WAITING

    def take(self, message: BagMessage) -> None:
        """Take a message to copy."""
        if message.topic not in self.left_out:
            self._waiting.append((message.time, message.topic, message.data))
            self._size += len(message.data)

    def add(self, judgements: Sequence[Judgement]) -> None:
        """Write what waits, and the leg states of the joint states in it."""
        parts: dict[int, list[tuple[Judgement, int]]] = defaultdict(list)
        for judgement in judgements:
            for k, message in enumerate(judgement.message.tolist()):
                parts[message].append((judgement, k))
        waiting, self._waiting, self._size = self._waiting, [], 0
        for rows in parts.values():
            judgement, k = rows[0]
            data = self._types.serialize_cdr(self._leg_states(rows), LEG_STATES)
            waiting.append((int(judgement.time[k]), self._topic, data))
        for time, topic, data in sorted(waiting, key=lambda each: each[0]):  # keeps equal times
            self._writer.write(topic, time, data)

    def _leg_states(self, rows: Sequence[tuple[Judgement, int]]) -> Any:
        """Return the leg states of one joint state, in the order of the robot."""
        judgement, k = rows[0]
        types = self._types.types
        stamp = types["builtin_interfaces/msg/Time"](*divmod(int(judgement.stamp[k]), 10**9))
        header = types["std_msgs/msg/Header"](stamp, self._robot.base_frame)
        gravity = self._vector("Vector3", np.array(LEVEL_GRAVITY))
        return types[LEG_STATES](header, gravity, [self._leg_state(*row) for row in rows])

    def _leg_state(self, judgement: Judgement, k: int) -> Any:
        mount = self._robot.leg(judgement.leg).mount
        velocity, force = (
            self._vector("Vector3", mount.vectors_to_base(vectors[k]))
            for vectors in (judgement.foot_velocity, judgement.ground_force)
        )
        return self._types.types["leg_msgs/msg/LegState"](
            leg=judgement.leg,
            status=int(judgement.status[k]),
            joint_positions=np.ascontiguousarray(judgement.joint_positions[k]),
            foot_position=self._vector("Point", mount.to_base(judgement.foot_position[k])),
            foot_velocity=velocity,
            ground_force=force,
            contact=int(judgement.contact[k]),
            condition_number=float(judgement.condition_number[k]),
            load_capacity=float(judgement.load_capacity[k]),
            rated_friction=float(judgement.rated_friction[k]),
            rated_friction_full=float(judgement.rated_friction_full[k]),
            utilisation=float(judgement.utilisation[k]),
        )

    def _vector(self, kind: str, numbers: FloatArray) -> Any:
        """Return a message of geometry_msgs with x, y, z."""
        return self._types.types[f"geometry_msgs/msg/{kind}"](*numbers.tolist())

    def __enter__(self) -> JudgedBag:
        self._writer.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._writer.__exit__(*error)
