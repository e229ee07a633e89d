# SPDX-License-Identifier: Apache-2.0
"""The judge of recordings: what they tell about the legs, in tables, reports and copies."""
