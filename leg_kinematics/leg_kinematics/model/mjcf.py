# SPDX-License-Identifier: Apache-2.0
"""Reads MJCF with MuJoCo, which knows its defaults, angles and frames; meshes may be missing.

Bodies, sites and named geoms are links; what an `<equality>` connects or welds closes loops.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from leg_kinematics.arrays import FloatArray
from leg_kinematics.errors import DescriptionError
from leg_kinematics.model.tree import FRAME, Closure, ModelJoint, ModelLink, ModelTree

WORLD = "world"
LEAST_MASS = 1e-12  # kg, what MuJoCo gives a body without inertia; its mass is not known


def read_mjcf(path: Path) -> ModelTree:
    """Read an MJCF file.

    Raises:
        DescriptionError: If MuJoCo is missing or refuses the file, or joints are coupled otherwise
            than by points and frames.
    """
    try:
        import mujoco
    except ImportError:
        raise DescriptionError(
            f"{path}: to read MJCF files, install the package mujoco-core"
        ) from None
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        without_mass = _leave_meshes_out(mujoco, spec)
        model = spec.compile()
    except ValueError as error:
        raise DescriptionError(f"{path}: {' '.join(str(error).split())}") from None
    return _Reader(mujoco, model, path, without_mass).tree()


def _leave_meshes_out(mujoco: Any, spec: Any) -> set[str]:
    """Take what needs other files out of a model; return the bodies whose mass came from it."""
    without_mass = set()
    spec.compiler.boundmass = spec.compiler.boundinertia = LEAST_MASS  # of an empty frame
    for geom in list(spec.geoms):
        if geom.type in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD):
            if not geom.parent.explicitinertial:
                without_mass.add(geom.parent.name)
            spec.delete(geom)
    for assets in (spec.skins, spec.meshes, spec.hfields, spec.materials, spec.textures):
        for asset in list(assets):
            spec.delete(asset)
    return without_mass


class _Reader:
    """Reads the arrays of one compiled model."""

    def __init__(self, mujoco: Any, model: Any, path: Path, without_mass: set[str]) -> None:
        self.mujoco = mujoco
        self.model = model
        self.path = path
        self.without_mass = without_mass
        self.links: dict[str, ModelLink] = {}
        self.joints: dict[str, ModelJoint] = {}

    def tree(self) -> ModelTree:
        model = self.model
        self.bodies = [WORLD] + [model.body(k).name or f"body_{k}" for k in range(1, model.nbody)]
        self.links[WORLD] = ModelLink(WORLD, None, np.zeros(3))
        for k in range(1, model.nbody):
            self._body(k)
        for kind, count in (("site", model.nsite), ("geom", model.ngeom)):
            for k in range(count):
                part = getattr(model, kind)(k)
                if part.name and part.name not in self.links:
                    self._marker(part.name, int(part.bodyid[0]), part.pos)
        closures = tuple(self._closure(k) for k in range(model.neq) if model.eq_active0[k])
        name = self.path.stem
        return ModelTree(name, self.links, self.joints, closures, str(self.path))

    def _body(self, k: int) -> None:
        model, name = self.model, self.bodies[k]
        mass = float(model.body_mass[k])
        known = name not in self.without_mass and mass > LEAST_MASS
        self.links[name] = ModelLink(name, mass if known else None, model.body_ipos[k].copy())
        joints = range(model.body_jntadr[k], model.body_jntadr[k] + model.body_jntnum[k])
        types = [int(model.jnt_type[j]) for j in joints]
        if int(self.mujoco.mjtJoint.mjJNT_FREE) in types:
            return  # a base
        parent = self.bodies[model.body_parentid[k]]
        position, rotation = model.body_pos[k].copy(), _matrix(model.body_quat[k])
        anchor = np.zeros(3)
        for j in joints:
            joint = self._joint(
                j, parent, position + rotation @ (model.jnt_pos[j] - anchor), rotation
            )
            self.links.setdefault(joint.child, ModelLink(joint.child, None, np.zeros(3)))
            self.joints[joint.child] = joint
            parent, position, rotation = joint.child, np.zeros(3), _matrix([1.0, 0.0, 0.0, 0.0])
            anchor = model.jnt_pos[j].copy()
        self._fix(name, parent, position - rotation @ anchor, rotation)

    def _joint(self, j: int, parent: str, position: FloatArray, rotation: FloatArray) -> ModelJoint:
        model = self.model
        hinge, slide = map(
            int, (self.mujoco.mjtJoint.mjJNT_HINGE, self.mujoco.mjtJoint.mjJNT_SLIDE)
        )
        name = model.joint(j).name or f"joint_{j}"
        kind = int(model.jnt_type[j])
        if kind not in (hinge, slide):
            raise DescriptionError(
                f"{self.path}: joint {name!r} of body {self.bodies[model.jnt_bodyid[j]]!r}: type "
                "ball; allowed: hinge, slide"
            )
        axis = model.jnt_axis[j].copy()
        reference = float(model.qpos0[model.jnt_qposadr[j]])
        if kind == hinge:
            quaternion = np.zeros(4)
            self.mujoco.mju_axisAngle2Quat(quaternion, axis, -reference)
            rotation = rotation @ _matrix(quaternion)
        else:
            position = position - rotation @ axis * reference
        limits = (-math.inf, math.inf)
        if model.jnt_limited[j]:
            limits = float(model.jnt_range[j, 0]), float(model.jnt_range[j, 1])
        return ModelJoint(
            name=name,
            type="revolute" if kind == hinge else "prismatic",
            parent=parent,
            child=f"{name}.link",
            rotation=rotation,
            position=position,
            axis=axis,
            limits=limits,
            effort=self._effort(j),
            place=f"{self.path}: joint {name!r}",
        )

    def _effort(self, j: int) -> tuple[float, float] | None:
        """Return what the actuators of a joint can do together, as far as the file bounds it."""
        model = self.model
        lower = upper = 0.0
        for k in range(model.nu):
            of_joint = model.actuator_trntype[k] == int(self.mujoco.mjtTrn.mjTRN_JOINT)
            if not of_joint or model.actuator_trnid[k, 0] != j:
                continue
            gear = float(model.actuator_gear[k, 0])
            if model.actuator_forcelimited[k]:
                ends = model.actuator_forcerange[k] * gear
            elif model.actuator_ctrllimited[k] and not model.actuator_biasprm[k].any():
                ends = model.actuator_ctrlrange[k] * model.actuator_gainprm[k, 0] * gear
            else:
                continue
            lower, upper = lower + float(min(ends)), upper + float(max(ends))
        if model.jnt_actfrclimited[j]:
            ends = model.jnt_actfrcrange[j]
            if not upper > lower:
                return float(ends[0]), float(ends[1])
            lower, upper = max(lower, float(ends[0])), min(upper, float(ends[1]))
        return (lower, upper) if upper > lower else None

    def _marker(self, name: str, body: int, position: FloatArray) -> None:
        self.links[name] = ModelLink(name, None, np.zeros(3))
        self._fix(name, self.bodies[body], position.copy(), np.eye(3))

    def _fix(self, name: str, parent: str, position: FloatArray, rotation: FloatArray) -> None:
        place = f"{self.path}: body {name!r}"
        self.joints[name] = ModelJoint(
            f"{name}.fixed", "fixed", parent, name, rotation, position, np.array([1.0, 0.0, 0.0]),
            (-math.inf, math.inf), None, place,
        )  # fmt: skip

    def _closure(self, k: int) -> Closure:
        model = self.model
        connect, weld = map(int, (self.mujoco.mjtEq.mjEQ_CONNECT, self.mujoco.mjtEq.mjEQ_WELD))
        place = f"{self.path}: equality {model.equality(k).name or k}"
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        data, kind = model.eq_data[k], int(model.eq_type[k])
        if kind not in (connect, weld):
            raise DescriptionError(f"{place}: allowed: connect, weld")
        if model.eq_objtype[k] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            one, other = (model.site(s).name for s in (first, second))
            points = FRAME if kind == weld else FRAME[:1]
            turns = [_matrix(model.site_quat[s]) for s in (first, second)]
            return Closure(one, points @ turns[0].T, other, points @ turns[1].T, place)
        one, other = self.bodies[first], self.bodies[second]
        if kind == connect:
            return Closure(one, data[None, 0:3].copy(), other, data[None, 3:6].copy(), place)
        points = data[3:6] + FRAME @ _matrix(data[6:10]).T
        return Closure(one, points, other, FRAME, place)


def _matrix(quaternion: Any) -> FloatArray:
    """Return the rotation of a quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternion, dtype=np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
