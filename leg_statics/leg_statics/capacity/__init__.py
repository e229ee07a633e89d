# SPDX-License-Identifier: Apache-2.0
"""Load capacity: one problem, a quick way for three joints, and one that tries all planes."""
