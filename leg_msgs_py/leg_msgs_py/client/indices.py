# SPDX-License-Identifier: Apache-2.0
"""Performance indices at foot positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from leg_msgs.srv import EvaluateIndices
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field, to_field
from leg_msgs_py.client.inputs import points
from leg_msgs_py.client.questions import Request, question
from leg_msgs_py.frames import Frame, put_frame
from numpy.typing import ArrayLike


class Indices(NamedTuple):
    """Answer of `evaluate_indices`.

    Attributes:
        values: Values (..., K) in the order of `names`.
        status: Status of each point (...,).
        names: Names of the indices (K).
        symbols: The literature's symbols (K).
        units: SI units (K).
    """

    values: FloatArray
    status: StatusArray
    names: tuple[str, ...]
    symbols: tuple[str, ...]
    units: tuple[str, ...]


@question("statics", EvaluateIndices)
def evaluate_indices(
    leg: str,
    positions: ArrayLike,
    names: Sequence[str] = (),
    *,
    frame: Frame | str = "",
    assembly_mode: str = "",
) -> Request[Indices]:
    """Return performance indices at foot positions.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        positions: Foot (..., t) [m].
        names: Names of the indices; none for all that the leg has.
        frame: Frame of the positions: the leg's own ("" or its name), the base frame, or a `Frame`.
        assembly_mode: Branch of the closed chain; "" is the default.
    """
    feet = points("positions", positions)
    request = EvaluateIndices.Request(
        leg=leg, positions=to_field(feet.values), assembly_mode=assembly_mode, names=list(names)
    )
    put_frame(request, frame)

    def decode(response: Any) -> Indices:
        status = feet.status(response)
        return Indices(
            values=from_field(response.values, (*feet.batch, len(response.names))),
            status=status,
            names=tuple(response.names),
            symbols=tuple(response.symbols),
            units=tuple(response.units),
        )

    return Request(request, decode, feet)
