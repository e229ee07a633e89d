# SPDX-License-Identifier: Apache-2.0
"""Whoever catches `RecordingError` catches whatever recordings can fail with."""

import importlib
import pkgutil

import pytest
from leg_msgs_py import recordings
from leg_msgs_py.recordings.errors import RecordingError

MODULES = [name for _, name, _ in pkgutil.iter_modules(recordings.__path__)]


@pytest.mark.parametrize("name", MODULES)
def test_the_errors_of_recordings_have_one_root(name):
    module = importlib.import_module(f"leg_msgs_py.recordings.{name}")
    own = [
        error
        for error in vars(module).values()
        if isinstance(error, type)
        and issubclass(error, Exception)
        and error.__module__.startswith("leg_msgs_py.recordings")
        and not error.__name__.startswith("_")
    ]
    assert all(issubclass(error, RecordingError) for error in own)
    if name == "errors":
        assert len(own) > 1
