"""The table of a judged recording: a row for each leg at each joint state, as Parquet or CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.csv  # type: ignore[import-untyped]
import pyarrow.parquet  # type: ignore[import-untyped]

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import ValueRangeError
from leg_kinematics.robot import Robot
from leg_kinematics.status import Status
from leg_statics.bag_judge import Judgement

SUFFIXES = (".parquet", ".csv")


class Column(NamedTuple):
    """A column of numbers.

    Attributes:
        name: Its name.
        unit: Its unit; "1" for a share or another pure number.
        doc: What it tells.
    """

    name: str
    unit: str
    doc: str


# Values that `Judgement` has once for each row, under the same name.
PLAIN = (
    Column("condition_number", "1", "condition number of the foot Jacobian"),
    Column("load_capacity", "N", "greatest vertical ground reaction on the ground given"),
    Column("rated_friction", "1", "mu_e, the friction that the ground must offer"),
    Column("utilisation", "1", "share of its effort limit that the worst joint uses"),
    Column("range_use", "1", "share of its range, from the middle, that the worst joint uses"),
    Column("passive_range_use", "1", "share of its excursion that the worst passive joint uses"),
    Column("load_share", "1", "vertical ground reaction / load capacity"),
    Column("friction_used", "1", "horizontal / vertical ground reaction"),
)
VECTORS = (
    Column("foot_position", "m", "foot in the leg frame"),
    Column("foot_velocity", "m/s", "velocity of the foot in the leg frame"),
    Column("force", "N", "ground reaction on the foot in the leg frame"),
)
JOINTS = (
    Column("joint_positions", "rad or m", "position"),
    Column("joint_utilisation", "1", "share of the effort limit that is used"),
    Column("required_utilisation", "1", "share of the effort limit that the wrench needs"),
)


class JudgeTable:
    """Writes judgements as they come; use it in a `with` statement.

    Args:
        path: File to write, .parquet or .csv.
        robot: The robot.

    Raises:
        ValueRangeError: If the suffix is another.
    """

    def __init__(self, path: Path, robot: Robot) -> None:
        check_suffix(path)
        self._robot = robot
        self._schema = _schema(robot)
        writer = pa.csv.CSVWriter if path.suffix == ".csv" else pa.parquet.ParquetWriter
        self._writer: Any = writer(path, self._schema)

    def add(self, judgements: Sequence[Judgement]) -> None:
        """Write rows in the order of the joint states, those of one of them by leg."""
        if not judgements:
            return
        table = pa.concat_tables([self._rows(judgement) for judgement in judgements])
        legs = list(self._robot.legs)
        leg = np.concatenate([np.full(len(j.time), legs.index(j.leg)) for j in judgements])
        message = np.concatenate([judgement.message for judgement in judgements])
        self._writer.write_table(table.take(np.lexsort((leg, message))))

    def _rows(self, judgement: Judgement) -> pa.Table:
        count = len(judgement.time)
        status = np.array([status.name for status in Status])[judgement.status]
        values: dict[str, Any] = {
            "message": judgement.message,
            "time": judgement.time,
            "stamp": judgement.stamp,
            "leg": np.full(count, judgement.leg),
            "status": status,
            **{column.name: getattr(judgement, column.name) for column in PLAIN},
        }
        for column in VECTORS:
            for k, axis in enumerate("xyz"):
                values[f"{column.name}_{axis}"] = getattr(judgement, column.name)[:, k]
        mechanism = self._robot.leg(judgement.leg).mechanism
        for column in JOINTS:
            for k, joint in enumerate(mechanism.joints):
                values[f"{column.name}_{joint.name}"] = getattr(judgement, column.name)[:, k]
        unknown: FloatArray = np.full(count, np.nan)
        arrays = [
            pa.array(values.get(field.name, unknown), field.type, from_pandas=True)
            for field in self._schema
        ]
        return pa.Table.from_arrays(arrays, schema=self._schema)

    def __enter__(self) -> JudgeTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()


def check_suffix(path: Path) -> None:
    """Raise a ValueRangeError if a table cannot have this name."""
    if path.suffix not in SUFFIXES:
        raise ValueRangeError(f"table {path}: got {path.suffix!r}; allowed: {', '.join(SUFFIXES)}")


def _schema(robot: Robot) -> pa.Schema:
    joints = dict.fromkeys(
        joint.name for leg in robot.legs.values() for joint in leg.mechanism.joints
    )
    numbers = [
        *PLAIN,
        *_each(VECTORS, "xyz"),
        *_each(JOINTS, joints),
    ]
    return pa.schema(
        [
            _field("message", pa.int64(), "1", "number of the joint state, from 0"),
            _field("time", pa.int64(), "ns", "when it was recorded"),
            _field("stamp", pa.int64(), "ns", "its stamp"),
            _field("leg", pa.string(), "", "name of the leg"),
            _field("status", pa.string(), "", "status of the pose, of leg_msgs/PointStatus"),
            *(_field(column.name, pa.float64(), column.unit, column.doc) for column in numbers),
        ]
    )


def _each(columns: Sequence[Column], parts: Iterable[str]) -> list[Column]:
    """Return a column for each part of columns that have several."""
    return [
        Column(f"{column.name}_{part}", column.unit, f"{column.doc}: {part}")
        for column in columns
        for part in parts
    ]


def _field(name: str, kind: Any, unit: str, doc: str) -> pa.Field:
    return pa.field(name, kind, metadata={"unit": unit, "doc": doc})
