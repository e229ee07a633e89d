# SPDX-License-Identifier: Apache-2.0
"""The same questions put to other software, on the same inputs."""
