# SPDX-License-Identifier: Apache-2.0
"""Programs that entries start as processes of their own."""
