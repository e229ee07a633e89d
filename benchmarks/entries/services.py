# SPDX-License-Identifier: Apache-2.0
"""Service round trips: one point against an empty service, and where the time of 10,000 goes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from harness import Goal, Row, Settings, Timing, measure, missing_row, timed_row
from leg_msgs.msg import Ground
from leg_msgs.srv import InverseKinematics, QueryFootholds
from leg_msgs_py.arrays import from_field, to_field
from leg_msgs_py.client import LegClient
from rclpy.serialization import deserialize_message, serialize_message
from ros import Client, child, suite_nodes
from std_srvs.srv import Trigger
from workload import BATCH, CONTACT, FRICTION, hexapod_leg, reachable_positions

from leg_kinematics import load_robot
from leg_kinematics.arrays import FloatArray
from leg_statics import Load, evaluate_stances, robot_stance
from leg_statics.footholds import evaluate_footholds

LEG = "right_front"
STANCES = 1000
STANDING = ("left_front", "left_rear")
EMPTY = "empty Trigger"
IDLE = ", no work"  # the same messages, answered with what lies ready
ONE_POINT = Goal(1.5, accepted=2.0)
FOOTHOLD_FIELDS = {  # of the response, with the type of their numbers
    "verdict": np.uint8,
    "status": np.uint8,
    "load_capacity": np.float64,
    "rated_friction": np.float64,
    "rated_friction_full": np.float64,
    "friction_margin": np.float64,
    "utilisation": np.float64,
    "clearance": np.float64,
    "margin": np.float64,
    "limiting_joint": np.int32,
    "ranking": np.int32,
}


def rows(settings: Settings) -> Iterator[Row]:
    """Yield round trips of all services, asked in turn, and the parts of a large one."""
    feet = reachable_positions(hexapod_leg(LEG).mechanism)
    settings.show("starting nodes")
    with suite_nodes("kinematics", "statics"), child("empty_node"), Client() as client:
        trigger = client.service(Trigger, "/empty/trigger")
        inverse = client.service(InverseKinematics, "/kinematics/inverse_kinematics")
        if trigger is None or inverse is None:
            raise TimeoutError("the nodes do not start: see results/nodes.log")
        footholds = client.service(QueryFootholds, "/statics/query_footholds", 10.0)

        idle_inverse = client.service(InverseKinematics, "/empty/inverse_kinematics")
        idle_footholds = client.service(QueryFootholds, "/empty/query_footholds")

        make = {
            EMPTY: Trigger.Request,
            "inverse_kinematics": lambda: inverse_request(feet[0]),
            "query_footholds": lambda: foothold_request(feet[0]),
        }
        services = {EMPTY: (trigger,), "inverse_kinematics": (inverse, idle_inverse)}
        if footholds is not None:
            services["query_footholds"] = (footholds, idle_footholds)
        else:
            yield missing_row("query_footholds", "the statics node does not serve it")
        calls: dict[str, Callable[[], Any]] = {
            name + suffix: lambda service=service, name=name: client.call(service, make[name]())
            for name, both in services.items()
            for service, suffix in zip(both, ("", IDLE), strict=False)
        }
        settings.show("one point")
        yield from one_point(calls, settings)
        for name in services:
            yield messages_row(name, make[name], calls[name](), settings)
        yield from through_leg_client(feet[0], settings)

        settings.show(f"{STANCES:,} stances")
        yield from stances_of_one_foot(feet[:STANCES], settings)

        settings.show(f"{BATCH:,} points")
        samples = sample(
            {"points": lambda: decode_inverse(client.call(inverse, inverse_request(feet)))},
            settings.count(200, 10),
        )
        yield from percentiles(f"inverse_kinematics, {BATCH:,} points", samples["points"])
        if footholds is not None:
            yield from mixed_contacts(
                lambda request: client.call(footholds, request), feet, settings
            )
            yield from parts_of_footholds(
                lambda: decode_footholds(client.call(footholds, foothold_request(feet))),
                feet,
                settings,
            )


def one_point(calls: dict[str, Callable[[], Any]], settings: Settings) -> Iterator[Row]:
    """Yield round trips of one point and their ratios to the empty one."""
    samples = sample(calls, settings.count(3000, 100))
    medians = {}
    for name, durations in samples.items():
        yield from percentiles(name, durations)
        medians[name] = float(np.median(durations))
    empty = medians.pop(EMPTY)
    for name, median in medians.items():
        goal = None if name.endswith(IDLE) else ONE_POINT
        yield Row(f"{name} / {EMPTY}", median / empty, "x", goal=goal)
        if name + IDLE in medians:
            share = median / medians[name + IDLE]
            note = "what the node itself adds"
            yield Row(f"{name} / the same{IDLE}", share, "x", goal=ONE_POINT, note=note)


def messages_row(
    name: str, make_request: Callable[[], Any], response: Any, settings: Settings
) -> Row:
    """Return what both sides of a call do with its messages, without network and node."""

    def handle() -> None:
        request = make_request()
        deserialize_message(serialize_message(request), type(request))
        type(response)()  # the node gets one to fill
        deserialize_message(serialize_message(response), type(response))

    note = "made, serialised and read by rosidl in a loop in this process"
    return timed_row(f"{name}, its messages", measure(handle, settings), note=note)


def through_leg_client(foot: FloatArray, settings: Settings) -> Iterator[Row]:
    """Yield the round trip of one point through the client for planners."""
    with LegClient() as legs:
        legs.inverse_kinematics(LEG, foot)
        samples = sample(
            {"ask": lambda: legs.inverse_kinematics(LEG, foot)}, settings.count(1000, 50)
        )
    note = "a client with a thread of its own"
    yield from percentiles("LegClient.inverse_kinematics", samples["ask"], note=note)


def mixed_contacts(
    call: Callable[[Any], Any], feet: FloatArray, settings: Settings
) -> Iterator[Row]:
    """Yield what a contact of its own for each candidate costs, beside one for all."""
    one, mixed = foothold_request(feet), mixed_request(feet)
    requests = {"one": lambda: call(one), "mixed": lambda: call(mixed)}
    durations = sample(requests, settings.count(200, 10))
    name = f"query_footholds, {BATCH:,} mixed contacts"
    yield from percentiles(name, durations["mixed"])
    share = float(np.median(durations["mixed"]) / np.median(durations["one"]))
    note = "friction, normal and load of each candidate"
    yield Row(f"{name} / one contact", share, "x", goal=Goal(1.2), note=note)


def stances_of_one_foot(candidates: FloatArray, settings: Settings) -> Iterator[Row]:
    """Yield the round trip of candidates of one foot, two others where they are."""
    robot = load_robot("hexapod")
    feet = {name: robot.leg(name).mount.to_base((0.05, 0.0, -0.65)) for name in STANDING}
    feet["right_middle"] = robot.leg("right_middle").mount.to_base(candidates)
    with LegClient() as legs:
        answer = legs.query_stance(feet, FRICTION, mass=60.0)
        found = evaluate_stances(robot_stance(robot, feet, FRICTION), Load(60.0))
        np.testing.assert_array_equal(answer.verdict, found.verdict)
        np.testing.assert_allclose(answer.load_factor, found.load_factor, rtol=1e-9)
        durations = sample(
            {"ask": lambda: legs.query_stance(feet, FRICTION, mass=60.0)}, settings.count(100, 5)
        )["ask"]
    name = f"query_stance, {len(candidates):,} candidates of one foot"
    yield from percentiles(name, durations, Goal(60e-3))


def parts_of_footholds(
    ask: Callable[[], Any], feet: FloatArray, settings: Settings
) -> Iterator[Row]:
    """Yield the round trip of a large request, and what of it is mathematics and conversion."""
    leg = hexapod_leg(LEG)
    durations = sample({"ask": ask}, settings.count(200, 10))["ask"]
    yield from percentiles(f"query_footholds, {BATCH:,} points", durations, Goal(10e-3))

    def evaluate() -> Any:
        found = evaluate_footholds(leg, feet, CONTACT)
        return found, found.ranking

    mathematics = measure(evaluate, settings)
    found, ranking = evaluate()
    arrays = {
        **{field: getattr(found, field, None) for field in FOOTHOLD_FIELDS},
        "status": found.posture.status,
        "ranking": ranking,
    }

    def convert() -> None:
        """Do what both sides do: fields of request and response, both ways."""
        from_field(to_field(feet), (-1, 3))
        for field, dtype in FOOTHOLD_FIELDS.items():
            from_field(to_field(arrays[field], dtype), dtype=dtype)

    conversion = measure(convert, settings)
    rest = float(np.median(durations)) - mathematics.median - conversion.median
    yield part("mathematics", mathematics, "evaluated in this process")
    yield part("conversion", conversion, "arrays to message fields and back")
    yield Row("  of it DDS and executors", rest, note="the remainder, with (de)serialisation")


def part(name: str, timing: Timing, note: str) -> Row:
    """Return a row of a part of the round trip."""
    return Row(f"  of it {name}", timing.median, "s", timing.p95, note=note)


def sample(calls: dict[str, Callable[[], Any]], count: int) -> dict[str, list[float]]:
    """Return durations of calls made in turn, after a warm-up."""
    durations: dict[str, list[float]] = {name: [] for name in calls}
    for k in range(-max(3, count // 10), count):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            if k >= 0:
                durations[name].append(time.perf_counter() - start)
    return durations


def percentiles(
    name: str, durations: list[float], goal: Goal | None = None, note: str = ""
) -> Iterator[Row]:
    """Yield median with p95, and p99."""
    p50, p95, p99 = map(float, np.percentile(durations, [50.0, 95.0, 99.0]))
    yield Row(name, p50, "s", p95, goal, note or f"{len(durations)} round trips")
    yield Row(f"{name}, p99", p99)


def inverse_request(feet: FloatArray) -> Any:
    """Return a request for foot positions."""
    return InverseKinematics.Request(leg=LEG, positions=to_field(feet))


def decode_inverse(response: Any) -> FloatArray:
    """Return the joint positions of a response."""
    joints: FloatArray = from_field(response.joint_positions, (-1, 3))
    assert len(joints) == len(response.status) > 0, response.error.message
    return joints


def foothold_request(feet: FloatArray) -> Any:
    """Return a request for foothold candidates."""
    return QueryFootholds.Request(
        legs=[LEG],
        positions=to_field(feet),
        ground=Ground(friction_coefficients=[FRICTION]),
        required_load=to_field(CONTACT.load),
    )


def mixed_request(feet: FloatArray) -> Any:
    """Return the same with a friction, a normal and a load for each candidate."""
    random, request = np.random.default_rng(1), foothold_request(feet)
    count = len(feet)
    request.ground = Ground(
        friction_coefficients=to_field(random.uniform(0.2, 1.0, count)),
        normals=to_field(random.normal(size=(count, 3)) * 0.2 + [0.0, 0.0, 1.0]),
    )
    request.required_load = to_field(random.uniform(0.5, 1.5, count) * float(CONTACT.load))
    return request


def decode_footholds(response: Any) -> dict[str, Any]:
    """Return the arrays of a response."""
    assert len(response.verdict) > 0, response.error.message
    return {
        field: from_field(getattr(response, field), dtype=dtype)
        for field, dtype in FOOTHOLD_FIELDS.items()
    }
