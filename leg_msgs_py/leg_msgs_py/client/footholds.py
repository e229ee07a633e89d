# SPDX-License-Identifier: Apache-2.0
"""What the leg can carry at candidate footholds."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from leg_msgs.msg import FootholdVerdict
from leg_msgs.srv import QueryFootholds
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import number, numbers, points, vector
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.grounds import Ground, ground_message
from numpy.typing import ArrayLike, NDArray


class Footholds(NamedTuple):
    """Answer of `query_footholds`.

    Attributes:
        verdict: A `leg_msgs/FootholdVerdict` constant each (...,); 0 is feasible.
        status: Status of the poses alone (...,).
        load_capacity: Greatest vertical force (...,) [N].
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
        friction_coefficient: Friction coefficient that was used.
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
    friction_coefficient: float
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
    ground: Ground | str | float,
    load: float = 0.0,
    *,
    moment: ArrayLike = (0.0, 0.0, 0.0),
    any_direction_moment: float = 0.0,
    bias_efforts: ArrayLike = (),
    radius: float = 0.0,
    frame: str = "",
    efforts: bool = False,
) -> Request[Footholds]:
    """Return what the leg can carry at candidate footholds.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Candidates (..., 3) [m].
        ground: The ground: its name, its friction coefficient, or a `Ground` with a normal.
        load: Vertical force, along z of the base frame, that has to be borne [N].
        moment: Moment of the ground on the foot (3,) [N.m]; zero on hard ground.
        any_direction_moment: Further horizontal moment of unknown direction [N.m].
        bias_efforts: Efforts that the actuators exert anyway (n,) [N.m or N]; () for none.
        radius: How far from a candidate the foot may come down [m]: the candidate and 12 points
            around it must be feasible.
        frame: Frame of all vectors: the leg's own ("" or its name) or the base frame.
        efforts: Whether to return joint efforts and forces, too.
    """
    feet = points("positions", positions)
    request = QueryFootholds.Request(
        leg=leg,
        positions=to_field(feet.values),
        ground=ground_message(ground),
        required_load=number("load", load),
        required_moment=vector("moment", moment),
        any_direction_moment=number("any_direction_moment", any_direction_moment),
        bias_efforts=to_field(numbers("bias_efforts", bias_efforts)),
        radius=number("radius", radius),
        include_efforts=efforts,
    )
    request.header.frame_id = frame

    def decode(response: Any) -> Footholds:
        status = feet.status(response)
        names = tuple(response.joint_names)
        return Footholds(
            verdict=from_field(response.verdict, feet.batch, np.uint8),
            status=status,
            load_capacity=from_field(response.load_capacity, feet.batch),
            rated_friction=from_field(response.rated_friction, feet.batch),
            rated_friction_full=from_field(response.rated_friction_full, feet.batch),
            friction_margin=from_field(response.friction_margin, feet.batch),
            utilisation=from_field(response.utilisation, feet.batch),
            clearance=from_field(response.clearance, feet.batch),
            margin=from_field(response.margin, feet.batch),
            limiting_joint=from_field(response.limiting_joint, feet.batch, np.int32),
            ranking=from_field(response.ranking, dtype=np.int32),
            best=response.best,
            friction_coefficient=response.friction_coefficient,
            joint_names=names,
            joint_efforts=from_field(response.joint_efforts, (*feet.batch, len(names))),
            force=from_field(response.force, (*feet.batch, 3 if efforts else 0)),
        )

    return Request(request, decode, feet)
