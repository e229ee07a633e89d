# SPDX-License-Identifier: Apache-2.0
"""The tables of a judged recording, as Parquet or CSV.

One has a row for each leg at each joint state, the other a row for each query of a planner.
"""

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
from leg_statics.footholds import Verdict
from leg_statics.leg_state import ContactState
from leg_statics.recordings.bag_judge import Judgement
from leg_statics.recordings.query_judge import Query

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
    Column("rated_friction", "1", "mu_e, the friction that the ground must offer, forward"),
    Column("rated_friction_full", "1", "mu_e,xy, the same with both horizontal components"),
    Column("utilisation", "1", "share of its effort limit that the worst joint uses"),
    Column("range_use", "1", "share of its range, from the middle, that the worst joint uses"),
    Column("passive_range_use", "1", "share of its excursion that the worst passive joint uses"),
    Column("load", "N", "vertical component of the ground reaction"),
    Column("load_share", "1", "load / load capacity"),
    Column("friction_used", "1", "horizontal / vertical ground reaction"),
)
VECTORS = (
    Column("foot_position", "m", "foot in the leg frame"),
    Column("foot_velocity", "m/s", "velocity of the foot in the leg frame"),
    Column("force", "N", "ground reaction on the foot in the leg frame"),
    Column("ground_force", "N", "what the joint efforts tell of it, in the leg frame"),
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
        self._writer = _writer(path, self._schema)

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
        contact = np.array([state.name for state in ContactState])[judgement.contact]
        values: dict[str, Any] = {
            "message": judgement.message,
            "time": judgement.time,
            "stamp": judgement.stamp,
            "leg": np.full(count, judgement.leg),
            "status": status,
            "contact": contact,
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


class QueryTable:
    """Writes judged queries as they come; use it in a `with` statement.

    Args:
        path: File to write, .parquet or .csv.
    """

    def __init__(self, path: Path) -> None:
        self._schema = pa.schema(
            [
                _field("service", pa.string(), "", "name of the service"),
                _field("legs", pa.string(), "", "legs of the request; empty: all, or the only one"),
                _field("time", pa.int64(), "ns", "when the request was recorded"),
                _field("seconds", pa.float64(), "s", "from the request to the response"),
                _field("refused", pa.string(), "", "name of the recorded error, if any"),
                _field("reason", pa.string(), "", "the message that came with it"),
                _field("points", pa.int64(), "1", "foot or joint positions, or legs times heights"),
                _field("feasible", pa.int64(), "1", "those with a pose, feasible, or with a step"),
                _field("best", pa.float64(), "N or m", "load capacity, or longest common step"),
                *(
                    _field(verdict.name.lower(), pa.int64(), "1", "footholds with this verdict")
                    for verdict in Verdict
                    if verdict != Verdict.FEASIBLE
                ),
                _field("exact", pa.bool_(), "", "the answer is the recorded one, bit for bit"),
                _field("difference", pa.string(), "", "first field that is not the recorded one"),
            ]
        )
        self._writer = _writer(path, self._schema)

    def add(self, queries: Sequence[Query]) -> None:
        """Write a row for each query."""
        rows = [
            {
                **query._asdict(),
                **query.answer._asdict(),
                **{each.name.lower(): query.answer.verdicts[each] for each in Verdict},
                "feasible": query.answer.feasible,
                "difference": query.difference.field if query.difference else "",
            }
            for query in queries
        ]
        self._writer.write_table(pa.Table.from_pylist(rows, schema=self._schema))

    def __enter__(self) -> QueryTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.close()


def check_suffix(path: Path) -> None:
    """Raise a ValueRangeError if a table cannot have this name."""
    if path.suffix not in SUFFIXES:
        raise ValueRangeError(f"table {path}: got {path.suffix!r}; allowed: {', '.join(SUFFIXES)}")


def _writer(path: Path, schema: pa.Schema) -> Any:
    """Return what writes a table, by the suffix of its file."""
    kind = pa.csv.CSVWriter if path.suffix == ".csv" else pa.parquet.ParquetWriter
    return kind(path, schema)


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
            _field("contact", pa.string(), "", "what ground_force tells, of leg_msgs/LegState"),
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
