# SPDX-License-Identifier: Apache-2.0
"""A question of the client is said once: its help, its two forms and what it sends."""

import inspect
import pydoc
from typing import get_args

import numpy as np
import pytest
from leg_msgs.msg import ErrorCode
from leg_msgs.srv import GetLegDescription, QueryFootholds
from leg_msgs_py.client import SERVICES, LegClient, footholds
from leg_msgs_py.client.calls import CallFuture
from leg_msgs_py.client.footholds import Footholds
from leg_msgs_py.client.questions import Order, Question
from leg_msgs_py.errors import InvalidInputError, TooLargeError, UnknownLegError, check
from leg_msgs_py.naming import interface_name

METHODS = {
    name: method
    for name, method in vars(LegClient).items()
    if isinstance(method, (Question, Order))
}
FEET = np.zeros((2, 3, 3))


class FakeCaller:
    """Answers every request with the response it was given."""

    def __init__(self, response):
        self.response = response
        self.sent = []

    def call(self, name, service, request, decode):
        self.sent.append((name, service, request))
        check(self.response.error)
        future = CallFuture()
        future.settle(decode(self.response))
        return future


class Planner:
    """A client with the methods of `LegClient` that are tested, and no ROS."""

    query_footholds = footholds.query_footholds
    legs = LegClient.__dict__["legs"]
    describe = LegClient.__dict__["describe"]

    def __init__(self, response, max_points=100):
        self.caller = FakeCaller(response)
        self.max_points = max_points

    def name_of(self, server, interface):
        return f"/robot_1/{server}/{interface}"


# Fields that have no number for each candidate, or only if asked for.
OTHERS = (
    *("ranking", "best", "friction_coefficients", "weight_counted"),
    *("joint_names", "joint_efforts", "force"),
)


def empty_answer(count):
    response = QueryFootholds.Response(
        friction_coefficients=[0.4], best=[-1], weight_counted=[False]
    )
    response.error.code = ErrorCode.SUCCESS
    for field, kind in response.get_fields_and_field_types().items():
        if kind.startswith("sequence<") and field not in OTHERS:
            setattr(response, field, [0] * count)
    return response


@pytest.mark.parametrize("name", METHODS)
def test_help_shows_the_docstring_and_the_parameters(name):
    shown = pydoc.render_doc(getattr(LegClient, name), renderer=pydoc.plaintext)
    made = METHODS[name].make
    parameters = inspect.signature(made).parameters
    assert f"{name}(self" in shown
    for line in inspect.getdoc(made).splitlines():
        assert line in shown
    for parameter in parameters:
        assert parameter in shown
        assert f"    {parameter}: " in inspect.getdoc(made)


@pytest.mark.parametrize("name", METHODS)
def test_the_signature_ends_in_the_answer(name):
    of_client = inspect.signature(METHODS[name].__get__(Planner(None)))
    assert tuple(of_client.parameters) == tuple(inspect.signature(METHODS[name].make).parameters)
    answer = inspect.signature(getattr(LegClient, name)).return_annotation
    assert answer == of_client.return_annotation
    assert f"-> {inspect.formatannotation(answer)}" in repr(METHODS[name].__get__(Planner(None)))
    *_, kind = get_args(answer) or (answer,)  # of each leg
    assert answer == tuple[str, ...] or issubclass(kind, tuple)


def test_help_of_the_client_lists_every_method():
    shown = pydoc.render_doc(LegClient, renderer=pydoc.plaintext)
    for name, method in METHODS.items():
        assert f" {name}(self" in shown
        assert inspect.getdoc(method.make).splitlines()[0] in shown


def test_a_call_is_the_answer_of_its_future():
    planner = Planner(empty_answer(6))
    waited = planner.query_footholds("left_front", FEET, "cement", 300.0)
    future = planner.query_footholds.future("left_front", FEET, "cement", 300.0)
    assert isinstance(waited, Footholds)
    assert isinstance(future, CallFuture)
    for one, other in zip(waited, future.wait(), strict=True):
        np.testing.assert_array_equal(one, other)
    (name, service, first), (_, _, second) = planner.caller.sent
    assert (name, service) == ("/robot_1/statics/query_footholds", QueryFootholds)
    assert first == second
    assert (first.legs, first.ground.name) == (["left_front"], "cement")
    assert list(first.required_load) == [300.0]


def test_the_function_of_the_class_asks_too():
    planner = Planner(empty_answer(6))
    assert LegClient.query_footholds(planner, "left_front", FEET, 0.3).verdict.shape == (2, 3)


def test_more_points_than_a_client_accepts_are_not_sent():
    planner = Planner(empty_answer(6), max_points=5)
    with pytest.raises(TooLargeError, match="6 points; allowed: at most 5"):
        planner.query_footholds("left_front", FEET, 0.3)
    assert planner.caller.sent == []


def test_an_answer_for_other_points_is_refused():
    with pytest.raises(InvalidInputError, match=r"positions: the last axis .* \(2, 3, 3\)"):
        Planner(empty_answer(5)).query_footholds("left_front", FEET, 0.3)


def test_a_leg_without_a_name_is_that_of_a_robot_with_one_leg():
    response = GetLegDescription.Response(legs=["left", "right"])
    response.error.code = ErrorCode.SUCCESS
    assert Planner(response).legs() == ("left", "right")
    with pytest.raises(UnknownLegError, match="got ''; allowed: left, right"):
        Planner(response).describe("")


@pytest.mark.parametrize("what", ["heights", "lateral_offsets"])
def test_what_is_no_number_is_told_by_its_name(what):
    arguments = {"legs": (), "heights": [-0.8], "ground": "cement", what: ["low"]}
    with pytest.raises(InvalidInputError, match=f"{what} must be an array of numbers"):
        METHODS["query_step_length"].make(**arguments)


def test_services_are_named_as_their_types():
    assert interface_name(QueryFootholds) == "query_footholds"
    assert all(name == interface_name(each.interface) for name, each in SERVICES.items())
