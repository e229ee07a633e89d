# SPDX-License-Identifier: Apache-2.0
"""Prints the seconds that a node takes to import, as JSON."""

import time

START = time.perf_counter()

import json  # noqa: E402

import leg_statics.nodes.statics_node  # noqa: E402, F401

print(json.dumps({"import": time.perf_counter() - START}))
