# SPDX-License-Identifier: Apache-2.0
"""How services and actions are named: as their types are, in snake case; and how types are."""

from __future__ import annotations

import re
from typing import Any


def interface_name(interface: Any) -> str:
    """Return the name of a service or action below its node's, "query_footholds" of QueryFootholds.

    Args:
        interface: Its type.
    """
    name: str = interface.__name__
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def type_name(interface: Any) -> str:
    """Return the name of a type as the network has it, "leg_msgs/srv/QueryFootholds".

    Args:
        interface: The type of a message, service or action.
    """
    package, kind, *_ = interface.__module__.split(".")
    return f"{package}/{kind}/{interface.__name__}"
