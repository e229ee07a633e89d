# SPDX-License-Identifier: Apache-2.0
"""The search for better legs: studies, methods, workers, tables and reports."""
