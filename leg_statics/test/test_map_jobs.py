# SPDX-License-Identifier: Apache-2.0
"""Maps as jobs: memory, progress, cancellation; and what is best on a map."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from leg_kinematics import Leg, UnknownNameError, ValueRangeError
from leg_statics.footholds import Contact
from leg_statics.map_jobs import MapJob, MapKey, MapMemory
from leg_statics.maps import best_points, find_layer, grid_shape, volume_map
from leg_statics.published.paper_000 import legs

MECHANISM = legs()["optimised"]
LIMITS = np.array([[-150.0, 150.0]] * 3)
LEG = Leg.of(MECHANISM, LIMITS)
LAYERS = ("rated_friction", "load_capacity")


def key_of(height=None, resolution=0.05, limits=LIMITS, friction=0.4):
    return MapKey.of(Leg.of(MECHANISM, limits), height, resolution, LAYERS, Contact(friction))


@pytest.fixture
def pool():
    with ThreadPoolExecutor(max_workers=1) as pool:
        yield pool


def finished(job):
    while not job.over:
        time.sleep(0.001)
    return job


def test_a_plane_is_computed_once():
    memory = MapMemory(10_000_000)
    assert memory.plane(key_of(-0.65)) is memory.plane(key_of(-0.65))


@pytest.mark.parametrize(
    "other",
    [
        {"limits": 2.0 * LIMITS},
        {"friction": 0.5},
        {"resolution": 0.06},
        {"height": -0.6},
    ],
    ids=str,
)
def test_a_plane_that_follows_from_something_else_is_another(other):
    memory = MapMemory(10_000_000)
    first = memory.plane(key_of(-0.65))
    assert memory.plane(key_of(**{"height": -0.65, **other})) is not first


def test_the_map_not_used_for_longest_is_forgotten_first():
    size = sum(a.nbytes for a in MapMemory(0).plane(key_of(-0.65))[4:])
    memory = MapMemory(2 * size)
    old, kept = memory.plane(key_of(-0.65)), memory.plane(key_of(-0.6))
    assert memory.plane(key_of(-0.65)) is old  # now the other one is the oldest
    memory.plane(key_of(-0.7))
    assert memory.find(key_of(-0.65)) is old
    assert memory.find(key_of(-0.6)) is not kept


def test_a_job_equals_the_whole_map(pool):
    job = finished(MapJob(key_of(), MapMemory(10**8), pool))
    job.check()
    *_, wanted = volume_map(LEG, 0.05, layers=LAYERS, contact=Contact(0.4))
    assert job.complete
    np.testing.assert_array_equal(job.index_map.values, wanted.values)
    best, where = best_points(wanted)
    np.testing.assert_array_equal(job.progress.best, best)
    np.testing.assert_array_equal(job.progress.best_positions, where)
    assert job.progress.remaining == 0.0


def test_a_job_is_not_done_twice(pool):
    memory = MapMemory(10**8)
    first = finished(MapJob(key_of(), memory, pool))
    assert finished(MapJob(key_of(), memory, pool)).index_map is first.index_map


def test_a_cancelled_job_ends_after_the_plane_under_way_and_is_not_remembered(pool, monkeypatch):
    begun, gate = threading.Event(), threading.Event()

    def held(*args, **options):
        for index_map in volume_map(*args, **options):
            begun.set()
            gate.wait()
            yield index_map

    monkeypatch.setattr("leg_statics.map_jobs.volume_map", held)
    memory, key = MapMemory(10**9), key_of()
    job = MapJob(key, memory, pool)
    begun.wait()
    job.cancel()
    gate.set()
    assert not finished(job).complete
    assert job.progress.fraction == 1 / len(job.index_map.height)
    assert memory.find(key) is None


def test_a_job_tells_what_went_wrong(pool):
    job = finished(MapJob(key_of(resolution=-1.0), MapMemory(0), pool))
    assert not job.complete
    with pytest.raises(ValueRangeError, match="resolution"):
        job.check()


def test_the_best_is_the_smallest_or_the_largest_as_the_layer_has_it():
    index_map = MapMemory(0).plane(key_of(-0.65))
    best, where = best_points(index_map)
    assert best[0] == np.nanmin(index_map.layer("rated_friction"))
    assert best[1] == np.nanmax(index_map.layer("load_capacity"))
    assert (where[:, 2] == -0.65).all()


def test_a_map_without_values_has_no_best():
    best, where = best_points(MapMemory(0).plane(key_of(-5.0)))
    assert np.isnan(best).all()
    assert np.isnan(where).all()


def test_the_shape_of_a_grid_is_known_before_it_is_computed():
    *_, whole = volume_map(LEG, 0.05, layers=LAYERS[:1])
    assert grid_shape(MECHANISM, 0.05) == whole.status.shape
    assert min(grid_shape(MECHANISM, 1e-300)) == min(grid_shape(MECHANISM, 5e-324)) == 10**9


def test_an_unknown_layer_is_refused():
    assert find_layer("load_capacity").unit == "N"
    with pytest.raises(UnknownNameError, match="beauty"):
        find_layer("beauty")
