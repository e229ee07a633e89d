# SPDX-License-Identifier: Apache-2.0
"""Make the recordings that the tests play and judge: walks that nobody had to record.

    python tools/make_golden_bags.py [FOLDER]      (default: tests/bags)

- hexapod_tripod: six legs in two tripods, with efforts, foot wrenches and diagnostics.
- quadruped_trot: four legs with cylinders in two diagonals, with efforts.
- hexapod_faults: the hexapod's walk with all that goes wrong on a robot; see `FAULTS`.
- rough_terrain: a height map as a point cloud with friction, and a body that goes over it.

The same call makes the same messages. Joints are told in steps of an encoder, which hides the last
bits that differ from one processor to the next, and packs well.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from leg_msgs_py.recordings.bag_types import installed_types
from leg_msgs_py.recordings.bag_writer import BagWriter, offered_qos

from leg_kinematics import load_robot
from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Leg, Robot
from leg_kinematics.status import Status
from leg_statics.efforts import joint_efforts
from leg_statics.gait import foot_path, ground_reaction

FOLDER = Path(__file__).resolve().parent.parent / "tests" / "bags"
START = 1_700_000_000_000_000_000  # when the recordings begin [ns]
LATENCY = 400_000  # from the stamp of a message until it is recorded [ns]
POSITION_STEP = 2.0**-20  # of encoders [rad or m]
RATE_STEP = 2.0**-10  # [rad/s or m/s]
EFFORT_STEP = 2.0**-6  # [N.m or N]
FORCE_STEP = 2.0**-4  # [N]

JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
CLOUD = "sensor_msgs/msg/PointCloud2"
POSE = "geometry_msgs/msg/PoseStamped"
TYPES = installed_types([JOINT_STATE, WRENCH, DIAGNOSTICS, CLOUD, POSE])
TERRAIN_STEP = 0.04  # spacing of the height map [m]
# Place x, y, height and width of stones [m].
STONES = np.random.default_rng(2).uniform(
    [-0.5, -0.8, 0.01, 0.04], [0.85, 0.8, 0.06, 0.1], size=(60, 4)
)


@dataclass(frozen=True)
class Walk:
    """A gait on level ground: straight stances at constant height, and the legs' turns.

    Attributes:
        robot: Name of the robot.
        groups: Legs that stand together; the groups take turns.
        height: z of the standing feet in the leg frames [m].
        stride: Length of a stance [m].
        lift: How high a foot is lifted [m].
        period: Time of a cycle [s].
        weight: Weight of the robot, which the standing legs share [N].
        duration: Time of the recording [s].
        rate: Joint states in a second [Hz].
    """

    robot: str
    groups: tuple[tuple[str, ...], ...]
    height: float
    stride: float
    lift: float
    period: float
    weight: float
    duration: float
    rate: float


TRIPOD = Walk(
    "hexapod",
    (
        ("left_front", "left_rear", "right_middle"),
        ("right_front", "right_rear", "left_middle"),
    ),
    height=-0.6,
    stride=0.2,
    lift=0.06,
    period=1.6,
    weight=1200.0,
    duration=6.0,
    rate=50.0,
)
TROT = Walk(
    "quadruped",
    (("left_front", "right_rear"), ("right_front", "left_rear")),
    height=-0.75,
    stride=0.16,
    lift=0.05,
    period=0.8,
    weight=1000.0,
    duration=6.0,
    rate=50.0,
)


class Sample(NamedTuple):
    """What the joints and feet of a robot do at some instants (T).

    Attributes:
        times: Times since the start (T,) [s].
        names: Joint names (N).
        positions, velocities, efforts: Of the joints (T, N).
        forces: Ground reaction on each foot, in its leg frame (T, 3) [N].
    """

    times: FloatArray
    names: tuple[str, ...]
    positions: FloatArray
    velocities: FloatArray
    efforts: FloatArray
    forces: Mapping[str, FloatArray]


class Record(NamedTuple):
    """A message to write: topic, time of recording [ns] and content."""

    topic: str
    time: int
    data: Any


# --------------------------------------------------------------------------- gait


def sample_walk(walk: Walk) -> Sample:
    """Return what the joints do in a walk."""
    robot = load_robot(walk.robot)
    times = np.arange(round(walk.duration * walk.rate)) / walk.rate
    parts, forces = [], {}
    for group, legs in enumerate(walk.groups):
        phase = (times / walk.period + group / len(walk.groups)) % 1.0
        for name in legs:
            forces[name] = _rounded(ground_reaction(phase, walk.weight / len(legs)), FORCE_STEP)
            parts.append((robot.leg(name), _joints(robot.leg(name), walk, phase, forces[name])))
    parts.sort(key=lambda part: list(robot.legs).index(part[0].name))
    names = tuple(joint for leg, _ in parts for joint in leg.joint_names)
    positions, velocities, efforts = np.concatenate([values for _, values in parts], axis=-1)
    forces = {leg.name: forces[leg.name] for leg, _ in parts}
    return Sample(times, names, positions, velocities, efforts, forces)


def _foot(walk: Walk, leg: Leg, phase: FloatArray) -> FloatArray:
    """Return the foot in the leg frame (T, 3) [m]."""
    neutral = leg.mechanism.initial_posture.foot_position.copy()
    neutral[2] = walk.height
    return foot_path(neutral, phase, walk.stride, walk.lift)


def _joints(leg: Leg, walk: Walk, phase: FloatArray, force: FloatArray) -> FloatArray:
    """Return positions, velocities and efforts of the joints of a leg (3, T, n)."""
    posture = leg.mechanism.inverse(_foot(walk, leg, phase))
    if not (posture.status == Status.OK).all():
        raise ValueError(f"{leg.name} of the {walk.robot} cannot walk like that")
    jacobian = leg.mechanism.jacobian(posture)
    later = leg.mechanism.inverse(_foot(walk, leg, (phase + 1e-6 / walk.period) % 1.0))
    rates = (later.joint_positions - posture.joint_positions) / 1e-6
    efforts = joint_efforts(jacobian, leg.mechanism.angular_jacobian(posture), force)
    return np.stack(
        [
            _rounded(posture.joint_positions, POSITION_STEP),
            _rounded(rates, RATE_STEP),
            _rounded(efforts, EFFORT_STEP),
        ]
    )


def _rounded(values: FloatArray, step: float) -> FloatArray:
    return np.round(values / step) * step


# --------------------------------------------------------------------------- messages


def _new(type_name: str, *fields: Any) -> Any:
    return TYPES.types[type_name](*fields)


def _header(stamp: int, frame: str = "") -> Any:
    time = _new("builtin_interfaces/msg/Time", *divmod(stamp, 10**9))
    return _new("std_msgs/msg/Header", time, frame)


def joint_state(
    stamp: int,
    names: Sequence[str],
    positions: FloatArray,
    velocities: FloatArray,
    efforts: FloatArray,
) -> Any:
    """Return a sensor_msgs/JointState; stamp in ns."""
    return _new(JOINT_STATE, _header(stamp), list(names), positions, velocities, efforts)


def _wrench(stamp: int, frame: str, force: FloatArray) -> Any:
    zero = _new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
    vector = _new("geometry_msgs/msg/Vector3", *map(float, force))
    return _new(WRENCH, _header(stamp, frame), _new("geometry_msgs/msg/Wrench", vector, zero))


def _diagnostics(stamp: int, level: int, message: str, temperature: float) -> Any:
    value = _new("diagnostic_msgs/msg/KeyValue", "temperature [C]", f"{temperature:.1f}")
    status = _new(
        "diagnostic_msgs/msg/DiagnosticStatus", level, "/drives: motors", message, "drives", [value]
    )
    return _new(DIAGNOSTICS, _header(stamp), [status])


def _stamps(sample: Sample) -> list[int]:
    return [START + round(time * 1e9) for time in sample.times]


def joint_records(sample: Sample) -> Iterator[Record]:
    """Yield the joint states of a walk."""
    rows = zip(sample.positions, sample.velocities, sample.efforts, strict=True)
    for stamp, row in zip(_stamps(sample), rows, strict=True):
        yield Record("/joint_states", stamp + LATENCY, joint_state(stamp, sample.names, *row))


def wrench_records(sample: Sample, robot: Robot) -> Iterator[Record]:
    """Yield the foot wrenches of a walk, a moment before the joint states of the same stamp."""
    for leg, forces in sample.forces.items():
        for stamp, force in zip(_stamps(sample), forces, strict=True):
            message = _wrench(stamp, robot.leg(leg).frame, force)
            yield Record(f"/{leg}/wrench", stamp + LATENCY // 2, message)


def diagnostic_records(sample: Sample) -> Iterator[Record]:
    """Yield the diagnostics of drives that get warm."""
    for second in range(int(sample.times[-1]) + 1):
        stamp, warm = START + second * 10**9, second >= 4
        message = _diagnostics(stamp, int(warm), "warm" if warm else "ok", 58.0 + second)
        yield Record("/diagnostics", stamp + 2 * LATENCY, message)


# --------------------------------------------------------------------------- faults


def _nan(message: Any) -> None:
    message.position[3] = np.nan  # left_middle


def _infinite(message: Any) -> None:
    message.position[0] = np.inf  # left_front


def _missing_joint(message: Any) -> None:
    message.name.pop()  # the last of right_rear
    for field in ("position", "velocity", "effort"):
        setattr(message, field, getattr(message, field)[:-1])


def _repeated_name(message: Any) -> None:
    message.name[1] = message.name[0]


def _short_position(message: Any) -> None:
    message.position = message.position[:-1]


def _no_names(message: Any) -> None:
    message.name.clear()


def _other_robot(message: Any) -> None:
    message.name = [f"arm_{k}" for k in range(len(message.name))]


def _beyond_limits(message: Any) -> None:
    message.position[15] = 0.5  # right_rear: its range ends at 21 degrees


def _same_stamp(message: Any) -> None:
    message.header = _header(_stamp(message) - 20_000_000)


def _late(message: Any) -> None:
    message.header = _header(_stamp(message) - 70_000_000)


def _clock_ahead(message: Any) -> None:
    message.header = _header(_stamp(message) + 30 * 10**9)


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


# What goes wrong in hexapod_faults, and in which joint states of the walk.
FAULTS: dict[str, tuple[Callable[[Any], None], Sequence[int]]] = {
    "NaN": (_nan, range(20, 25)),
    "infinite": (_infinite, range(30, 32)),
    "missing joint": (_missing_joint, range(40, 46)),
    "repeated name": (_repeated_name, range(50, 53)),
    "too few positions": (_short_position, range(55, 57)),
    "no names": (_no_names, range(60, 61)),
    "another robot": (_other_robot, range(62, 66)),
    "beyond the joint limits": (_beyond_limits, range(70, 73)),
    "duplicate stamp": (_same_stamp, range(80, 81)),
    "out of order": (_late, range(90, 91)),
    "clock ahead by 30 s": (_clock_ahead, range(100, 105)),
}
LOST = range(120, 145)  # joint states that are missing
GARBLED = 110  # one whose content is cut off


def faulty_records(sample: Sample) -> Iterator[Record]:
    """Yield the joint states of a walk with `FAULTS`."""
    spoil = {k: fault for fault, where in FAULTS.values() for k in where}
    for k, record in enumerate(joint_records(sample)):
        if k in LOST:
            continue
        if k in spoil:
            spoil[k](record.data)
        if k == GARBLED:
            data = bytes(TYPES.serialize_cdr(record.data, JOINT_STATE)[:100])
            record = record._replace(data=data)
        yield record


# --------------------------------------------------------------------------- terrain


def rough_terrain() -> FloatArray:
    """Return points of a strip of ground (N, 3) [m]: rubble, stairs, a slope and a gap.

    Some are missing, as a camera does not see everything.
    """
    x, y = np.meshgrid(
        np.arange(-0.6, 3.0, TERRAIN_STEP), np.arange(-0.8, 0.8 + TERRAIN_STEP, TERRAIN_STEP)
    )
    rubble = np.sum(
        [
            size * np.exp(-((x - a) ** 2 + (y - b) ** 2) / wide**2)
            for a, b, size, wide in STONES.tolist()
        ],
        axis=0,
    )
    stairs = 0.08 * np.clip(np.floor((x - 0.9) / 0.3) + 1.0, 0.0, 3.0)
    slope = -0.24 * np.clip((x - 1.8) / 0.8, 0.0, 1.0)
    height = rubble + stairs + slope
    points = np.stack([x, y, height], axis=-1).reshape(-1, 3)
    gap = (points[:, 0] > 2.6) & (points[:, 0] < 2.75)
    unseen = np.random.default_rng(5).random(len(points)) < 0.02
    return _rounded(points[~gap & ~unseen], POSITION_STEP)


def terrain_records() -> Iterator[Record]:
    """Yield a height map and the poses of a body that goes over it."""
    points = rough_terrain()
    friction = np.where(np.abs(points[:, 1] + 0.4) < 0.15, 0.1, 0.5)  # a wet strip
    yield Record("/terrain", START, _cloud(START, "map", points, friction))
    for k in range(5):
        stamp, angle = START + k * 10**9, 0.5 * 0.04 * k
        pose = _new(
            "geometry_msgs/msg/Pose",
            _new("geometry_msgs/msg/Point", 0.15 * k, 0.0, 0.66 + 0.02 * k),
            _new("geometry_msgs/msg/Quaternion", 0.0, -np.sin(angle), 0.0, np.cos(angle)),
        )
        yield Record("/base_pose", stamp + LATENCY, _new(POSE, _header(stamp, "map"), pose))


def _cloud(stamp: int, frame: str, points: FloatArray, friction: FloatArray) -> Any:
    """Return a sensor_msgs/PointCloud2 with the fields x, y, z and friction."""
    table = np.column_stack([points, friction]).astype("<f4")
    fields = [
        _new("sensor_msgs/msg/PointField", name, 4 * k, 7, 1)
        for k, name in enumerate(("x", "y", "z", "friction"))
    ]
    data = np.frombuffer(table.tobytes(), np.uint8)
    size = len(points)
    return _new(CLOUD, _header(stamp, frame), 1, size, fields, False, 16, 16 * size, data, True)


# --------------------------------------------------------------------------- recordings


def write_bag(path: Path, records: Sequence[Record]) -> None:
    """Write a recording; its topics are those of the records."""
    reliable, sensors = offered_qos(10), offered_qos(5, reliable=False)
    types = {
        "/joint_states": (JOINT_STATE, reliable),
        "/diagnostics": (DIAGNOSTICS, reliable),
        "/terrain": (CLOUD, reliable),
        "/base_pose": (POSE, reliable),
    }
    with BagWriter(path) as bag:
        for topic in dict.fromkeys(record.topic for record in records):
            bag.add_topic(topic, *types.get(topic, (WRENCH, sensors)))
        for record in sorted(records, key=lambda record: record.time):
            data = record.data
            if not isinstance(data, bytes):
                data = TYPES.serialize_cdr(data, types.get(record.topic, (WRENCH,))[0])
            bag.write(record.topic, record.time, data)


def make_bags(folder: Path) -> None:
    """Make all recordings in a folder.

    Raises:
        BagError: If one of them is there already.
    """
    tripod, trot = sample_walk(TRIPOD), sample_walk(TROT)
    hexapod = load_robot(TRIPOD.robot)
    write_bag(
        folder / "hexapod_tripod",
        [*joint_records(tripod), *wrench_records(tripod, hexapod), *diagnostic_records(tripod)],
    )
    write_bag(folder / "quadruped_trot", list(joint_records(trot)))
    write_bag(folder / "hexapod_faults", list(faulty_records(tripod)))
    write_bag(folder / "rough_terrain", list(terrain_records()))


if __name__ == "__main__":
    make_bags(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
