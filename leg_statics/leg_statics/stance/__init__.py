# SPDX-License-Identifier: Apache-2.0
"""Standing robots: what the legs of a stance carry together."""
