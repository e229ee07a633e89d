# SPDX-License-Identifier: Apache-2.0
"""Index maps as jobs in a thread, with progress and cancellation, and a memory of the last ones."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Hashable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_kinematics.mechanism import Mechanism
from leg_kinematics.robot import Leg
from leg_statics.footholds import Contact
from leg_statics.maps import IndexMap, best_points, find_layer, plane_map, volume_map
from leg_statics.weight import level_gravity


class MapKey(NamedTuple):
    """All that a map follows from.

    Attributes:
        mechanism: The leg's mechanism.
        height: z of the plane [m]; None for the whole workspace.
        resolution: Grid spacing [m].
        layers: Names of the layers; none for all.
        effort_limits: Lower and upper effort of each actuator, flat [N.m or N].
        ground: Friction coefficient of the ground, its normal and gravity in the leg frame; None
            without a ground.
    """

    mechanism: Mechanism
    height: float | None
    resolution: float
    layers: tuple[str, ...]
    effort_limits: tuple[float, ...]
    ground: tuple[float, tuple[float, ...], tuple[float, ...]] | None

    @classmethod
    def of(
        cls,
        leg: Leg,
        height: float | None,
        resolution: float,
        layers: tuple[str, ...],
        contact: Contact | None,
    ) -> MapKey:
        """Return the key of a map; see the attributes for the arguments."""
        limits = _floats(leg.effort_limits)
        if contact is None:
            return cls(leg.mechanism, height, resolution, layers, limits, None)
        given = contact.under(level_gravity(leg))
        ground = float(np.asarray(given.friction)), _floats(given.normal), _floats(given.gravity)
        return cls(leg.mechanism, height, resolution, layers, limits, ground)

    @property
    def leg(self) -> Leg:
        """The leg, by itself."""
        return Leg.of(self.mechanism, np.reshape(self.effort_limits, (-1, 2)))

    @property
    def contact(self) -> Contact | None:
        """The ground, without a load; None if there is none."""
        if self.ground is None:
            return None
        friction, normal, gravity = self.ground
        return Contact(friction, normal, gravity=gravity)


class MapMemory:
    """Maps computed last, as many as fit.

    A key holds all that a map follows from, so a map never gets out of date: with other limits it
    is another map, and the old one is forgotten once the space is needed.

    Args:
        size: Memory for the values [bytes].
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._used = 0
        self._maps: OrderedDict[Hashable, IndexMap] = OrderedDict()
        self._lock = threading.Lock()

    def find(self, key: MapKey) -> IndexMap | None:
        """Return the map of a key if it is known."""
        with self._lock:
            if key in self._maps:
                self._maps.move_to_end(key)
            return self._maps.get(key)

    def keep(self, key: MapKey, index_map: IndexMap) -> None:
        """Remember a map, forgetting those not used for longest."""
        with self._lock:
            if key in self._maps or _size(index_map) > self._size:
                return
            self._maps[key] = index_map
            self._used += _size(index_map)
            while self._used > self._size:
                _, oldest = self._maps.popitem(last=False)
                self._used -= _size(oldest)

    def plane(self, key: MapKey) -> IndexMap:
        """Return the map of a plane, computed only if it is not known."""
        found = self.find(key)
        if found is None:
            found = plane_map(
                key.leg,
                float("nan") if key.height is None else key.height,
                key.resolution,
                layers=key.layers,
                contact=key.contact,
            )
            self.keep(key, found)
        return found


def _floats(values: ArrayLike | None) -> tuple[float, ...]:
    """Return the numbers of an array, for a key."""
    return tuple(as_array("values", cast(ArrayLike, values)).ravel().tolist())


def _size(index_map: IndexMap) -> int:
    return index_map.values.nbytes + index_map.status.nbytes


class Progress(NamedTuple):
    """How far a job is.

    Attributes:
        fraction: Share that is computed, 0 to 1.
        elapsed: Time since the job was ordered [s].
        remaining: Estimated time to its end [s]; NaN while it is not known.
        layers: Names of the layers (K), empty before the job has begun.
        best: Best value of each layer so far (K,); NaN if there is none.
        best_positions: Where it is, in the leg frame (K, 3) [m].
    """

    fraction: float
    elapsed: float
    remaining: float
    layers: tuple[str, ...]
    best: FloatArray
    best_positions: FloatArray


class MapJob:
    """A map of the whole workspace that is computed in a thread.

    Attributes:
        index_map: The map so far; None before it has begun. Read it when the job is over.
    """

    def __init__(self, key: MapKey, memory: MapMemory, pool: ThreadPoolExecutor) -> None:
        self.index_map: IndexMap | None = None
        self._key = key
        self._memory = memory
        self._ordered = time.monotonic()
        self._begun = self._ended = self._ordered
        self._cancelled = threading.Event()
        self._progress = Progress(0.0, 0.0, np.nan, (), np.empty(0), np.empty((0, 3)))
        self._future: Future[None] = pool.submit(self._compute)

    @property
    def over(self) -> bool:
        """Whether the job has ended, one way or another."""
        return self._future.done()

    @property
    def complete(self) -> bool:
        """Whether the whole map is computed."""
        return self.over and self._progress.fraction == 1.0

    @property
    def progress(self) -> Progress:
        """How far the job is now."""
        now = self._ended if self.over else time.monotonic()
        fraction = self._progress.fraction
        spent = now - self._begun
        remaining = spent * (1.0 - fraction) / fraction if fraction > 0.0 else np.nan
        return self._progress._replace(elapsed=now - self._ordered, remaining=remaining)

    def cancel(self) -> None:
        """End after the plane that is being computed."""
        self._cancelled.set()
        self._future.cancel()

    def check(self) -> None:
        """Raise what the computation raised, if it did."""
        if not self._future.cancelled():
            self._future.result()

    def _compute(self) -> None:
        self._begun = time.monotonic()
        try:
            self._find_or_compute()
        finally:
            self._ended = time.monotonic()

    def _find_or_compute(self) -> None:
        key = self._key
        known = self._memory.find(key)
        if known is not None:
            self.index_map = known
            self._note(1.0, *best_points(known))
            return
        maps = volume_map(key.leg, key.resolution, layers=key.layers, contact=key.contact)
        best: FloatArray = np.empty(0)
        where: FloatArray = np.empty((0, 3))
        for k, self.index_map in enumerate(maps):
            plane = self.index_map._replace(
                height=self.index_map.height[k],
                values=self.index_map.values[k],
                status=self.index_map.status[k],
            )
            best, where = _better(plane.layers, (best, where), best_points(plane))
            self._note((k + 1) / len(self.index_map.height), best, where)
            if self._cancelled.is_set():
                return
        if self.index_map is not None:
            self._memory.keep(key, self.index_map)

    def _note(self, fraction: float, best: FloatArray, where: FloatArray) -> None:
        layers = self.index_map.layers if self.index_map is not None else ()
        self._progress = Progress(fraction, 0.0, np.nan, layers, best, where)


def _better(
    layers: tuple[str, ...],
    known: tuple[FloatArray, FloatArray],
    new: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return the better values of two, and where they are."""
    if not len(known[0]):
        return new
    signs = np.array([1.0 if find_layer(name).better == "low" else -1.0 for name in layers])
    take = (new[0] * signs < known[0] * signs) | np.isnan(known[0])
    return np.where(take, new[0], known[0]), np.where(take[:, None], new[1], known[1])
