# SPDX-License-Identifier: Apache-2.0
"""A robot to look at and to play with: what is drawn and said of it, and a page that shows it."""
