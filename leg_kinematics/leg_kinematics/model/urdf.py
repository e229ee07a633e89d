# SPDX-License-Identifier: Apache-2.0
"""Reads URDF: links, joints, limits, efforts and masses; of meshes and looks nothing is needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError
from leg_kinematics.files import read_text
from leg_kinematics.model.tree import ModelJoint, ModelLink, ModelTree

MOST_CHARACTERS = 20_000_000
DEEPEST = 100  # elements within each other
TYPES = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
}


class Element:
    """An element of an XML file.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: Its line in the file.
        children: The elements in it.
    """

    def __init__(self, tag: str, attributes: dict[str, str], line: int) -> None:
        self.tag = tag
        self.attributes = attributes
        self.line = line
        self.children: list[Element] = []

    def all(self, tag: str) -> list[Element]:
        """Return the children of that name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Element | None:
        """Return the first child of that name."""
        return next(iter(self.all(tag)), None)


def read_xml(path: Path, text: str | None = None) -> Element:
    """Read the elements of an XML file in bounded time; entities it declares are not expanded.

    Args:
        path: The file.
        text: Its text; None to read it.

    Raises:
        DescriptionError: If it cannot be read or is no XML.
    """
    text = read_text(path, MOST_CHARACTERS) if text is None else text
    parser = expat.ParserCreate()
    document = Element("", {}, 0)
    open_elements = [document]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].children.append(element)
        open_elements.append(element)
        if len(open_elements) > DEEPEST:
            raise DescriptionError(f"{path}:{element.line}: more than {DEEPEST} elements deep")

    def end(tag: str) -> None:
        open_elements.pop()

    def declared(name: str, *_: Any) -> None:
        raise DescriptionError(
            f"{path}:{parser.CurrentLineNumber}: declares an entity {name!r}; allowed: none"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.EntityDeclHandler = declared
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise DescriptionError(f"{path}:{error.lineno}: no XML: {error}") from None
    return document.children[0]


def read_urdf(path: Path, text: str | None = None) -> ModelTree:
    """Read a URDF file.

    Args:
        path: The file, for messages too.
        text: Its text, such as that of an expanded xacro file; None to read the file.

    Raises:
        DescriptionError: If anything in it is wrong; the message names file, line and element.
    """
    root = read_xml(path, text)
    if root.tag != "robot":
        raise DescriptionError(f"{path}:{root.line}: <{root.tag}>; a URDF file is a <robot>")
    reader = _Reader(path)
    links = [reader.link(element) for element in root.all("link")]
    joints = [reader.joint(element) for element in root.all("joint")]
    if not links:
        raise DescriptionError(f"{path}:{root.line}: a robot without a <link>")
    return ModelTree(
        root.attributes.get("name", path.stem),
        reader.unique("link", [(link.name, link) for link in links]),
        reader.unique("joint that holds link", [(joint.child, joint) for joint in joints]),
        (),
        str(path),
    )


class _Reader:
    """Reads elements of one file and tells where they are wrong."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def error(self, element: Element, message: str) -> DescriptionError:
        name = element.attributes.get("name")
        what = f"<{element.tag} name={name!r}>" if name else f"<{element.tag}>"
        return DescriptionError(f"{self.path}:{element.line}: {what}: {message}")

    def unique(self, what: str, named: Sequence[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(named)
        for name in found:
            if sum(other == name for other, _ in named) > 1 and len(found) < len(named):
                raise DescriptionError(f"{self.path}: more than one {what} {name!r}")
        return found

    def text(self, element: Element, attribute: str) -> str:
        value = element.attributes.get(attribute, "")
        if not value:
            raise self.error(element, f"missing attribute {attribute!r}")
        return value

    def numbers(self, element: Element, attribute: str, default: Sequence[float]) -> FloatArray:
        value = element.attributes.get(attribute)
        if value is None:
            return np.array(default, dtype=np.float64)
        try:
            found = np.array([float(part) for part in value.split()])
        except ValueError:
            found = np.empty(0)
        if len(found) != len(default) or not np.isfinite(found).all():
            count = len(default)
            raise self.error(element, f"{attribute}={value!r} must be {count} finite number(s)")
        return found

    def named(self, element: Element, tag: str) -> str:
        child = element.first(tag)
        if child is None:
            raise self.error(element, f"missing element <{tag}>")
        return self.text(child, "link")

    def link(self, element: Element) -> ModelLink:
        name = self.text(element, "name")
        inertial = element.first("inertial")
        mass = None if inertial is None else inertial.first("mass")
        if inertial is None or mass is None:
            return ModelLink(name, None, np.zeros(3))
        value = float(self.numbers(mass, "value", [math.nan])[0])
        if not value >= 0.0:
            raise self.error(element, f"mass {value} must be a number >= 0 [kg]")
        origin = inertial.first("origin")
        centre = np.zeros(3) if origin is None else self.numbers(origin, "xyz", [0.0] * 3)
        return ModelLink(name, value, centre)

    def joint(self, element: Element) -> ModelJoint:
        name, kind = self.text(element, "name"), self.text(element, "type")
        if kind not in TYPES:
            raise self.error(element, f"type {kind!r} is not one of: {', '.join(TYPES)}")
        if element.first("mimic") is not None:
            raise self.error(element, "<mimic> couples joints; allowed: none that does")
        origin = element.first("origin")
        position: FloatArray = np.zeros(3)
        rotation: FloatArray = np.eye(3)
        if origin is not None:
            position = self.numbers(origin, "xyz", [0.0] * 3)
            rotation = _rpy_matrix(self.numbers(origin, "rpy", [0.0] * 3))
        axis: FloatArray = np.array([1.0, 0.0, 0.0])
        of_axis = element.first("axis")
        if of_axis is not None and kind != "fixed":
            axis = self.numbers(of_axis, "xyz", [1.0, 0.0, 0.0])
            length = float(np.linalg.norm(axis))
            if not length > 0.0:
                raise self.error(of_axis, "an axis must not be zero")
            axis = axis / length
        return ModelJoint(
            name=name,
            type=TYPES[kind],  # type: ignore[arg-type]
            parent=self.named(element, "parent"),
            child=self.named(element, "child"),
            rotation=rotation,
            position=position,
            axis=axis,
            limits=self.limits(element, kind),
            effort=self.effort(element),
            place=f"{self.path}:{element.line}",
        )

    def limits(self, element: Element, kind: str) -> tuple[float, float]:
        if kind in ("continuous", "fixed"):
            return -math.inf, math.inf
        limit = element.first("limit")
        if limit is None:
            raise self.error(element, f"a {kind} joint needs <limit lower= upper= effort=>")
        lower, upper = (float(self.numbers(limit, key, [0.0])[0]) for key in ("lower", "upper"))
        if not lower < upper:
            raise self.error(limit, f"lower {lower} must be < upper {upper}")
        return lower, upper

    def effort(self, element: Element) -> tuple[float, float] | None:
        limit = element.first("limit")
        if limit is None or "effort" not in limit.attributes:
            return None
        effort = float(self.numbers(limit, "effort", [0.0])[0])
        if effort < 0.0:
            raise self.error(limit, f"effort {effort} must be >= 0")
        return (-effort, effort) if effort > 0.0 else None


def _rpy_matrix(rpy: FloatArray) -> FloatArray:
    """Return the rotation about the fixed x, then y, then z axis."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    matrix: FloatArray = z @ y @ x
    return matrix


def expanded_xacro(path: Path) -> str:
    """Return the URDF that a xacro file stands for.

    Raises:
        DescriptionError: If the package `xacro` is missing or the file is wrong.
    """
    try:
        import xacro
    except ImportError:
        raise DescriptionError(
            f"{path}: to read xacro files, install the package xacro, or expand the file to URDF"
        ) from None
    try:
        return str(xacro.process_file(str(path)).toxml())
    except Exception as error:  # of whatever the file's expressions do
        raise DescriptionError(f"{path}: {' '.join(str(error).split())}") from None
