# SPDX-License-Identifier: Apache-2.0
"""Tests import what they share from modules beside them."""

import sys
from pathlib import Path

HERE = str(Path(__file__).resolve().parent)
if HERE not in sys.path:
    sys.path.insert(0, HERE)
