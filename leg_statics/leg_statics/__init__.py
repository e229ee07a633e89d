# SPDX-License-Identifier: Apache-2.0
"""What a leg can carry: efforts, indices, load capacity, friction and step length; without ROS."""

from typing import TYPE_CHECKING

from leg_kinematics.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from leg_statics.exports import *  # noqa: F403
    from leg_statics.exports import __all__ as __all__
else:
    __getattr__, __dir__ = lazy_exports(__name__)
