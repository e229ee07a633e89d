# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the client."""

import pytest
from leg_msgs.msg import ErrorCode
from leg_msgs_py import errors

FAILURES = {
    name: value
    for name, value in vars(type(ErrorCode)).items()
    if name.isupper() and isinstance(value, int) and name != "SUCCESS"
} or {
    name: getattr(ErrorCode, name)
    for name in (
        *("UNKNOWN_LEG", "INVALID_INPUT", "NOT_CONFIGURED", "UNKNOWN_GROUND", "TOO_LARGE"),
        *("TIMED_OUT", "CANCELLED", "NOT_SUPPORTED", "INTERNAL"),
    )
}


@pytest.mark.parametrize("code", FAILURES.values(), ids=FAILURES.keys())
def test_every_code_has_a_class_of_its_own(code):
    with pytest.raises(errors.LegServiceError) as caught:
        errors.check(ErrorCode(code=code, message="what was wrong"))
    assert type(caught.value) is errors.ERRORS[code]
    assert caught.value.code == code
    assert caught.value.message == str(caught.value) == "what was wrong"


def test_success_is_silent():
    errors.check(ErrorCode(code=ErrorCode.SUCCESS))


def test_a_code_of_a_newer_server_is_still_an_error():
    with pytest.raises(errors.LegServiceError) as caught:
        errors.check(ErrorCode(code=-1234, message="new"))
    assert caught.value.code == -1234


def test_python_exceptions_catch_the_ones_they_resemble():
    assert issubclass(errors.TimedOutError, TimeoutError)
    assert issubclass(errors.ServerUnavailableError, errors.TimedOutError)
    assert issubclass(errors.InvalidInputError, ValueError)
