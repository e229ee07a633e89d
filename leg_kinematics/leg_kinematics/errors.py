# SPDX-License-Identifier: Apache-2.0
"""Exceptions for misuse; what happens to single points of a batch is told by a `Status`."""

from __future__ import annotations

from collections.abc import Iterable


class LegError(Exception):
    """Base class of every error this suite raises on purpose."""


class ShapeError(LegError, ValueError):
    """An array argument has a shape the function cannot take."""


class ValueRangeError(LegError, ValueError):
    """A scalar or array argument has a value outside its allowed range."""


class KindError(LegError, TypeError):
    """An argument is something else than the function takes, such as a number for a leg."""


class GeometryError(LegError, ValueError):
    """The dimensions of a mechanism do not describe a leg that can be assembled."""


class DescriptionError(LegError, ValueError):
    """A robot description file is wrong; the message lists every mistake found in it."""


class UnknownNameError(LegError, KeyError):
    """A name (leg, mechanism, assembly mode, index, ground ...) is not one of those that exist."""

    def __init__(self, kind: str, name: str, allowed: Iterable[str]) -> None:
        self.kind = kind
        self.name = name
        self.allowed = tuple(allowed)
        super().__init__(kind, name)

    def __str__(self) -> str:
        """Return the message; `KeyError` would print the repr of its argument."""
        return f"unknown {self.kind} {self.name!r}; allowed: {', '.join(self.allowed)}"


class NotSupportedError(LegError):
    """A mechanism cannot answer this question, e.g. it has no constraint Jacobian."""
