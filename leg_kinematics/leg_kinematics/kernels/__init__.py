# SPDX-License-Identifier: Apache-2.0
"""Compiled mathematics: how scalar code of one point becomes code of many."""
