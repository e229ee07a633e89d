# SPDX-License-Identifier: Apache-2.0
"""Study files: what a geometry search varies, wants and may spend, as checked YAML.

A file has this form (lengths and angles in the units it states, all else in SI):

    version: 1
    name: three_lengths
    units: {length: mm, angle: deg}
    base: {robot: hexapod, leg_type: initial}      # robot: shipped, or a path from this file
    parameters:                                    # any of the mechanism's geometry
      drive_lever: {from: 100, to: 160}            # a continuous range
      parallelogram_link: {from: 250, to: 350, step: 10}
      shank_length: {values: [320, 360, 450]}
    objectives: [condition_number, unit_effort_capacity]   # lower or higher, as each has it
    constraints:
      step_length: {min: 300}                      # min, max or both
    record: [unit_moment_effort]                   # optional: further metrics for the table
    conditions:                                    # what steps and load capacity are measured under
      ground: cement                               # the low end of its friction, or a coefficient
      load: 300                                    # optional: to be borne on all of a step [N]
      heights: [-700, -650, -600]                  # optional: of the foot, for steps
      criterion: rated_friction                    # of a step's points; default: capacity
    method: {name: nsga2, designs: 2000, population: 40}
    seed: 1                                        # optional, default 0
    tolerance: 0.005                               # optional: relative error of the means

Effort limits are those of the leg type.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.description import UNITS, find_robot_file, leg_types_of, robot_from_document
from leg_kinematics.documents import NAME, NUMBER, Document, mapping_schema
from leg_kinematics.errors import LegError, UnknownNameError
from leg_kinematics.files import exists, user_path
from leg_kinematics.geometry import SI_UNITS, geometry_parameters
from leg_kinematics.robot import Leg
from leg_statics.design.designs import METRICS, Conditions, missing_condition, supported_metrics
from leg_statics.design.search.methods import METHODS, Draw
from leg_statics.design.search.study import Constraint, Parameter, Study
from leg_statics.grounds import load_grounds
from leg_statics.step_length import Criterion

VERSION = 1
MOST_VALUES = 100_000  # of one parameter
LEAST = {"designs": 1, "population": 8}  # an optimiser needs some variety
MOST = {"designs": 10**9, "population": 10**5}
MOST_SEED = 2**32 - 1

SPAN_SCHEMA = mapping_schema({"from": NUMBER, "to": NUMBER}, ["from", "to"])
STEPS_SCHEMA = mapping_schema(
    {"from": NUMBER, "to": NUMBER, "step": {**NUMBER, "exclusiveMinimum": 0}},
    ["from", "to", "step"],
)
CONDITIONS_SCHEMA = mapping_schema(
    {
        "ground": {
            "description": "the name of a ground or a friction coefficient >= 0",
            "oneOf": [NAME, {**NUMBER, "minimum": 0}],
        },
        "load": {**NUMBER, "minimum": 0},
        "heights": {"type": "array", "items": NUMBER, "minItems": 1},
        "criterion": {"enum": [criterion.name.lower() for criterion in Criterion]},
    },
    [],
)
VALUES_SCHEMA = mapping_schema(
    {"values": {"type": "array", "items": NUMBER, "minItems": 1, "uniqueItems": True}}, ["values"]
)
LIMITS_SCHEMA = {**mapping_schema({"min": NUMBER, "max": NUMBER}, []), "minProperties": 1}
NAMES_SCHEMA = {"type": "array", "items": NAME, "uniqueItems": True}
METHOD_SCHEMAS = {
    name: mapping_schema(
        {
            "name": {"const": name},
            **{
                key: {"type": "integer", "minimum": LEAST[key], "maximum": MOST[key]}
                for key in method.keys
            },
        },
        ["name", *method.keys],
    )
    for name, method in METHODS.items()
}
STUDY_SCHEMA = mapping_schema(
    {
        "version": {"const": VERSION},
        "name": NAME,
        "units": mapping_schema(
            {k: {"enum": list(UNITS[k])} for k in ("length", "angle")}, ["length", "angle"]
        ),
        "base": mapping_schema({"robot": {"type": "string"}, "leg_type": NAME}, ["leg_type"]),
        "parameters": {"type": "object", "minProperties": 1, "propertyNames": NAME},
        "objectives": {**NAMES_SCHEMA, "minItems": 1},
        "constraints": {
            "type": "object",
            "propertyNames": NAME,
            "additionalProperties": LIMITS_SCHEMA,
        },
        "record": NAMES_SCHEMA,
        "conditions": CONDITIONS_SCHEMA,
        "method": {
            "type": "object",
            "properties": {"name": {"enum": list(METHODS)}},
            "required": ["name"],
        },
        "seed": {"type": "integer", "minimum": 0, "maximum": MOST_SEED},
        "tolerance": {**NUMBER, "exclusiveMinimum": 0, "exclusiveMaximum": 1},
    },
    ["version", "name", "units", "base", "parameters", "objectives", "method"],
)


def load_study(path: str | os.PathLike[str]) -> Study:
    """Load a study file.

    Raises:
        DescriptionError: If anything in it is wrong; the message names file, line, key, the value
            and what is allowed.
    """
    document = Document(user_path(path))

    def find_beside(source: str) -> Path:
        beside = document.path.parent / user_path(source)
        return beside if exists(beside) else find_robot_file(source)

    return study_from_document(document, find_robot=find_beside)


def study_from_document(
    document: Document, robot: str = "", find_robot: Callable[[str], Path] = find_robot_file
) -> Study:
    """Build a study from a parsed file.

    Args:
        document: The file.
        robot: Robot of a study that names none; "" if it must.
        find_robot: Finds the description of a robot that a study names, or raises a LegError.

    Raises:
        DescriptionError: If anything in it is wrong.
    """
    _check_version(document)
    document.check(STUDY_SCHEMA)
    root = document.root
    document.check(METHOD_SCHEMAS[root["method"]["name"]], "method")
    units = {k: UNITS[k][v] for k, v in root["units"].items()} | {"ratio": 1.0}
    robot_document, leg = _load_base(document, robot, find_robot)
    parameters = tuple(
        _parameter(document, name, leg.geometry, units) for name in root["parameters"]
    )
    study = Study(
        document=document,
        robot=robot_document,
        leg=leg,
        parameters=parameters,
        objectives=tuple(root["objectives"]),
        constraints=tuple(
            _constraint(document, name, units) for name in root.get("constraints", {})
        ),
        record=tuple(root.get("record", [])),
        conditions=_conditions(document, units),
        method=str(root["method"]["name"]),
        draw=_draw(document, parameters),
    )
    _check_metrics(study)
    return study


def _check_version(document: Document) -> None:
    root = document.root
    if isinstance(root, Mapping) and root.get("version", VERSION) != VERSION:
        raise document.error(
            f"{root['version']!r}: this program reads version {VERSION}", "version"
        )


def _load_base(
    document: Document, robot: str, find_robot: Callable[[str], Path]
) -> tuple[Document, Leg]:
    """Return the robot's description and a leg of the type to be improved."""
    base = document.root["base"]
    if not base.get("robot", robot):
        raise document.error("missing key 'robot'", "base")
    try:
        path = find_robot(str(base["robot"])) if "robot" in base else find_robot_file(robot)
        description = Document(path)
        robot_from_document(description)
        if base["leg_type"] not in description.root["leg_types"]:
            raise UnknownNameError("leg type", base["leg_type"], description.root["leg_types"])
    except UnknownNameError as error:
        raise document.error(str(error), "base", "leg_type") from None
    except LegError as error:
        raise document.error(str(error), "base", "robot") from None
    return description, leg_types_of(Document(path, description.text))[base["leg_type"]]


def _parameter(
    document: Document, name: str, mechanism: Any, units: Mapping[str, float]
) -> Parameter:
    where = ("parameters", name)
    fields = {f.name: f for f in geometry_parameters(mechanism)}
    if name not in fields:
        raise document.error(_unknown("parameter", name, list(fields)), *where)
    entry = document.node(*where)
    keys = entry if isinstance(entry, Mapping) else {}
    schema = VALUES_SCHEMA if "values" in keys else STEPS_SCHEMA if "step" in keys else SPAN_SCHEMA
    document.check(schema, *where)
    metadata = fields[name].metadata
    scale = units[metadata["dimension"]]
    if "values" in keys:
        values = tuple(float(value) * scale for value in entry["values"])
    else:
        values = _steps(document, entry, scale, *where)
    lower, upper = (
        (min(values), max(values)) if values else (entry["from"] * scale, entry["to"] * scale)
    )
    if metadata["positive"] and lower <= 0.0:
        raise document.error(f"{lower / scale:g}: the least value must be > 0", *where)
    return Parameter(
        name,
        metadata["symbol"],
        SI_UNITS[metadata["dimension"]],
        float(lower),
        float(upper),
        values,
    )


def _steps(
    document: Document, entry: Mapping[str, float], scale: float, *where: str
) -> tuple[float, ...]:
    """Return the values of a range with a step; none for a continuous range."""
    lower, upper = entry["from"], entry["to"]
    if not lower < upper:
        raise document.error(f"{upper!r}: must be > from = {lower!r}", *where, "to")
    if "step" not in entry:
        return ()
    step = entry["step"]
    count = (float(upper) - float(lower)) / step
    if not count < MOST_VALUES:
        raise document.error(
            f"{step!r}: makes {count:.3g} values; allowed: {MOST_VALUES}", *where, "step"
        )
    if abs(count - round(count)) > 1e-6:
        raise document.error(
            f"{step!r}: from = {lower!r} to = {upper!r} is no whole number of steps",
            *where,
            "step",
        )
    # like linspace, so that the ends are exact
    return tuple(np.linspace(lower * scale, upper * scale, round(count) + 1).tolist())


def _constraint(document: Document, name: str, units: Mapping[str, float]) -> Constraint:
    where = ("constraints", name)
    limits = document.node(*where)
    unit = METRICS[name].unit if name in METRICS else "1"  # unknown ones are told with the others
    scale = units["length"] if unit == "m" else 1.0
    lower, upper = limits.get("min", -math.inf), limits.get("max", math.inf)
    if lower > upper:
        raise document.error(f"{upper!r}: must be >= min = {lower!r}", *where, "max")
    return Constraint(name, float(lower) * scale, float(upper) * scale)


def _conditions(document: Document, units: Mapping[str, float]) -> Conditions:
    entry = document.root.get("conditions", {})
    ground = entry.get("ground")
    if isinstance(ground, str):
        try:
            ground = load_grounds().find(ground).friction_low
        except UnknownNameError as error:
            raise document.error(str(error), "conditions", "ground") from None
    return Conditions(
        friction=None if ground is None else float(ground),
        load=float(entry.get("load", 0.0)),
        heights=tuple(float(height) * units["length"] for height in entry.get("heights", [])),
        criterion=Criterion[entry.get("criterion", Criterion.CAPACITY.name).upper()],
        tolerance=float(document.root.get("tolerance", 0.005)),
    )


def _check_metrics(study: Study) -> None:
    """Raise if a metric does not exist, or cannot be evaluated for this leg."""
    places: list[tuple[str, Any, str]] = [
        *(("objectives", k, name) for k, name in enumerate(study.objectives)),
        *(("constraints", c.metric, c.metric) for c in study.constraints),
        *(("record", k, name) for k, name in enumerate(study.record)),
    ]
    for *where, name in places:
        if name not in METRICS:
            raise study.document.error(_unknown("metric", name, list(METRICS)), *where)
        mechanism = study.leg.mechanism
        if name not in supported_metrics(mechanism):
            raise study.document.error(
                f"mechanism {mechanism.name!r} has no {name}; it has: "
                f"{', '.join(supported_metrics(mechanism))}",
                *where,
            )
        if missing_condition(name, study.conditions):
            raise study.document.error(f"{name!r} needs conditions.ground", *where)


def _unknown(kind: str, name: str, allowed: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, allowed, 1)
    guess = f"; did you mean {close[0]!r}?" if close else ""
    return f"{UnknownNameError(kind, name, allowed)}{guess}"


def _draw(document: Document, parameters: Sequence[Parameter]) -> Draw:
    root = document.root
    method = root["method"]
    cells = tuple(len(p.values) or None for p in parameters)
    designs = method.get("designs", 0)
    if method["name"] == "grid":
        for parameter, count in zip(parameters, cells, strict=True):
            if count is None:
                raise document.error(
                    "a grid needs a step or values for every parameter",
                    "parameters",
                    parameter.name,
                )
        designs = math.prod(count for count in cells if count)
        if designs > MOST["designs"]:
            raise document.error(
                f"{designs} combinations; allowed: at most {MOST['designs']}", "parameters"
            )
    population = method.get("population", 1)
    if designs < population:
        raise document.error(
            f"{designs}: must be >= population = {population}", "method", "designs"
        )
    return Draw(
        cells, len(root["objectives"]), int(designs), int(population), int(root.get("seed", 0))
    )
