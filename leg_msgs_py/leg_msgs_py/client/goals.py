# SPDX-License-Identifier: Apache-2.0
"""The one path of every long piece of work: send the goal, hear its progress, end or cancel it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from leg_msgs.msg import ErrorCode
from leg_msgs_py.client.calls import Caller, CallFuture, Server
from leg_msgs_py.errors import CancelledError, LegServiceError, check
from leg_msgs_py.naming import type_name

T = TypeVar("T")


class GoalFuture(CallFuture[T]):
    """The result to come of work that tells its progress and can be cancelled."""

    def __init__(self, executor: Any, stop: Callable[[], None]) -> None:
        super().__init__(executor)
        self._stop = stop

    def cancel(self) -> None:
        """Ask the server to stop; `wait` then raises a `CancelledError` with what there is."""
        self._stop()


class _Goal:
    """A goal on its way; the `Caller` looks after it as after its calls."""

    def __init__(
        self,
        caller: Caller,
        action: tuple[str, Any],
        goal: Any,
        decode: Callable[[Any], Any],
        on_feedback: Callable[[Any], None],
    ) -> None:
        self.name = action[0]
        self.client = caller.action_client(*action)
        self._server = Server(
            caller.node, f"{self.name}/_action/send_goal", f"{type_name(action[1])}_SendGoal"
        )
        self.sent = False
        self.future: GoalFuture[Any] = GoalFuture(caller.future_executor, self.cancel)
        self._caller = caller
        self._goal = goal
        self._decode = decode
        self._on_feedback = on_feedback
        self._handle: Any = None
        self._cancelled = False
        self._hear()

    @property
    def over(self) -> bool:
        """Whether the outcome is known."""
        return bool(self.future.done())

    def advance(self, timeout: float, may_send: Callable[[Any], bool]) -> bool:
        """Send, send again after a restart of the server, or give up; return whether it is over."""
        if self.over:
            return True
        available = self.client.server_is_ready()
        if self._server.has_come() or not available:
            self.sent, self._handle = False, None
        if time.monotonic() > self._heard + timeout:
            self.forget()
            self.future.settle(
                error=self._server.silence(
                    f"{self.name} gave no sign of life for {timeout:g} s", timeout
                )
                if available
                else self._server.absence(timeout)
            )
            return True
        if available and not self.sent and may_send(self.client):
            self.sent = True
            # rclpy loses an answer that comes before the request is noted: send in its thread.
            self._caller.node.executor.create_task(self._send)
        return False

    def forget(self) -> None:
        """Let the server stop; nobody waits for the result."""
        if self._handle is not None and not self.over:
            self._handle.cancel_goal_async()

    def cancel(self) -> None:
        """Ask the server to stop, now or as soon as it has accepted the goal."""
        self._cancelled = True
        if self._handle is not None:
            self._caller.node.executor.create_task(self._handle.cancel_goal_async)

    def _hear(self) -> None:
        self._heard = time.monotonic()

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            self._hear()
            work()
        except Exception as error:
            self.forget()
            self.future.settle(error=error)

    def _send(self) -> None:
        def accept(sent: Any) -> None:
            self._guarded(lambda: self._accept(sent.result()))

        def send() -> None:
            self.client.send_goal_async(self._goal, self._receive_feedback).add_done_callback(
                accept
            )

        self._guarded(send)

    def _accept(self, handle: Any) -> None:
        if not handle.accepted:
            raise LegServiceError(f"{self.name} did not accept the goal")
        self._handle = handle
        result = handle.get_result_async()
        result.add_done_callback(
            lambda answer: self._guarded(lambda: self._receive(answer.result().result))
        )
        if self._cancelled:
            handle.cancel_goal_async()

    def _receive_feedback(self, message: Any) -> None:
        if not self.over:
            self._guarded(lambda: self._on_feedback(message.feedback))

    def _receive(self, result: Any) -> None:
        if result.error.code == ErrorCode.CANCELLED:
            error = CancelledError(result.error.message)
            error.partial = self._decode(result)
            raise error
        check(result.error)
        self.future.settle(self._decode(result))


def send_goal(
    caller: Caller,
    action: tuple[str, Any],
    goal: Any,
    decode: Callable[[Any], T],
    on_feedback: Callable[[Any], None] = lambda feedback: None,
) -> GoalFuture[T]:
    """Send a goal and return the future of its decoded result.

    The time allowed counts from the server's last sign of life: the work itself may take long.

    Args:
        caller: Through which to send.
        action: Name and type of the action.
        goal: The goal.
        decode: Makes the outcome of a result.
        on_feedback: Called with every feedback; what it raises ends the work.
    """
    work = _Goal(caller, action, goal, decode, on_feedback)
    caller.look_after(work)
    return work.future
