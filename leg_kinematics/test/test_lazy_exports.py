# SPDX-License-Identifier: Apache-2.0
"""What the package exports is there when it is asked for, and nothing else is."""

import pytest

import leg_kinematics
from leg_kinematics import exports, robot


def test_every_export_is_there():
    assert dir(leg_kinematics) == sorted(exports.__all__)
    for name in leg_kinematics.__all__:
        assert getattr(leg_kinematics, name) is getattr(exports, name)


def test_an_export_is_the_thing_itself():
    assert leg_kinematics.Robot is robot.Robot


@pytest.mark.parametrize("name", ["wings", "__wrapped__", "annotations"])
def test_what_is_not_exported_is_not_there(name):
    with pytest.raises(AttributeError, match=f"'leg_kinematics' has no attribute '{name}'"):
        getattr(leg_kinematics, name)
