# SPDX-License-Identifier: Apache-2.0
"""Goals of an action that are worked off in order, in a thread that knows nothing of ROS.

The executor of a node has one thread, and a coroutine that waits would keep it busy. So goals wait
in a table, their jobs run in another thread, and a timer tells the progress and ends them.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

from leg_msgs.msg import ErrorCode
from rclpy.action import ActionServer, CancelResponse

from leg_kinematics.nodes.requests import RequestError, error_code
from leg_kinematics.nodes.robot_node import RobotNode

FEEDBACK_PERIOD = 0.1  # s
RESULT_TIMEOUT = 60  # the result of a goal is kept that long [s]
MOST_GOALS = 16  # that wait or are worked off


class Job(Protocol):
    """Work in a thread, ordered by a goal."""

    @property
    def over(self) -> bool:
        """Whether it has ended, one way or another."""

    @property
    def complete(self) -> bool:
        """Whether it has ended with all its work done."""

    def cancel(self) -> None:
        """End soon."""

    def check(self) -> None:
        """Raise what the work raised, if it did."""


class Work(Protocol):
    """What a node has in hand for a goal."""

    @property
    def job(self) -> Job:
        """What runs in the thread."""

    def feedback(self) -> Any:
        """Return the feedback of the goal as it is now."""

    def result(self) -> Any:
        """Return the result of a job that ended without a fault, complete or not."""


@dataclass(frozen=True)
class _Goal:
    handle: Any
    work: Work


class GoalQueue:
    """Serves an action: begins its goals, tells their progress, cancels and ends them.

    A goal that cannot be carried out is accepted and then aborted, so that its result can tell the
    reason.

    Args:
        node: The node that serves.
        action_type: Type of the action; its results begin with an `ErrorCode`.
        name: Name of the action below the node's.
        what: What the work is, in the plural, for messages.
        begin: Orders the work of a request in the thread pool, or raises.
        failure: Records under a name what was raised, and returns the message.
    """

    def __init__(
        self,
        node: RobotNode,
        action_type: Any,
        name: str,
        what: str,
        begin: Callable[[Any, ThreadPoolExecutor], Work],
        failure: Callable[[str, Exception], str],
    ) -> None:
        self._health, self._type, self._name, self._what = node.health, action_type, name, what
        self._begin, self._failure = begin, failure
        self._goals: dict[bytes, _Goal] = {}
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._timer = node.every(FEEDBACK_PERIOD, self._attend)
        self._timer.cancel()
        self._server = ActionServer(
            node,
            action_type,
            f"~/{name}",
            execute_callback=lambda handle: None,  # every goal is given its own
            handle_accepted_callback=self._accept,
            cancel_callback=self._cancel,
            result_timeout=RESULT_TIMEOUT,
        )

    def destroy(self) -> None:
        """End the work under way and no longer serve the action."""
        for goal in self._goals.values():
            goal.work.job.cancel()
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._server.destroy()

    def _accept(self, handle: Any) -> None:
        try:
            if len(self._goals) >= MOST_GOALS:
                raise RequestError(
                    f"goal: {len(self._goals)} {self._what} are waiting; allowed: {MOST_GOALS}",
                    ErrorCode.TOO_LARGE,
                )
            work = self._begin(handle.request, self._pool)
            self._goals[bytes(handle.goal_id.uuid)] = _Goal(handle, work)
            self._timer.reset()
        except Exception as error:
            refusal = self._refusal(error)
            handle.execute(lambda handle: self._abort(handle, refusal))

    def _refusal(self, error: Exception) -> ErrorCode:
        """Record what was raised, and return it for a result."""
        message = self._failure(self._name, error)
        return ErrorCode(code=error_code(error), message=message)

    def _abort(self, handle: Any, error: ErrorCode) -> Any:
        handle.abort()
        return self._type.Result(error=error)

    def _cancel(self, handle: Any) -> CancelResponse:
        goal = self._goals.get(bytes(handle.goal_id.uuid))
        if goal is None:
            return CancelResponse.REJECT
        goal.work.job.cancel()
        return CancelResponse.ACCEPT

    def _attend(self) -> None:
        """Tell how far the goals are, and end those that are over."""
        for key, goal in list(self._goals.items()):
            goal.handle.publish_feedback(goal.work.feedback())
            if goal.work.job.over:
                del self._goals[key]
                goal.handle.execute(lambda handle, goal=goal: self._finish(goal))
        if not self._goals:
            self._timer.cancel()

    def _finish(self, goal: _Goal) -> Any:
        """Return the result of a goal whose job is over."""
        with self._health.timed():
            try:
                goal.work.job.check()
                result = goal.work.result()
            except Exception as error:
                return self._abort(goal.handle, self._refusal(error))
            if goal.work.job.complete:
                result.error.code = ErrorCode.SUCCESS
                goal.handle.succeed()
            else:
                result.error.code = ErrorCode.CANCELLED
                goal.handle.canceled()
            return result
