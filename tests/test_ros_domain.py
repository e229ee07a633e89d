# SPDX-License-Identifier: Apache-2.0
"""Runs on one machine do not meet in a ROS domain, nor does one meet what another left."""

import subprocess
import sys
from pathlib import Path

import pytest
import rclpy
import ros_domain

IMPORT = (
    f"import sys; sys.path.append({str(Path(ros_domain.__file__).parent)!r}); import ros_domain"
)
CLAIM = "print(ros_domain.claim_domain(), flush=True)"
OTHER_PORT = 4  # by which runs claim the one domain below, so that no other run disturbs


@pytest.fixture
def domain(monkeypatch):
    """A free domain, for this test the only one there is."""
    domain = int(ros_domain.claim_domain())
    monkeypatch.setattr(ros_domain, "DOMAINS", [domain])
    monkeypatch.setattr(ros_domain, "CLAIM", OTHER_PORT)
    yield domain
    ros_domain._claims.pop().close()


def test_processes_at_once_get_domains_of_their_own():
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", f"{IMPORT}; {CLAIM}; sys.stdin.read()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(3)
    ]
    domains = {process.stdout.readline() for process in processes}
    for process in processes:
        process.communicate()
    assert len(domains) == 3


def test_a_domain_with_a_node_is_not_free(domain):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("left_behind", context=context)
    try:
        with pytest.raises(RuntimeError, match=f"all ROS domains from {domain} to"):
            ros_domain.claim_domain()
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def test_a_domain_is_free_again_when_its_process_has_ended(domain):
    only = f"ros_domain.DOMAINS, ros_domain.CLAIM = [{domain}], {OTHER_PORT}"
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", f"{IMPORT}; {only}; {CLAIM}"], capture_output=True, text=True
        )
        assert done.stdout == f"{domain}\n", done.stderr
