# SPDX-License-Identifier: Apache-2.0
"""What nodes answer, what the client asks and what the judge answers again: the same services."""

import array
from collections import Counter

import leg_msgs.action
import leg_msgs.srv
import numpy as np
import pytest
from leg_msgs.msg import ErrorCode, Ground
from leg_msgs_py.arrays import to_field
from leg_msgs_py.client import SERVICES as ASKED
from leg_msgs_py.client import LegClient
from leg_msgs_py.client.questions import Order
from leg_msgs_py.recordings.bag_types import installed_types
from leg_msgs_py.recordings.bag_writer import BagWriter
from leg_msgs_py.recordings.bags import Bag
from rclpy.action import get_action_server_names_and_types_by_node

from leg_kinematics import load_robot
from leg_kinematics.nodes.services import SERVICES as KINEMATICS
from leg_statics.grounds import load_grounds
from leg_statics.nodes.services import SERVICES as STATICS
from leg_statics.recordings import query_judge
from leg_statics.recordings.query_judge import QueryJudge

OFFERED = {**KINEMATICS, **STATICS}
SERVED = {service.name: service for services in OFFERED.values() for service in services}
ORDERS = [method for method in vars(LegClient).values() if isinstance(method, Order)]
TOO_MANY = 10**9
FOOT = [0.02, -0.05, -0.65]
FOOT_IN_BASE = load_robot("hexapod").leg("left_front").mount.to_base(FOOT).tolist()
CEMENT = Ground(name="cement")
# A request for every service that is judged, with all that it can ask for.
REQUESTS = {
    "forward_kinematics": {"joint_positions": [0.1, 0.0, -0.1]},
    "inverse_kinematics": {
        "positions": [*FOOT, 0.0, 0.0, -9.0],
        "assembly_mode": "ALL",
        "include_passive_joints": True,
    },
    "get_jacobian": {"positions": FOOT},
    "compute_efforts": {"positions": FOOT, "forces": [0.0, 10.0, 300.0]},
    "evaluate_indices": {"positions": FOOT},
    "get_leg_description": {},
    "query_footholds": {
        "positions": [*FOOT, 0.0, 0.0, -9.0],
        "legs": ["left_front"],
        "ground": CEMENT,
        "required_load": [200.0],
        "include_efforts": True,
    },
    "query_stance": {
        "legs": ["left_front"],
        "feet": [*FOOT_IN_BASE, 0.0, 0.0, -9.0],
        "ground": "cement",
        "mass": 5.0,
        "center_of_mass": FOOT_IN_BASE,
        "payload_position": FOOT_IN_BASE,
        "margin_direction": [1.0, 0.0, 0.0],
        "region_directions": 4,
        "include_forces": True,
    },
    "query_step_length": {"legs": ["left_front"], "heights": [-0.65], "ground": CEMENT},
    "get_index_map": {"height": -0.65, "resolution": 0.1, "ground": CEMENT},
}


class Host:
    """Answers as a node does."""

    max_points = max_steps = TOO_MANY

    def __init__(self, robot):
        self.robot = robot
        self.grounds = load_grounds("grounds")

    def base_pose(self, frame_id, stamp):
        raise AssertionError("no request here needs tf")

    def plane(self, leg, key):
        return query_judge.MapMemory(0).plane(key)


def request_of(service):
    fields = {"leg": "left_front"} if hasattr(service.type.Request(), "leg") else {}
    return service.type.Request(**fields, **REQUESTS[service.name])


def answered(service, robot):
    """Return request and response as the node sends it, with a stamp if it has a header."""
    request = request_of(service)
    response = service.answer(Host(robot), request, service.type.Response())
    if hasattr(response, "header"):
        response.header.stamp.sec = 12
    return request, response


def record(path, service, request, response):
    """Write a conversation as a node's service events are recorded."""
    name = f"leg_msgs/srv/{service.type.__name__}"
    topic = f"/planner/{server_of(service)}/{service.name}/_service_event"
    types = installed_types([f"{name}_Event"])
    info = service.type.Event().info
    with BagWriter(path) as writer:
        writer.add_topic(topic, f"{name}_Event")
        for kind, message in ((1, request), (2, response)):
            info.event_type = kind
            part = "Request" if kind == 1 else "Response"
            contents = {"request": [], "response": []}
            contents[part.lower()] = [as_recorded(types, message, f"{name}_{part}")]
            event = types.types[f"{name}_Event"](
                info=as_recorded(types, info, "service_msgs/msg/ServiceEventInfo"), **contents
            )
            writer.write(topic, kind, types.serialize_cdr(event, f"{name}_Event"))
    return path


def as_recorded(types, message, name):
    """Return a message of ROS as it is decoded from a recording."""
    values = {}
    for field, kind in message.get_fields_and_field_types().items():
        values[field] = value = getattr(message, field)
        if hasattr(value, "get_fields_and_field_types"):
            values[field] = as_recorded(types, value, "/msg/".join(kind.split("/")))
        elif isinstance(value, array.array) or kind == "sequence<boolean>":
            values[field] = np.array(value)
        elif kind == "sequence<boolean>":
            values[field] = np.array(value, dtype=bool)
    return types.types[name](**values)


def server_of(service):
    return next(server for server, services in OFFERED.items() if service in services)


def judged(path, robot):
    bag = Bag(path)
    judge = QueryJudge(bag, load_grounds("grounds"), "/planner/statics")
    for message in bag.messages():
        judge.take(message, robot)
    (query,) = judge.judge()
    return query


def test_the_client_asks_what_the_nodes_answer():
    assert {(q.server, q.name, q.interface) for q in ASKED.values()} == {
        (server, service.name, service.type)
        for server, services in OFFERED.items()
        for service in services
    }


def test_every_interface_is_served_and_asked():
    def types(module):
        return {name for name in dir(module) if name[0].isupper() and "_" not in name}

    assert {service.type.__name__ for service in SERVED.values()} == types(leg_msgs.srv)
    assert {order.interface.__name__ for order in ORDERS} == types(leg_msgs.action)


def test_the_judge_answers_every_question_again():
    judged = [service.name for each in query_judge.SERVICES.values() for service in each]
    assert Counter(judged) == Counter(set(ASKED) - {"set_effort_limits"})
    assert set(REQUESTS) == set(judged)  # below


@pytest.mark.parametrize("server", OFFERED)
def test_a_running_node_offers_its_services_and_no_other_of_leg_msgs(suite, server):
    offered = suite.client.node.get_service_names_and_types_by_node(server, "/")
    of_leg_msgs = {(name, *types) for name, types in offered if types[0].startswith("leg_msgs/srv")}
    assert of_leg_msgs == {
        (f"/{server}/{service.name}", f"leg_msgs/srv/{service.type.__name__}")
        for service in OFFERED[server]
    }


def test_the_maps_node_offers_the_action_that_the_client_orders(suite):
    offered = get_action_server_names_and_types_by_node(suite.client.node, "maps", "/")
    assert offered == [("/maps/compute_index_map", ["leg_msgs/action/ComputeIndexMap"])]
    assert [(o.server, o.name) for o in ORDERS] == [
        ("maps", "compute_index_map"),
        ("designs", "search_geometry"),
    ]


@pytest.mark.parametrize("name", REQUESTS)
def test_an_answer_is_found_again_bit_for_bit(hexapod, tmp_path, name):
    request, response = answered(SERVED[name], hexapod)
    assert response.error.code == ErrorCode.SUCCESS, response.error.message
    query = judged(record(tmp_path / "bag", SERVED[name], request, response), hexapod)
    assert (query.service, query.legs, query.refused) == (name, "left_front", "")
    assert query.exact
    if hasattr(response, "status"):
        assert query.answer.points == len(response.status)
        assert query.answer.feasible > 0


@pytest.mark.parametrize("name", REQUESTS)
def test_another_number_is_found(hexapod, tmp_path, name):
    request, response = answered(SERVED[name], hexapod)
    changed = response.description if name == "get_leg_description" else response
    field, numbers = next(
        (field, np.array(getattr(changed, field)))
        for field, kind in changed.get_fields_and_field_types().items()
        if kind == "sequence<double>" and np.isfinite(getattr(changed, field)).any()
    )
    where = np.flatnonzero(np.isfinite(numbers))[0]
    numbers[where] += 1e-6
    setattr(changed, field, to_field(numbers))
    query = judged(record(tmp_path / "bag", SERVED[name], request, response), hexapod)
    assert not query.exact
    assert query.difference.field.endswith(f"{field}[{where}]")
    assert query.difference.expected - query.difference.got == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("name", REQUESTS)
def test_a_refusal_is_found_again(hexapod, tmp_path, name):
    request = request_of(SERVED[name])
    where = {"legs": ["wing"]} if hasattr(request, "legs") else {"leg": "wing"}
    for field, value in where.items():
        setattr(request, field, value)
    response = SERVED[name].answer(Host(hexapod), request, SERVED[name].type.Response())
    assert "wing" in response.error.message
    query = judged(record(tmp_path / "bag", SERVED[name], request, response), hexapod)
    assert (query.refused, query.legs, query.exact) == ("UNKNOWN_LEG", "wing", True)


def test_a_service_fills_what_it_always_carries_after_a_fault_too(hexapod):
    service = SERVED["get_leg_description"]
    request = service.type.Request(leg="wing")
    response = service.answer(Host(hexapod), request, service.type.Response())
    assert response.error.code == ErrorCode.UNKNOWN_LEG
    assert list(response.legs) == list(hexapod.legs)


def test_a_fault_of_the_service_itself_is_an_error_code(hexapod):
    def tell(error):
        return f"told: {type(error).__name__}"

    service = SERVED["forward_kinematics"]
    response = service.answer(object(), request_of(service), service.type.Response(), tell)
    assert (response.error.code, response.error.message) == (
        ErrorCode.INTERNAL,
        "told: AttributeError",
    )
