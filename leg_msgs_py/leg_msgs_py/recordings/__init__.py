# SPDX-License-Identifier: Apache-2.0
"""Recordings: written, read, replayed and compared."""
