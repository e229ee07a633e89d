# SPDX-License-Identifier: Apache-2.0
"""Exports of a package that are imported when they are first asked for (PEP 562)."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def lazy_exports(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package that exports what its module `exports` names.

    Whatever is imported from the package loads the package itself first. So an entry point can
    handle signals before anything heavy is loaded only if the package loads nothing by itself.

    Args:
        package: Name of the package.
    """

    def get(name: str) -> Any:
        if name == "__all__" or not name.startswith("__"):
            exports = importlib.import_module(f"{package}.exports")
            if name in ("__all__", *exports.__all__):
                return getattr(exports, name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    def names() -> list[str]:
        exported: list[str] = get("__all__")
        return sorted(exported)

    return get, names
