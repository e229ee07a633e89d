# SPDX-License-Identifier: Apache-2.0
"""A ROS domain to oneself: without another run on this machine, or a node that one left behind.

It needs no ROS, and must be called before anything loads it.
"""

from __future__ import annotations

import atexit
import os
import socket

DOMAINS = range(1, 102)  # above, their ports are also handed out to others
FIRST_PORT, PORTS = 7400, 250  # of domain 0, and of each domain, as the DDS standard has them
CLAIM = 2  # a port of each domain that no participant takes
PARTICIPANTS = range(10, 110, 2)  # the port that each participant of a domain takes

_claims: list[socket.socket] = []  # held as long as the process lives


def claim_domain() -> str:
    """Return a free ROS domain that stays this process's as long as it lives.

    Raises:
        RuntimeError: If all domains are in use.
    """
    for domain in DOMAINS:
        first = FIRST_PORT + PORTS * domain
        claim = _bound(first + CLAIM)
        if claim is None:
            continue
        if all(_is_free(first + port) for port in PARTICIPANTS):
            _claims.append(claim)
            atexit.register(claim.close)  # or Python warns of it, after all that tests print
            return str(domain)
        claim.close()
    raise RuntimeError(f"all ROS domains from {DOMAINS[0]} to {DOMAINS[-1]} are in use")


def use_own_domain() -> str:
    """Let this process and its children talk in a free ROS domain, on this machine only."""
    os.environ["ROS_DOMAIN_ID"] = claim_domain()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    return os.environ["ROS_DOMAIN_ID"]


def _bound(port: int) -> socket.socket | None:
    """Return a socket that has taken a port, or None if somebody else has."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        bound.bind(("", port))
    except OSError:
        bound.close()
        return None
    return bound


def _is_free(port: int) -> bool:
    bound = _bound(port)
    if bound is not None:
        bound.close()
    return bound is not None
