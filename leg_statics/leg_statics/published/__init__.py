# SPDX-License-Identifier: Apache-2.0
"""What the papers print, beside what this suite computes: one module a paper."""
