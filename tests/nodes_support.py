# SPDX-License-Identifier: Apache-2.0
"""What the tests of the nodes share."""

import time
from contextlib import suppress

from leg_msgs_py.client import SERVICES, LegClient
from leg_msgs_py.client.questions import Request
from leg_msgs_py.errors import ServerUnavailableError
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

# How long tests wait for what must come: longer than it takes on any machine, however busy.
PATIENCE = 60.0  # [s]
START_TIMEOUT = 1800.0  # for nodes and programs: the first start on a machine compiles [s]
MAX_POINTS = 1000


def wait_for(condition, timeout=PATIENCE):
    """Return the first true value of `condition()`, polled."""
    deadline = time.monotonic() + timeout
    while not (value := condition()):
        assert time.monotonic() < deadline, f"nothing within {timeout} s"
        time.sleep(0.01)
    return value


def wait_until_ready(client, nodes):
    """Wait until all services are there, as long as no node ends."""

    def are_ready():
        assert nodes.ended() == {}
        with suppress(ServerUnavailableError):
            client.wait_until_ready(0.5)
            return True

    wait_for(are_ready, START_TIMEOUT)


def ask(client, service, request):
    """Return the response to a request, even one that the client's methods would not make."""
    return SERVICES[service].send(client, Request(request, lambda response: response)).wait()


def is_served(client, order):
    """Tell whether the action behind a method of the client is there."""
    method = vars(LegClient)[order]
    name = client.name_of(method.server, method.name)
    return client.caller.action_client(name, method.interface).server_is_ready()


def set_parameter(node, server, name, value):
    """Set a parameter of a node and return the result."""
    client = node.create_client(SetParameters, f"/{server}/set_parameters")
    wait_for(client.service_is_ready)
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    answer = client.call(request, timeout_sec=PATIENCE)
    node.destroy_client(client)
    return answer.results[0]
