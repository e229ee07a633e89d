# SPDX-License-Identifier: Apache-2.0
"""Index maps: of a plane at once, of a whole workspace with progress."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from leg_msgs.action import ComputeIndexMap
from leg_msgs.srv import GetIndexMap
from leg_msgs_py.arrays import FloatArray, StatusArray, from_field
from leg_msgs_py.client.inputs import number
from leg_msgs_py.client.questions import Goal, Request, order, question
from leg_msgs_py.clouds import from_cloud
from leg_msgs_py.grounds import Ground, ground_message


class IndexMap(NamedTuple):
    """Answer of `index_map`: layers over a plane of the leg's own frame.

    Attributes:
        x: Grid coordinates along x (nx,) [m].
        y: Grid coordinates along y (ny,) [m].
        height: z of the plane [m].
        layers: Names of the layers (K).
        symbols: The literature's symbols (K).
        units: SI units (K).
        values: Values (ny, nx, K); NaN outside the workspace.
        status: Status of each point (ny, nx).
    """

    x: FloatArray
    y: FloatArray
    height: float
    layers: tuple[str, ...]
    symbols: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    status: StatusArray

    def layer(self, name: str) -> FloatArray:
        """Return the values of one layer (ny, nx)."""
        return self.values[..., self.layers.index(name)]


class IndexCloud(NamedTuple):
    """Answer of `compute_index_map`: layers at the N grid points within the workspace.

    Attributes:
        positions: The points (N, 3) [m].
        layers: Names of the layers (K).
        units: SI units (K).
        values: Values (N, K), to single precision; NaN where a layer is not defined.
        frame: Frame of the points.
        fraction: Share of the workspace that is covered, less than 1 if it was cancelled.
        elapsed: Time that the work took [s].
    """

    positions: FloatArray
    layers: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    frame: str
    fraction: float
    elapsed: float

    def layer(self, name: str) -> FloatArray:
        """Return the values of one layer (N,)."""
        return self.values[:, self.layers.index(name)]


class MapProgress(NamedTuple):
    """Progress of `compute_index_map`.

    Attributes:
        fraction: Share of the workspace computed so far, 0 to 1.
        elapsed: Time since the goal was accepted [s].
        remaining: Estimated time until the end [s]; NaN while it is not known.
        layers: Names of the layers (K).
        best: Best value of each layer so far (K,).
        best_positions: Where it is (K, 3) [m].
    """

    fraction: float
    elapsed: float
    remaining: float
    layers: tuple[str, ...]
    best: FloatArray
    best_positions: FloatArray


@question("maps", GetIndexMap)
def index_map(
    leg: str,
    height: float,
    resolution: float,
    layers: Sequence[str] = (),
    ground: Ground | str | float | None = None,
) -> Request[IndexMap]:
    """Return indices over a horizontal plane of a leg's workspace.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        height: z of the plane in the leg's own frame [m].
        resolution: Spacing of the grid [m].
        layers: Names of indices, or "load_capacity"; none for all that the leg has, load capacity
            only with a ground.
        ground: The ground, for the layer "load_capacity".
    """
    request = GetIndexMap.Request(
        leg=leg,
        height=number("height", height),
        resolution=number("resolution", resolution),
        layers=list(layers),
        ground=ground_message(ground),
    )

    def decode(response: Any) -> IndexMap:
        names = tuple(response.layers)
        shape = (response.ny, response.nx)
        return IndexMap(
            x=response.x0 + response.resolution * np.arange(response.nx),
            y=response.y0 + response.resolution * np.arange(response.ny),
            height=response.height,
            layers=names,
            symbols=tuple(response.symbols),
            units=tuple(response.units),
            values=from_field(response.values, (*shape, len(names))),
            status=from_field(response.status, shape, np.uint8),
        )

    return Request(request, decode)


@order("maps", ComputeIndexMap)
def compute_index_map(
    leg: str,
    resolution: float,
    layers: Sequence[str] = (),
    ground: Ground | str | float | None = None,
    *,
    frame: str = "",
    on_progress: Callable[[MapProgress], None] = lambda progress: None,
) -> Goal[IndexCloud]:
    """Return indices over the whole workspace of a leg.

    The client's timeout does not count for the work, but for the node's silence.

    Args:
        leg: Name of the leg; "" if the robot has exactly one.
        resolution: Spacing of the grid [m].
        layers: Names of indices, or "load_capacity"; none for all that the leg has, load capacity
            only with a ground.
        ground: The ground, for the layer "load_capacity".
        frame: Frame of the points: the leg's own ("" or its name) or the base frame.
        on_progress: Called in the client's thread now and then; what it raises ends the work.
    """
    goal = ComputeIndexMap.Goal(
        leg=leg,
        resolution=number("resolution", resolution),
        layers=list(layers),
        ground=ground_message(ground),
    )
    goal.header.frame_id = frame

    def decode(result: Any) -> IndexCloud:
        positions, fields = from_cloud(result.cloud)
        names = tuple(result.layers)
        columns = [fields[name] for name in names if name in fields]
        values = np.stack(columns, axis=-1) if columns else np.empty((len(positions), 0))
        return IndexCloud(
            positions=positions,
            layers=names,
            units=tuple(result.units),
            values=values.astype(np.float64),
            frame=result.cloud.header.frame_id,
            fraction=result.fraction,
            elapsed=result.elapsed,
        )

    def tell(feedback: Any) -> None:
        on_progress(
            MapProgress(
                fraction=feedback.fraction,
                elapsed=feedback.elapsed,
                remaining=feedback.remaining,
                layers=tuple(feedback.layers),
                best=from_field(feedback.best),
                best_positions=from_field(feedback.best_positions, (-1, 3)),
            )
        )

    return Goal(goal, decode, tell)
