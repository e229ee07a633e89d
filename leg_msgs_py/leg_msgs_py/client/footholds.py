# SPDX-License-Identifier: Apache-2.0
"""What the leg can carry at candidate footholds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import FootholdVerdict
from leg_msgs.msg import Ground as GroundMessage
from leg_msgs.srv import QueryFootholds
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import Points, number, numbers, points, rows, vector
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.errors import InvalidInputError
from leg_msgs_py.frames import Frame, put_frame
from leg_msgs_py.grounds import Ground, ground_message
from numpy.typing import ArrayLike, NDArray

AGAINST_GRAVITY = QueryFootholds.Request.AGAINST_GRAVITY
ALONG_NORMAL = QueryFootholds.Request.ALONG_NORMAL


class Footholds(NamedTuple):
    """Answer of `query_footholds`.

    Attributes:
        verdict: A `leg_msgs/FootholdVerdict` constant each (...,); 0 is feasible.
        status: Status of the poses alone (...,).
        load_capacity: Greatest load (...,) [N].
        rated_friction: mu_e = |F_x| / |F_z|, forward over vertical (...,).
        rated_friction_full: The same with both horizontal components (...,).
        friction_margin: friction_coefficient - rated_friction (...,).
        utilisation: Largest effort / effort limit (...,), 1 = at the limit, for the force with the
            required load for which that is least.
        clearance: How far the foot may move, to first order, before a joint is at a limit
            (...,) [m].
        margin: How far a feasible candidate is from failing (...,), 1 = farthest: the least of what
            is left of load, friction and clearance; NaN if it is not feasible.
        limiting_joint: Index of the joint with that utilisation (...,); -1 where there is none.
        ranking: Flat indices of the feasible candidates, largest margin first.
        best: The first of them; -1 if no candidate is feasible.
        friction_coefficient: Friction coefficients that were used (...,), or one () for all.
        weight_counted: Whether the actuators were asked to hold the leg's own weight, too.
        joint_names: Names of the actuated joints (n); empty unless efforts were asked for.
        joint_efforts: Efforts that hold the required load (..., n) [N.m or N].
        force: Ground reaction that uses the actuators least (..., 3) [N].
    """

    verdict: NDArray[np.uint8]
    status: StatusArray
    load_capacity: FloatArray
    rated_friction: FloatArray
    rated_friction_full: FloatArray
    friction_margin: FloatArray
    utilisation: FloatArray
    clearance: FloatArray
    margin: FloatArray
    limiting_joint: NDArray[np.int32]
    ranking: NDArray[np.int32]
    best: int
    friction_coefficient: FloatArray
    weight_counted: bool
    joint_names: tuple[str, ...]
    joint_efforts: FloatArray
    force: FloatArray

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether the leg carries the required load (...,)."""
        return np.asarray(self.verdict == FootholdVerdict.FEASIBLE)

    @property
    def ranking_by_capacity(self) -> NDArray[np.int64]:
        """Flat indices of the feasible candidates, largest load capacity first.

        The largest capacities are often next to a singularity, where a small error of the foot is
        too much.
        """
        feasible = np.flatnonzero(self.feasible)
        capacity, margin = (np.ravel(v)[feasible] for v in (self.load_capacity, self.margin))
        return feasible[np.lexsort((-margin, -capacity))]


@question("statics", QueryFootholds)
def query_footholds(
    leg: str,
    positions: ArrayLike,
    ground: Ground | str | ArrayLike,
    load: ArrayLike = 0.0,
    *,
    moment: ArrayLike = (0.0, 0.0, 0.0),
    any_direction_moment: ArrayLike = 0.0,
    bias_efforts: ArrayLike = (),
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    along_normal: bool = False,
    radius: float = 0.0,
    frame: Frame | str = "",
    assembly_mode: str = "",
    efforts: bool = False,
) -> Request[Footholds]:
    """Return what the leg can carry at candidate footholds.

    What says (...) may be one for all candidates, or broadcasts with them.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Candidates (..., 3) [m].
        ground: The ground: its name, its friction coefficient (...), or a `Ground` with normals.
        load: Force against gravity that has to be borne (...) [N].
        moment: Moment of the ground on the foot (..., 3) [N.m]; zero on hard ground.
        any_direction_moment: Further moment of unknown direction, across that of the load (...)
            [N.m].
        bias_efforts: Efforts that the actuators exert anyway (..., n) [N.m or N]; () for none.
        gravity: Acceleration of gravity in the frame (3,) [m/s²]; zero is down the frame, or down
            the base frame if it is the leg's own.
        along_normal: Whether loads count along the ground's normal, not against gravity.
        radius: How far from a candidate the foot may come down [m]: the candidate and 12 points
            around it must be feasible.
        frame: Frame of all vectors: the leg's own ("" or its name), the base frame, or a `Frame`
            around the robot.
        assembly_mode: Branch of the closed chain; "" is the default.
        efforts: Whether to return joint efforts and forces, too.
    """
    feet = points("positions", positions)
    request = QueryFootholds.Request(
        legs=[leg] if leg else [],
        positions=to_field(feet.values),
        assembly_mode=assembly_mode,
        ground=ground_message(ground, feet.batch),
        required_load=rows("load", load, feet.batch),
        required_moment=rows("moment", moment, feet.batch, 3),
        any_direction_moment=rows("any_direction_moment", any_direction_moment, feet.batch),
        bias_efforts=_efforts(bias_efforts, feet.batch),
        gravity=vector("gravity", gravity),
        load_direction=ALONG_NORMAL if along_normal else AGAINST_GRAVITY,
        radius=number("radius", radius),
        include_efforts=efforts,
    )
    put_frame(request, frame)

    def decode(response: Any) -> Footholds:
        feet.status(response)
        return _of_leg(response, 0, slice(None), feet.batch)

    return Request(request, decode, feet)


@question("statics", QueryFootholds)
def query_footholds_of_legs(
    positions: Mapping[str, ArrayLike],
    ground: Ground | str | ArrayLike | Mapping[str, Ground | ArrayLike],
    load: ArrayLike | Mapping[str, ArrayLike] = 0.0,
    *,
    moment: ArrayLike | Mapping[str, ArrayLike] = (0.0, 0.0, 0.0),
    any_direction_moment: ArrayLike | Mapping[str, ArrayLike] = 0.0,
    bias_efforts: ArrayLike | Mapping[str, ArrayLike] = (),
    gravity: ArrayLike = (0.0, 0.0, 0.0),
    along_normal: bool = False,
    radius: float = 0.0,
    frame: Frame | str = "",
    assembly_mode: str = "",
    efforts: bool = False,
) -> Request[dict[str, Footholds]]:
    """Return what several legs can carry at candidate footholds, in one request.

    The arguments are those of `query_footholds`, with which the answers are equal. What is given by
    the names of the legs broadcasts with the candidates of each; all else is one for all.

    Args:
        positions: Candidates (..., 3) by the names of the legs [m].
        ground: The ground: its name, its friction coefficient, or a `Ground`; or friction
            coefficients or `Ground`s without names of grounds, by leg.
        load: Force against gravity that has to be borne [N].
        moment: Moment of the ground on the foot (3,) [N.m].
        any_direction_moment: Further moment of unknown direction [N.m].
        bias_efforts: Efforts that the actuators exert anyway [N.m or N]; () for none.
        gravity: Acceleration of gravity in the frame (3,) [m/s²]; zero is down the frame.
        along_normal: Whether loads count along the ground's normal, not against gravity.
        radius: How far from a candidate the foot may come down [m].
        frame: Frame of all vectors: the base frame (""), or a `Frame` around the robot.
        assembly_mode: Branch of the closed chain of all these legs; "" is the default.
        efforts: Whether to return joint efforts and forces, too.

    Returns:
        The answer of each leg by its name; rankings count its own candidates.
    """
    feet = {leg: points(f"positions of {leg}", at) for leg, at in positions.items()}
    for each in feet.values():
        if each.values.shape[-1] not in (0, 3):
            raise InvalidInputError(
                f"{each.field} must have shape (..., 3), got {each.values.shape}"
            )
    if not feet:
        raise InvalidInputError("positions must name at least one leg")
    batches = {leg: each.batch for leg, each in feet.items()}
    table = np.concatenate([each.values.reshape(-1, 3) for each in feet.values()])
    everything = Points("positions", table, (len(table),))
    request = QueryFootholds.Request(
        legs=list(feet),
        candidates=[math.prod(batch) for batch in batches.values()],
        positions=to_field(table),
        assembly_mode=assembly_mode,
        ground=_ground_of_legs(ground, batches),
        required_load=_rows_of_legs("load", load, batches),
        required_moment=_rows_of_legs("moment", moment, batches, 3),
        any_direction_moment=_rows_of_legs("any_direction_moment", any_direction_moment, batches),
        bias_efforts=_efforts_of_legs(bias_efforts, batches),
        gravity=vector("gravity", gravity),
        load_direction=ALONG_NORMAL if along_normal else AGAINST_GRAVITY,
        radius=number("radius", radius),
        include_efforts=efforts,
    )
    put_frame(request, frame)

    def decode(response: Any) -> dict[str, Footholds]:
        everything.status(response)
        ends = np.cumsum([0, *request.candidates]).tolist()
        return {
            leg: _of_leg(response, k, slice(ends[k], ends[k + 1]), batch)
            for k, (leg, batch) in enumerate(batches.items())
        }

    return Request(request, decode, everything)


def _of_leg(response: Any, k: int, part: slice, batch: tuple[int, ...]) -> Footholds:
    """Return the answer of the k-th leg, whose candidates are a part of the rows."""
    start, width = part.start or 0, len(response.joint_names) // len(response.best)
    names = tuple(filter(None, response.joint_names[k * width : (k + 1) * width]))
    ranking = from_field(response.ranking, dtype=np.int32)
    if part.stop is not None:
        ranking = ranking[(start <= ranking) & (ranking < part.stop)] - start
    used = from_field(response.friction_coefficients)
    count = len(response.verdict)
    efforts = from_field(response.joint_efforts, (count, width))[part, : len(names)]
    force = from_field(response.force, (count, 3 if width else 0))[part]

    def column(name: str, kind: Any = np.float64) -> NDArray[Any]:
        return from_field(getattr(response, name), dtype=kind)[part].reshape(batch)

    return Footholds(
        verdict=column("verdict", np.uint8),
        status=column("status", np.uint8),
        load_capacity=column("load_capacity"),
        rated_friction=column("rated_friction"),
        rated_friction_full=column("rated_friction_full"),
        friction_margin=column("friction_margin"),
        utilisation=column("utilisation"),
        clearance=column("clearance"),
        margin=column("margin"),
        limiting_joint=column("limiting_joint", np.int32),
        ranking=ranking,
        best=response.best[k] - start if response.best[k] >= 0 else -1,
        friction_coefficient=used.reshape(()) if len(used) == 1 else used[part].reshape(batch),
        weight_counted=response.weight_counted[k],
        joint_names=names,
        joint_efforts=efforts.reshape(*batch, len(names)),
        force=force.reshape(*batch, force.shape[-1]),
    )


def _efforts(values: ArrayLike, batch: tuple[int, ...]) -> Any:
    """Return efforts (..., n), or none, as a field."""
    array = numbers("bias_efforts", values)
    return rows("bias_efforts", array, batch, *array.shape[-1:]) if array.size else to_field([])


def _efforts_of_legs(values: Any, batches: Mapping[str, tuple[int, ...]]) -> Any:
    """Return efforts of all legs, or of each, as wide as the widest."""
    if not isinstance(values, Mapping):
        return _efforts(values, ())
    arrays = {leg: numbers(f"bias_efforts of {leg}", each) for leg, each in values.items()}
    width = max((array.shape[-1] for array in arrays.values() if array.ndim), default=0)
    padded = {
        leg: np.pad(array, [*[(0, 0)] * (array.ndim - 1), (0, width - array.shape[-1])])
        if array.ndim
        else array
        for leg, array in arrays.items()
    }
    return _rows_of_legs("bias_efforts", padded, batches, width)


def _rows_of_legs(
    field: str, values: Any, batches: Mapping[str, tuple[int, ...]], *trailing: int
) -> Any:
    """Return one value for all legs, or those that are given by leg, as a field."""
    if not isinstance(values, Mapping):
        return rows(field, values, (), *trailing)
    if set(values) != set(batches):
        raise InvalidInputError(
            f"{field}: given for the legs {', '.join(map(str, values))}; allowed: one for all, or "
            f"one for each of {', '.join(batches)}"
        )
    parts = []
    for leg, batch in batches.items():
        array = numbers(f"{field} of {leg}", values[leg])
        try:
            parts.append(np.broadcast_to(array, (*batch, *trailing)).reshape(-1, *trailing))
        except ValueError as error:
            raise InvalidInputError(f"{field} of {leg}: {error}") from None
    return to_field(np.concatenate(parts))


def _ground_of_legs(ground: Any, batches: Mapping[str, tuple[int, ...]]) -> Any:
    """Return one ground for all legs, or one that is given by leg, as a message."""
    if not isinstance(ground, Mapping):
        return ground_message(ground)
    grounds = {
        leg: each if isinstance(each, Ground) else Ground(each) for leg, each in ground.items()
    }
    for leg, each in grounds.items():
        if isinstance(each.friction, str):
            raise InvalidInputError(
                f"ground of {leg}: got the name {each.friction!r}; allowed by leg: friction "
                "coefficients; a name is for all legs"
            )
    message = GroundMessage()
    frictions = {leg: each.friction for leg, each in grounds.items()}
    message.friction_coefficients = _rows_of_legs("ground", frictions, batches)
    normals = {leg: each.normal for leg, each in grounds.items()}
    given = [normal is not None for normal in normals.values()]
    if any(given) and not all(given):
        raise InvalidInputError("ground: normals must be given for all legs or for none")
    if any(given):
        message.normals = _rows_of_legs("ground", normals, batches, 3)
    return message
