# SPDX-License-Identifier: Apache-2.0
"""One exception for each way a request can fail."""

from __future__ import annotations

from typing import Any

from leg_msgs.msg import ErrorCode


class LegServiceError(Exception):
    """A request failed as a whole.

    Attributes:
        code: A constant of `leg_msgs/ErrorCode`.
        message: The field at fault, its value and what is allowed.
    """

    code: int = ErrorCode.INTERNAL

    def __init__(self, message: str, code: int | None = None) -> None:
        super().__init__(message)
        self.message = message
        if code is not None:
            self.code = code


class UnknownLegError(LegServiceError):
    """The robot has no leg of that name."""

    code = ErrorCode.UNKNOWN_LEG


class InvalidInputError(LegServiceError, ValueError):
    """A field has the wrong length, an impossible value or an unknown name."""

    code = ErrorCode.INVALID_INPUT


class NotConfiguredError(LegServiceError):
    """The node lacks a quantity this request needs."""

    code = ErrorCode.NOT_CONFIGURED


class UnknownGroundError(LegServiceError):
    """No ground of that name is known."""

    code = ErrorCode.UNKNOWN_GROUND


class TooLargeError(LegServiceError):
    """The request asks for more points than the node accepts at once."""

    code = ErrorCode.TOO_LARGE


class TimedOutError(LegServiceError, TimeoutError):
    """No answer came in the time allowed."""

    code = ErrorCode.TIMED_OUT


class ServerUnavailableError(TimedOutError, ConnectionError):
    """No node that serves the request was found, or it went away before it answered."""


class CancelledError(LegServiceError):
    """The caller cancelled the work, or closed the client.

    Attributes:
        partial: What was computed until then; None if there is nothing.
    """

    code = ErrorCode.CANCELLED
    partial: Any = None


class NotSupportedError(LegServiceError):
    """The leg's mechanism does not offer this."""

    code = ErrorCode.NOT_SUPPORTED


class InternalError(LegServiceError):
    """A fault of the node itself; its log tells more."""

    code = ErrorCode.INTERNAL


ERRORS: dict[int, type[LegServiceError]] = {
    error.code: error
    for error in (
        *(UnknownLegError, InvalidInputError, NotConfiguredError, UnknownGroundError),
        *(TooLargeError, TimedOutError, CancelledError, NotSupportedError, InternalError),
    )
}


def check(error: ErrorCode) -> None:
    """Raise the exception of an outcome; return if it is SUCCESS.

    Raises:
        LegServiceError: The class that belongs to the code.
    """
    if error.code != ErrorCode.SUCCESS:
        raise ERRORS.get(error.code, LegServiceError)(error.message, error.code)
