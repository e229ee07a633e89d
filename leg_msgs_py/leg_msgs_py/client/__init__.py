"""The client for gait planners: numpy arrays in, named tuples out, exceptions for failures."""

from leg_msgs_py.client.leg_client import SERVICES, LegClient

__all__ = ["SERVICES", "LegClient"]
