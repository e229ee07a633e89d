# SPDX-License-Identifier: Apache-2.0
"""A client for gait planners: numpy arrays in, named tuples out, exceptions for failures.

    from leg_msgs_py.client import LegClient

    with LegClient() as legs:
        print(legs.legs())
        answer = legs.inverse_kinematics("left_front", [[0.0, -0.05, -0.7], [0.0, 0.05, -0.7]])
        print(answer.joint_positions, answer.status)

`LegClient()` has a node and a thread of its own, so its calls may block anywhere, in callbacks of
other nodes too. `LegClient(node=self)` shares a node that already spins: in its callbacks `await`
the futures, and wait for answers in other threads only.
"""

from __future__ import annotations

from leg_msgs.msg import EffortLimits as EffortLimitsMessage
from leg_msgs_py.client import (
    description,
    designs,
    efforts,
    footholds,
    indices,
    kinematics,
    limits,
    maps,
    stances,
    steps,
)
from leg_msgs_py.client.calls import Caller
from leg_msgs_py.client.questions import Question
from rclpy.node import Node


class LegClient:
    """Asks the nodes of one robot.

    Every call takes points of any leading axes (..., t) and gives arrays with the same leading
    axes. Calls raise a `LegServiceError` of `leg_msgs_py.errors`: `UnknownLegError`,
    `InvalidInputError`, `TooLargeError`, `TimedOutError`, `ServerUnavailableError` and so on.

    A call waits for its answer. With `.future` behind its name it does not, and returns a future,
    to `wait()` for or, in a coroutine of a shared node, to `await`:

        futures = [legs.query_footholds.future(leg, feet, "cement", 300.0) for leg in legs.legs()]
        answers = [future.wait() for future in futures]

    Args:
        node: A node that spins elsewhere and is to be shared; None for a node of its own.
        namespace: Namespace of the robot's nodes, such as "robot_1"; "" for none.
        timeout: Time allowed for each call, including the wait for the server [s].
        domain_id: ROS domain if the node is its own; None for that of the environment.
        max_points: Points accepted in one call, as the nodes' parameter of this name: more are
            refused here, before they are sent.

    Attributes:
        caller: Sends requests and goals.
        max_points: Points accepted in one call.
    """

    forward_kinematics = kinematics.forward_kinematics
    inverse_kinematics = kinematics.inverse_kinematics
    jacobian = kinematics.jacobian

    evaluate_indices = indices.evaluate_indices
    compute_efforts = efforts.compute_efforts

    query_footholds = footholds.query_footholds
    query_footholds_of_legs = footholds.query_footholds_of_legs
    query_stance = stances.query_stance
    query_step_length = steps.query_step_length

    index_map = maps.index_map
    compute_index_map = maps.compute_index_map

    search_geometry = designs.search_geometry

    legs = description.legs
    describe = description.describe
    set_effort_limits = limits.set_effort_limits

    def __init__(
        self,
        *,
        node: Node | None = None,
        namespace: str = "",
        timeout: float = 5.0,
        domain_id: int | None = None,
        max_points: int = 1_000_000,
    ) -> None:
        self.max_points = max_points
        self._prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
        self.caller = Caller(node, timeout, domain_id)

    @property
    def node(self) -> Node:
        """The node through which the client talks."""
        return self.caller.node

    def __enter__(self) -> LegClient:
        """Return the client; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the client."""
        self.close()

    def close(self) -> None:
        """Cancel calls under way and free what the client uses."""
        self.caller.close()

    def name_of(self, server: str, interface: str) -> str:
        """Return the full name of a service, action or topic of a node of the robot."""
        return f"{self._prefix}/{server}/{interface}"

    def wait_until_ready(self, timeout: float = 30.0) -> None:
        """Wait until every service of the robot is there.

        Raises:
            ServerUnavailableError: If one is not, after `timeout` seconds.
        """
        services = [
            (self.name_of(each.server, each.name), each.interface) for each in SERVICES.values()
        ]
        self.caller.wait_for_servers(services, timeout)

    def effort_limits(self) -> limits.EffortLimits:
        """Return the effort limits last published; later calls return at once.

        Raises:
            ServerUnavailableError: If none are published within the time allowed.
        """
        topic = self.name_of("statics", "effort_limits")
        return limits.EffortLimits.from_message(self.caller.latest(topic, EffortLimitsMessage))


# Services that a client asks, by name.
SERVICES = {each.name: each for each in vars(LegClient).values() if isinstance(each, Question)}
