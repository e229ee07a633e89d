# SPDX-License-Identifier: Apache-2.0
"""Legs of robot models: from a URDF or MJCF file to one compact description of a leg's chain."""
