# SPDX-License-Identifier: Apache-2.0
"""Plug-in for pytest: the fixture `replay` plays recordings into live nodes.

Name it in a `conftest.py` or in the module with the tests:

    pytest_plugins = ["leg_msgs_py.recordings.pytest_replay"]

    def test_my_gait_loads_no_leg_beyond_its_limits(replay):
        outputs = replay.play("my_gait")
        assert_same(outputs, read_messages("my_gait_judged", outputs))

The nodes must run in the ROS domain of the tests, see `ROS_DOMAIN_ID`.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from leg_msgs_py.recordings.replay import Replay


@pytest.fixture(scope="session")
def replay() -> Iterator[Replay]:
    """Plays recordings into the nodes that run, and collects what they publish."""
    with Replay() as player:
        yield player
