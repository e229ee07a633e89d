# SPDX-License-Identifier: Apache-2.0
"""Elements of XML whose numbers are written so that they are read back as they were."""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

WHOLE_TURN = 2.0 * math.pi - 1e-9  # rad, a range that limits nothing


def numbers(values: Iterable[float]) -> str:
    """Return numbers as text, each the shortest that is read back as the same."""
    return " ".join(repr(float(value)) for value in values)


def add(parent: Element, tag: str, **attributes: str | float | Iterable[float]) -> Element:
    """Add an element whose attributes are texts, numbers or rows of numbers."""
    return ElementTree.SubElement(
        parent,
        tag,
        {
            name: value
            if isinstance(value, str)
            else numbers([value] if isinstance(value, (int, float)) else value)
            for name, value in attributes.items()
        },
    )


def document(root: Element, comment: str) -> str:
    """Return an XML file as text, with a comment before it."""
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0"?>\n<!-- {comment} -->\n{body}\n'


def is_bounded(kind: str, limits: tuple[float, float]) -> bool:
    """Tell whether a range limits a joint."""
    lower, upper = limits
    return math.isfinite(upper - lower) and not (kind == "revolute" and upper - lower >= WHOLE_TURN)
