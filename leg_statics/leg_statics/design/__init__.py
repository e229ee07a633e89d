# SPDX-License-Identifier: Apache-2.0
"""Choosing the geometry: what designs are worth, searches and the synthesis of the six-bar."""
