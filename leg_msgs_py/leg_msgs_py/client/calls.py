# SPDX-License-Identifier: Apache-2.0
"""The one path of every request of the client: wait for the server, send, answer or give up."""

from __future__ import annotations

import atexit
import itertools
import os
import threading
import time
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import rclpy
from leg_msgs_py.errors import CancelledError, ServerUnavailableError, TimedOutError, check
from leg_msgs_py.naming import type_name
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

T = TypeVar("T")

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# A reader that keeps the last 10 requests, as is the default, loses what else is sent at once.
SERVICE_QOS = QoSProfile(depth=256)
MOST_UNDER_WAY = 64  # requests of one service sent and not answered; further ones wait here
WATCH_PERIOD = 0.02  # how often calls that wait are looked at [s]

_serial = itertools.count()


class CallFuture(Future, Generic[T]):
    """The answer to come: `await` it in a coroutine of the node, or `wait()` in another thread."""

    def __init__(self, executor: Any = None) -> None:
        super().__init__(executor=executor)
        self._settled = threading.Event()

    def __await__(self) -> Generator[None, None, T]:
        """Wait within a coroutine that an rclpy executor runs."""
        return (yield from super().__await__())

    def settle(self, result: Any = None, error: Exception | None = None) -> None:
        """Set the outcome; the first one counts."""
        if not self._settled.is_set():
            if error is None:
                self.set_result(result)
            else:
                self.set_exception(error)
            self._settled.set()

    def cancel(self) -> None:
        """Stop waiting for the answer."""
        super().cancel()
        self._settled.set()

    def wait(self) -> T:
        """Block until the answer is there and return it; not for callbacks of the same executor.

        Raises:
            LegServiceError: If the request failed, timed out or was cancelled.
        """
        self._settled.wait()
        if self.cancelled():
            raise CancelledError("the call was cancelled")
        answer: T = self.result()
        return answer


class Server:
    """The nodes that serve a service, as the client's node sees them.

    Args:
        node: The client's node.
        service: Full name of the service.
        type_name: Its type, such as "leg_msgs/srv/QueryFootholds".
    """

    def __init__(self, node: Node, service: str, type_name: str) -> None:
        self._node, self._service, self._type = node, service, type_name
        self._count = node.count_services(service)
        self._turned: threading.Event | None = None

    def has_come(self) -> bool:
        """Whether one has come since the last look.

        What was sent to a server that crashed is lost, and only much later does the middleware tell
        that it is gone; its successor may be there long since.
        """
        if self._turned is None and self._node.executor is not None:
            self._turned = threading.Event()
            self._node.executor.create_task(self._turned.set)
        before, self._count = self._count, self._node.count_services(self._service)
        return self._count > before

    def silence(self, what: str, timeout: float) -> TimedOutError:
        """Return the error for an answer that did not come in time, though there is a server."""
        if self._turned is None or not self._turned.is_set():
            return TimedOutError(
                f"{self._service}: an answer could not be heard, since no executor worked for the "
                f"client's node within {timeout:g} s: in its callbacks `await` futures, and wait "
                "for answers in other threads"
            )
        return TimedOutError(what)

    def absence(self, timeout: float) -> ServerUnavailableError:
        """Return the error for a server that was not there in time."""
        others = [
            name
            for name, types in self._node.get_service_names_and_types()
            if self._type in types and self._node.count_services(name)  # not clients alone
        ]
        hint = (
            f"there is {', '.join(sorted(others))}; is the client's namespace right?"
            if others
            else "does it run, with the same ROS_DOMAIN_ID?"
        )
        return ServerUnavailableError(
            f"no node serves {self._service}, waited {timeout:g} s; {hint}"
        )


@dataclass(eq=False)
class _Call:
    """One request on its way."""

    client: Any
    server: Server
    request: Any
    decode: Callable[[Any], Any]
    future: CallFuture[Any]
    deadline: float
    sent: Future | None = None

    def send(self) -> None:
        self.sent = self.client.call_async(self.request)
        self.sent.add_done_callback(self.receive)

    def receive(self, sent: Future) -> None:
        try:
            self.future.settle(self.decode(sent.result()))
        except Exception as error:
            self.future.settle(error=error)

    def forget(self) -> None:
        if self.sent is not None:
            self.client.remove_pending_request(self.sent)
            self.sent = None

    @property
    def over(self) -> bool:
        return bool(self.future.done() or self.future.cancelled())

    def advance(self, timeout: float, may_send: Callable[[Any], bool]) -> bool:
        """Send, send again after a restart of the server, or give up; return whether it is over."""
        if self.over:
            self.forget()
            return True
        available = self.client.service_is_ready()
        if self.server.has_come() or not available:
            self.forget()
        if time.monotonic() > self.deadline:
            self.forget()
            self.future.settle(
                error=self.server.silence(
                    f"{self.client.srv_name} gave no answer within {timeout:g} s", timeout
                )
                if available
                else self.server.absence(timeout)
            )
            return True
        if available and self.sent is None and may_send(self.client):
            self.send()
        return False


class Caller:
    """Sends requests of any service through a node, its own or one that already spins.

    All requests are idempotent: one that was on its way when the server ended or crashed is sent
    again to the server that takes its place, until the time allowed is over.

    Args:
        node: A node that spins elsewhere; None makes a node that spins in a background thread.
        timeout: Time allowed for each request, including the wait for the server [s].
        domain_id: ROS domain of a node of its own; None takes ROS_DOMAIN_ID.
    """

    def __init__(self, node: Node | None, timeout: float, domain_id: int | None) -> None:
        self.timeout = timeout
        self._background = _BackgroundNode(domain_id) if node is None else None
        self.node: Node = self._background.node if self._background else node
        self._group = ReentrantCallbackGroup()
        self._clients: dict[str, Any] = {}
        self._actions: dict[str, Any] = {}
        self._topics: dict[str, _LatchedTopic] = {}
        self._calls: set[Any] = set()
        self._lock = threading.RLock()
        self._waiting = threading.Event()
        self._closed = False
        self._watcher = threading.Thread(target=self._watch, name="leg_client_watch", daemon=True)
        self._watcher.start()
        atexit.register(self.close)

    def client(self, service: str, service_type: Any) -> Any:
        """Return the rclpy client of a service, made at its first use."""
        with self._lock:
            self._check_open()
            if service not in self._clients:
                self._clients[service] = self.node.create_client(
                    service_type, service, qos_profile=SERVICE_QOS, callback_group=self._group
                )
            return self._clients[service]

    def action_client(self, action: str, action_type: Any) -> Any:
        """Return the rclpy client of an action, made at its first use."""
        with self._lock:
            self._check_open()
            if action not in self._actions:
                self._actions[action] = ActionClient(
                    self.node, action_type, action, callback_group=self._group
                )
            return self._actions[action]

    def wait_for_servers(self, services: Iterable[tuple[str, Any]], timeout: float) -> None:
        """Wait until every service is there.

        Args:
            services: Names and types.
            timeout: Time allowed for all of them [s].

        Raises:
            ServerUnavailableError: If one is not there in time.
        """
        deadline = time.monotonic() + timeout
        for name, kind in services:
            client = self.client(name, kind)
            while not client.service_is_ready():
                if time.monotonic() > deadline:
                    raise Server(self.node, name, type_name(kind)).absence(timeout)
                time.sleep(WATCH_PERIOD)

    def call(
        self,
        service: str,
        service_type: Any,
        request: Any,
        decode: Callable[[Any], T],
    ) -> CallFuture[T]:
        """Send a request and return the future of its decoded answer.

        Args:
            service: Name of the service.
            service_type: Its type.
            request: The request.
            decode: Makes the result of a response.
        """

        def checked(response: Any) -> T:
            check(response.error)
            return decode(response)

        future: CallFuture[T] = CallFuture(self.future_executor)
        deadline = time.monotonic() + self.timeout
        client = self.client(service, service_type)
        server = Server(self.node, service, type_name(service_type))
        call = _Call(client, server, request, checked, future, deadline)
        with self._lock:
            if call.client.service_is_ready() and self._may_send(call.client):
                call.send()
            self._calls.add(call)
        self._waiting.set()
        return future

    @property
    def future_executor(self) -> Any:
        """The executor in which a future may be awaited; None for a node of its own."""
        return None if self._background else self.node.executor

    def look_after(self, call: Any) -> None:
        """Advance a call until it is over, one of another kind than `call` makes."""
        with self._lock:
            self._check_open()
            call.advance(self.timeout, self._may_send)
            self._calls.add(call)
        self._waiting.set()

    def latest(self, topic: str, message_type: Any) -> Any:
        """Return the last message of a latched topic, waiting for the first one.

        Raises:
            ServerUnavailableError: If none came in the time allowed.
        """
        with self._lock:
            self._check_open()
            if topic not in self._topics:
                self._topics[topic] = _LatchedTopic(self.node, topic, message_type, self._group)
            latched = self._topics[topic]
        if not latched.received.wait(self.timeout):
            raise ServerUnavailableError(f"no message on {topic} within {self.timeout:g} s")
        return latched.message

    def close(self) -> None:
        """Cancel what is under way and free the node's entities; safe to call twice."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            calls, self._calls = self._calls, set()
        atexit.unregister(self.close)
        self._waiting.set()
        self._watcher.join()
        for call in calls:
            call.forget()
            call.future.settle(error=CancelledError("the client was closed"))
        if self._background:
            self._background.close(self._actions.values())
            return
        for client in self._clients.values():
            self.node.destroy_client(client)
        for action in self._actions.values():
            action.destroy()
        for topic in self._topics.values():
            self.node.destroy_subscription(topic.subscription)

    def _check_open(self) -> None:
        if self._closed:
            raise CancelledError("the client is closed")

    def _may_send(self, client: Any) -> bool:
        calls = [call for call in self._calls if call.client is client and call.sent]
        return len(calls) < MOST_UNDER_WAY or sum(not call.over for call in calls) < MOST_UNDER_WAY

    def _watch(self) -> None:
        """Look after calls that are not answered at once; idle while there is none."""
        while not self._closed:
            self._waiting.wait()
            time.sleep(WATCH_PERIOD)
            with self._lock:
                calls = list(self._calls)
            over = {call for call in calls if self._is_over(call)}
            with self._lock:
                self._calls -= over
                if not self._calls and not self._closed:
                    self._waiting.clear()

    def _is_over(self, call: Any) -> bool:
        try:
            with self._lock:
                return call.advance(self.timeout, self._may_send)
        except Exception as error:  # the shared node was destroyed
            call.future.settle(error=error)
            return True


class _LatchedTopic:
    """A subscription that keeps the last message."""

    def __init__(self, node: Node, topic: str, message_type: Any, group: Any) -> None:
        self.message: Any = None
        self.received = threading.Event()
        self.subscription = node.create_subscription(
            message_type, topic, self._receive, LATCHED, callback_group=group
        )

    def _receive(self, message: Any) -> None:
        self.message = message
        self.received.set()


class _BackgroundNode:
    """A node with its own context that spins in a thread of its own."""

    def __init__(self, domain_id: int | None) -> None:
        self.context = Context()
        rclpy.init(
            context=self.context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(
            f"leg_client_{os.getpid()}_{next(_serial)}",
            context=self.context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._stopping = False
        self._thread = threading.Thread(target=self._spin, name="leg_client_spin", daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._stopping:
            try:
                self._executor.spin_once()
            except Exception as error:  # one bad message must not end the client
                self.node.get_logger().error(f"{type(error).__name__}: {error}")

    def close(self, actions: Iterable[Any]) -> None:
        self._stopping = True
        self._executor.create_task(lambda: None)  # `wake` alone does not make spin_once return
        self._thread.join()
        self._executor.shutdown()
        for action in actions:  # the node does not know them
            action.destroy()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)
