# SPDX-License-Identifier: Apache-2.0
"""One module for each entry of the table, with a function `rows(settings)`."""
