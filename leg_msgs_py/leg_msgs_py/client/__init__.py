# SPDX-License-Identifier: Apache-2.0
"""The client for gait planners: numpy arrays in, named tuples out, exceptions for failures.

A module for each family of questions says what is asked, what is answered, and how both travel.
"""

from leg_msgs_py.client.leg_client import SERVICES, LegClient
from leg_msgs_py.frames import Frame
from leg_msgs_py.grounds import Ground

__all__ = ["SERVICES", "Frame", "Ground", "LegClient"]
