# SPDX-License-Identifier: Apache-2.0
"""The figures of the papers, drawn from what this suite computes: one module a paper."""
