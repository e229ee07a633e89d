# SPDX-License-Identifier: Apache-2.0
"""What stands out is found whatever the number of messages, in bounded memory."""

from collections import namedtuple

import numpy as np
import pytest

from leg_kinematics import load_robot
from leg_statics.recordings import findings as judge_findings
from leg_statics.recordings.bag_judge import Judgement
from leg_statics.recordings.diagnostic_log import MOST_STATUSES, DiagnosticLog
from leg_statics.recordings.findings import MOST_MOMENTS, WINDOW, Envelope, Findings

Status = namedtuple("Status", "name level message values")
Value = namedtuple("Value", "key value")
Array = namedtuple("Array", "status")


def judgement(leg, times, **known):
    """Return a judgement in which only some values are known."""
    count = len(times)
    fields = {name: np.full(count, np.nan) for name in Judgement._fields}
    for name in ("joint_positions", "joint_utilisation", "required_utilisation"):
        fields[name] = np.full((count, 3), np.nan)
    fields |= {"leg": leg, "time": np.asarray(times), "status": np.zeros(count, np.uint8)}
    fields["force"] = np.full((count, 3), np.nan)
    return Judgement(**(fields | known))


@pytest.mark.parametrize("sizes", [[1] * 700, [5000], [3, 1000, 1, 40, 2000]])
def test_an_envelope_holds_every_sample_and_its_bins_stay_few(monkeypatch, sizes):
    monkeypatch.setattr(judge_findings, "MOST_BINS", 50)
    generator = np.random.default_rng(1)
    values = generator.normal(size=(sum(sizes), 2))
    values[generator.random(values.shape) < 0.1] = np.nan
    values[100:300, 1] = np.nan
    times = np.cumsum(generator.integers(1, 9, len(values)))
    envelope, start = Envelope(("a", "b")), 0
    for size in sizes:
        envelope.add(times[start : start + size], values[start : start + size])
        start += size
    assert 20 <= len(envelope.begin) <= 50
    edges = np.searchsorted(times, envelope.begin)
    np.testing.assert_array_equal(envelope.low, np.fmin.reduceat(values, edges))
    np.testing.assert_array_equal(envelope.high, np.fmax.reduceat(values, edges))
    np.testing.assert_array_equal(envelope.end, times[np.append(edges[1:], len(times)) - 1])


def test_the_worst_moments_are_apart_and_across_all_legs_and_batches():
    findings = Findings(load_robot("hexapod"), 0.4)
    quantity = next(q for q in findings.quantities if q.name == "load_capacity")
    times = np.arange(40) * (WINDOW // 4)
    peaks = {3: 100.0, 4: 110.0, 5: 120.0, 17: 90.0, 30: 95.0}
    for start in range(0, 40, 4):  # batches end where windows do not
        rows = slice(start, start + 4)
        for leg in ("left_front", "right_rear"):
            capacity = np.full(40, 500.0)
            for k, value in peaks.items():
                capacity[k] = value if leg == "right_rear" else 400.0
            capacity[38] = np.nan
            findings.add([judgement(leg, times[rows], load_capacity=capacity[rows])])
    worst = findings.worst(quantity)
    assert len(worst) == MOST_MOMENTS
    assert [(m.value, m.time // (WINDOW // 4)) for m in worst[:4]] == [
        (90.0, 17),
        (95.0, 30),
        (100.0, 3),
        (110.0, 4),
    ]
    assert worst[0].leg == "right_rear"
    extent = findings.extent("right_rear", quantity)
    assert (extent.known, extent.least, extent.greatest, extent.beyond) == (39, 90.0, 500.0, 0)
    assert findings.extent("left_rear", quantity).known == 0


def test_what_is_beyond_a_limit_is_counted_and_what_is_at_it_is_not():
    findings = Findings(load_robot("hexapod"), 0.4)
    used = np.array([0.5, 1.0, 1.01, np.nan, 3.0])
    findings.add([judgement("left_front", np.arange(5), utilisation=used)])
    quantity = next(q for q in findings.quantities if q.name == "utilisation")
    extent = findings.extent("left_front", quantity)
    assert (extent.known, extent.beyond) == (4, 2)


def test_a_foot_in_the_air_bears_nothing_and_one_without_a_wrench_might():
    findings = Findings(load_robot("hexapod"), 0.4, contact_force=10.0)
    load = np.array([100.0, 0.0, 9.9, np.nan])
    capacity = np.array([500.0, 50.0, 60.0, 400.0])
    findings.add([judgement("left_front", np.arange(4), load=load, load_capacity=capacity)])
    quantity = next(q for q in findings.quantities if q.name == "load_capacity")
    extent = findings.extent("left_front", quantity)
    assert (extent.known, extent.least) == (2, 400.0)
    assert findings.samples("left_front", quantity) == 2
    assert {moment.value for moment in findings.worst(quantity)} <= {400.0, 500.0}
    curves = findings.curves["left_front"]
    shown = curves.high[:, curves.names.index("load_capacity")]
    np.testing.assert_array_equal(shown, [500.0, np.nan, np.nan, 400.0])


def test_an_envelope_is_in_the_order_of_time_whatever_the_order_of_its_samples():
    envelope = Envelope(("a",))
    for times in ([5, 3, 9], [1, 4, 12]):
        times = np.array(times)
        envelope.add(times, times[:, None].astype(float))
    np.testing.assert_array_equal(envelope.begin, [1, 3, 4, 5, 9, 12])
    np.testing.assert_array_equal(envelope.high[:, 0], envelope.begin)


def test_a_component_tells_its_worst_level_and_since_when():
    log = DiagnosticLog()
    for time, level in enumerate([0, 1, 2, 1, 2, 0]):
        values = [Value("rate", str(time))]
        log.add(time, Array([Status("node", level, f"level {level}", values)]))
    history = log.statuses["node"]
    assert history.levels == {0: 2, 1: 2, 2: 2}
    assert (history.worst, history.since, history.complaint) == (2, 2, "level 2")
    assert (history.last, history.values) == ("level 0", {"rate": "5"})


def test_components_without_number_do_not_fill_the_memory():
    log = DiagnosticLog()
    for k in range(MOST_STATUSES + 7):
        log.add(k, Array([Status(f"node {k}", 0, "", [])]))
    assert len(log.statuses) == MOST_STATUSES
    assert log.others == 7
