# SPDX-License-Identifier: Apache-2.0
"""Robots as files that other software reads: URDF, MJCF, and the description of such a model."""
