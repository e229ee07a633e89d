# SPDX-License-Identifier: Apache-2.0
"""What diagnostics tell of a node."""

from __future__ import annotations

import pytest

from leg_kinematics.nodes.health import ERROR, OK, WARN, Health


def test_a_node_that_does_its_work_is_ok():
    health = Health()
    for _ in range(3):
        health.received += 1
        with health.timed():
            pass
    report = health.report()
    assert (report.level, report.message) == (OK, "ok")
    assert float(report.values["input rate [Hz]"]) > 0.0
    assert float(report.values["worst callback latency [ms]"]) >= 0.0
    assert report.values["callbacks"] == "3"
    assert report.values["last error"] == ""


@pytest.mark.parametrize(
    ("spoil", "level", "kind", "message"),
    [
        (
            lambda h: h.refuse("joints", "too few"),
            WARN,
            "refused",
            "refused input: joints: too few",
        ),
        (lambda h: h.drop("joints", "lost"), WARN, "dropped", "dropped input: joints: lost"),
        (lambda h: h.disorder("joints"), WARN, "out of order", "joints: stamps do not increase"),
    ],
)
def test_a_bad_input_is_counted_for_ever_and_told_once(spoil, level, kind, message):
    health = Health()
    spoil(health)
    spoil(health)
    told, later = health.report(), health.report()
    assert (told.level, told.message) == (level, message)
    assert (later.level, later.message) == (OK, "ok")
    for report in (told, later):
        assert report.values[f"{kind} inputs"] == "2"
        assert report.values[f"{kind}: joints"] == "2"


def test_messages_lost_together_are_all_counted():
    health = Health()
    health.drop("joints", "lost", 40)
    health.drop("other", "lost", 2)
    assert health.report().values["dropped inputs"] == "42"


def test_a_fault_of_the_node_outweighs_bad_inputs_and_is_the_last_error():
    health = Health()
    health.fault("timer", "broken")
    health.disorder("joints")
    report = health.report()
    assert (report.level, report.message) == (ERROR, "internal fault: timer: broken")
    assert report.values["internal faults"] == "1"
    assert health.report().values["last error"] == "timer: broken"


def test_a_condition_that_lasts_is_told_in_every_report():
    health = Health()
    health.notes["leg"] = "left_front is not updated"
    for _ in range(2):
        report = health.report()
        assert (report.level, report.message) == (WARN, "left_front is not updated")
        assert report.values["leg"] == "left_front is not updated"
    health.notes.clear()
    assert health.report().level == OK


def test_a_period_tells_its_own_rate_and_worst_callback():
    health = Health()
    health.observe(0.25)
    health.received += 10
    first, second = health.report(), health.report()
    assert first.values["worst callback latency [ms]"] == "250.000"
    assert second.values["worst callback latency [ms]"] == "0.000"
    assert second.values["input rate [Hz]"] == "0.0"
