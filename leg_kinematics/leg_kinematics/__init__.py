# SPDX-License-Identifier: Apache-2.0
"""Kinematics of legs with closed kinematic chains; needs numpy, scipy and numba, not ROS."""

from typing import TYPE_CHECKING

from leg_kinematics.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from leg_kinematics.exports import *  # noqa: F403
    from leg_kinematics.exports import __all__ as __all__
else:
    __getattr__, __dir__ = lazy_exports(__name__)
