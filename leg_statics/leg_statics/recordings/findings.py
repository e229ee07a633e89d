# SPDX-License-Identifier: Apache-2.0
"""What stands out in a judged recording, gathered in constant memory while it is read.

For every leg: how far each quantity goes and how often beyond its limit, the worst moments, and
the curves to draw as envelopes, whose bins merge by twos when they become too many. What only a
standing foot has to bear is left out while its wrench tells that it is in the air.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from leg_kinematics.arrays import FloatArray
from leg_kinematics.robot import Robot
from leg_kinematics.status import Status
from leg_statics.recordings.bag_judge import Judgement

WINDOW = 500_000_000  # of several bad moments in this time only the worst is told [ns]
MOST_MOMENTS = 5  # told of each quantity
NOT_OK = "pose not OK"  # curve that is known where a pose is not OK
MOST_BINS = 2000  # of an envelope: more than a diagram has pixels


@dataclass(frozen=True)
class Quantity:
    """Something that is watched.

    Attributes:
        name: Its name in `Judgement`.
        label: Its name for people.
        unit: Its unit; "" for a pure number.
        worse: Whether a high or a low value is worse.
        limit: Beyond it the leg fails or slips; None if it has no limit.
        stance: Whether it counts only while the foot stands, as far as that is known.
        needs: What must be recorded for it besides joint positions; "" for nothing.
    """

    name: str
    label: str
    unit: str
    worse: Literal["high", "low"]
    limit: float | None = None
    stance: bool = False
    needs: str = ""

    @property
    def sign(self) -> float:
        """1 if a high value is worse, otherwise -1."""
        return 1.0 if self.worse == "high" else -1.0


def watched_quantities(friction: float) -> tuple[Quantity, ...]:
    """Return what is watched on a ground with this friction coefficient."""
    efforts, wrench = "efforts in the joint states", "the wrench on the foot"
    bare = (
        ("utilisation", "effort / limit, worst joint", 1.0, False, efforts),
        ("required_utilisation", "effort needed / limit, worst joint", 1.0, True, wrench),
        ("load_share", "load / load capacity", 1.0, True, wrench),
        ("friction_used", "friction used by the foot", friction, True, wrench),
        ("rated_friction", "rated friction mu_e", friction, True, ""),
        ("rated_friction_full", "rated friction mu_e,xy", friction, True, ""),
        ("range_use", "joint range used", 1.0, False, ""),
        ("passive_range_use", "passive joint range used", 1.0, False, ""),
    )
    return (
        *(
            Quantity(name, label, "", "high", limit, stance, needs)
            for name, label, limit, stance, needs in bare
        ),
        Quantity("load_capacity", "load capacity", "N", "low", stance=True),
        Quantity("condition_number", "condition number", "", "high"),
    )


class Moment(NamedTuple):
    """A bad moment.

    Attributes:
        value: Value of the quantity.
        leg: The leg.
        time: When it was recorded [ns].
    """

    value: float
    leg: str
    time: int


class Extent(NamedTuple):
    """How far a quantity of a leg goes.

    Attributes:
        known: How often it is known.
        least: Its least value; NaN if it is never known.
        greatest: Its greatest value; NaN if it is never known.
        beyond: How often it is beyond its limit.
    """

    known: int = 0
    least: float = np.nan
    greatest: float = np.nan
    beyond: int = 0


class Findings:
    """Gathers what stands out.

    Args:
        robot: The robot.
        friction: Friction coefficient of the ground.
        contact_force: A foot with less vertical force is in the air [N].

    Attributes:
        quantities: What is watched.
        statuses: How often each leg had which `Status`.
        extents: Extent of a quantity, by leg and name.
        curves: Curves of each leg.
    """

    def __init__(self, robot: Robot, friction: float, contact_force: float = 10.0) -> None:
        self.contact_force = contact_force
        self._standing: Counter[str] = Counter()
        self.quantities = watched_quantities(friction)
        self.statuses: dict[str, Counter[Status]] = {leg: Counter() for leg in robot.legs}
        self.extents: dict[tuple[str, str], Extent] = {}
        self.curves: dict[str, Envelope] = {}
        self._moments: dict[str, dict[int, Moment]] = {}
        self._joints = {
            leg.name: tuple(joint.name for joint in leg.mechanism.joints)
            for leg in robot.legs.values()
        }

    def add(self, judgements: Sequence[Judgement]) -> None:
        """Take up judgements."""
        for judgement in judgements:
            numbers, counts = np.unique(judgement.status, return_counts=True)
            for number, count in zip(numbers, counts, strict=True):
                self.statuses[judgement.leg][Status(number)] += int(count)
            self._standing[judgement.leg] += int(np.sum(~self._in_air(judgement)))
            for quantity in self.quantities:
                values = self._values(judgement, quantity)
                self._note_extent(judgement.leg, quantity, values)
                self._note_moments(judgement, quantity, values)
            curves = self._curves(judgement)
            if judgement.leg not in self.curves:
                self.curves[judgement.leg] = Envelope(tuple(curves))
            self.curves[judgement.leg].add(judgement.time, np.stack(list(curves.values()), axis=-1))

    def worst(self, quantity: Quantity) -> list[Moment]:
        """Return the worst moments of a quantity, the worst first."""
        return _worst(self._moments.get(quantity.name, {}), quantity)

    def extent(self, leg: str, quantity: Quantity) -> Extent:
        """Return the extent of a quantity."""
        return self.extents.get((leg, quantity.name), Extent())

    def samples(self, leg: str, quantity: Quantity) -> int:
        """Return for how many joint states a quantity counts."""
        return self._standing[leg] if quantity.stance else self.statuses[leg].total()

    def _in_air(self, judgement: Judgement) -> NDArray[np.bool_]:
        """Tell where the wrench tells that the foot is in the air (T,)."""
        return np.asarray(judgement.load < self.contact_force)

    def _values(self, judgement: Judgement, quantity: Quantity) -> FloatArray:
        """Return the values of a quantity that count, NaN for the others (T,)."""
        values: FloatArray = getattr(judgement, quantity.name)
        if values.ndim > 1:
            values = np.max(values, axis=-1)  # the worst joint
        return np.where(self._in_air(judgement), np.nan, values) if quantity.stance else values

    def _note_extent(self, leg: str, quantity: Quantity, values: FloatArray) -> None:
        known = values[~np.isnan(values)]
        if not len(known):
            return
        old = self.extent(leg, quantity)
        beyond = 0
        if quantity.limit is not None:
            beyond = int(np.sum(quantity.sign * (known - quantity.limit) > 0.0))
        self.extents[leg, quantity.name] = Extent(
            old.known + len(known),
            float(np.fmin(old.least, known.min())),
            float(np.fmax(old.greatest, known.max())),
            old.beyond + beyond,
        )

    def _note_moments(self, judgement: Judgement, quantity: Quantity, values: FloatArray) -> None:
        moments = self._moments.setdefault(quantity.name, {})
        known = np.flatnonzero(~np.isnan(values))
        badness = quantity.sign * values[known]
        order = known[np.lexsort((judgement.time[known], -badness))]  # the worst first
        windows, first = np.unique(judgement.time[order] // WINDOW, return_index=True)
        for window, k in zip(windows, order[first], strict=True):
            moment = Moment(float(values[k]), judgement.leg, int(judgement.time[k]))
            moments[window] = _worse(moments.get(window, moment), moment, quantity)
        kept = set(_worst(moments, quantity))
        self._moments[quantity.name] = {k: v for k, v in moments.items() if v in kept}

    def _curves(self, judgement: Judgement) -> dict[str, FloatArray]:
        """Return the values to draw by name."""
        curves = {quantity.name: self._values(judgement, quantity) for quantity in self.quantities}
        curves[NOT_OK] = np.where(judgement.status == Status.OK, np.nan, 1.0)
        curves["force_z"] = judgement.load
        for k, joint in enumerate(self._joints[judgement.leg]):
            curves[f"joint_utilisation {joint}"] = judgement.joint_utilisation[:, k]
            curves[f"required_utilisation {joint}"] = judgement.required_utilisation[:, k]
        return curves


def _worse(one: Moment, other: Moment, quantity: Quantity) -> Moment:
    return other if quantity.sign * (other.value - one.value) > 0.0 else one


def _worst(moments: Mapping[int, Moment], quantity: Quantity) -> list[Moment]:
    order = sorted(
        moments.values(), key=lambda moment: (-quantity.sign * moment.value, moment.time)
    )
    return order[:MOST_MOMENTS]


class Envelope:
    """Least and greatest values of curves in bins of successive samples.

    Args:
        names: Names of the curves (K).

    Attributes:
        names: Names of the curves (K).
        begin, end: Time of the first and last sample of each bin (B,) [ns].
        low, high: Least and greatest values (B, K); NaN where no value is known.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.begin: NDArray[np.int64] = np.empty(0, np.int64)
        self.end: NDArray[np.int64] = np.empty(0, np.int64)
        self.low: FloatArray = np.empty((0, len(names)))
        self.high: FloatArray = np.empty((0, len(names)))
        self._size = 1  # samples in a new bin

    def add(self, times: NDArray[np.int64], values: FloatArray) -> None:
        """Take up samples at times (T,) [ns] with values (T, K), in any order."""
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
        starts = np.arange(0, len(times), self._size)
        ends = np.append(starts[1:], len(times)) - 1
        self.begin = np.concatenate([self.begin, times[starts]])
        self.end = np.concatenate([self.end, times[ends]])
        self.low = np.concatenate([self.low, np.fmin.reduceat(values, starts)])
        self.high = np.concatenate([self.high, np.fmax.reduceat(values, starts)])
        if np.any(np.diff(self.begin) < 0):  # joint states with other names are judged apart
            self._sort()
        while len(self.begin) > MOST_BINS:
            self._merge()

    def _sort(self) -> None:
        order = np.argsort(self.begin, kind="stable")
        self.begin, self.end = self.begin[order], self.end[order]
        self.low, self.high = self.low[order], self.high[order]

    def _merge(self) -> None:
        """Make one bin of each two."""
        starts = np.arange(0, len(self.begin), 2)
        self.end = np.maximum.reduceat(self.end, starts)
        self.begin = self.begin[starts]
        self.low = np.fmin.reduceat(self.low, starts)
        self.high = np.fmax.reduceat(self.high, starts)
        self._size *= 2
