"""Who may import whom: imports run downward, without a circle, and the mathematics knows no ROS."""

import ast
import os
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("leg_kinematics", "leg_msgs_py", "leg_statics")

# What the modules of a folder may import beside each other: folders, or single modules.
MAY_IMPORT = {
    "leg_kinematics.kernels": {"leg_kinematics.arrays"},
    "leg_kinematics": {"leg_kinematics.kernels", "leg_kinematics.mechanisms"},
    "leg_kinematics.mechanisms": {"leg_kinematics", "leg_kinematics.kernels"},
    "leg_kinematics.nodes": {"leg_kinematics", "leg_msgs_py"},
    "leg_msgs_py": set(),
    "leg_msgs_py.client": {"leg_msgs_py"},
    "leg_msgs_py.recordings": {"leg_msgs_py"},
    "leg_statics.capacity": {"leg_kinematics", "leg_kinematics.kernels", "leg_statics.efforts"},
    "leg_statics": {"leg_kinematics", "leg_kinematics.kernels", "leg_statics.capacity"},
    "leg_statics.drawing": {"leg_kinematics", "leg_statics"},
    "leg_statics.design": {
        *("leg_kinematics", "leg_kinematics.mechanisms"),
        *("leg_statics", "leg_statics.capacity"),
    },
    "leg_statics.design.search": {
        *("leg_kinematics", "leg_kinematics.mechanisms"),
        *("leg_statics", "leg_statics.design", "leg_statics.drawing"),
    },
    "leg_statics.commands": {
        *("leg_kinematics", "leg_statics", "leg_statics.drawing"),
        *("leg_statics.design", "leg_statics.design.search"),
    },
    "leg_statics.nodes": {
        *("leg_kinematics", "leg_kinematics.nodes", "leg_msgs_py"),
        *("leg_statics", "leg_statics.design.search"),
    },
    "leg_statics.recordings": {
        *("leg_kinematics", "leg_kinematics.nodes", "leg_msgs_py", "leg_msgs_py.recordings"),
        *("leg_statics", "leg_statics.nodes", "leg_statics.commands.command_line"),
    },
    # leaves: nobody imports them
    "leg_statics.published": {
        *("leg_kinematics", "leg_kinematics.mechanisms"),
        *("leg_statics", "leg_statics.design", "leg_statics.design.search"),
    },
    "leg_statics.published.figures": {
        *("leg_kinematics", "leg_statics", "leg_statics.published"),
        *("leg_statics.commands", "leg_statics.drawing"),
    },
}

# All others can be imported where there is no ROS: rclpy, or packages of messages.
NEEDS_ROS = {
    *("leg_kinematics.nodes", "leg_statics.nodes"),
    *("leg_msgs_py.recordings", "leg_statics.recordings"),
    *("leg_msgs_py.client", "leg_msgs_py.clouds", "leg_msgs_py.errors", "leg_msgs_py.grounds"),
}

WITHOUT_ROS = """
import importlib
import sys

class NoRos:
    def find_spec(self, name, path=None, target=None):
        package = name.partition(".")[0]
        if package == "rclpy" or package.endswith(("_msgs", "_interfaces")):
            raise RuntimeError(f"{package} is of ROS")  # no ImportError, which may be caught

assert "rclpy" not in sys.modules
sys.meta_path.insert(0, NoRos())
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except Exception as error:
        print(f"{name}: {error}")
"""


def find_modules() -> dict[str, Path]:
    """Return the modules of the packages by name; a package is named without `__init__`."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package / package).rglob("*.py")):
            parts = path.relative_to(ROOT / package).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = find_modules()


def folder_of(module: str) -> str:
    return module if MODULES[module].stem == "__init__" else module.rpartition(".")[0]


@cache
def imports_of(module: str) -> set[str]:
    """Return the modules of the workspace that a module imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            submodules = {f"{node.module}.{alias.name}" for alias in node.names} & set(MODULES)
            found |= submodules if len(submodules) == len(node.names) else {node.module}
    return found & set(MODULES) - {module}


def forbidden_imports(may_import: dict[str, set[str]]) -> list[str]:
    """Return who imports whom against the rules."""
    return [
        f"{module} imports {imported}"
        for module in MODULES
        for imported in sorted(imports_of(module))
        if not {imported, folder_of(imported)} & {folder_of(module), *may_import[folder_of(module)]}
    ]


def needs_ros(module: str) -> bool:
    return any(f"{module}.".startswith(f"{name}.") for name in NEEDS_ROS)


def import_without_ros(modules: list[str], folder: Path) -> str:
    """Return what is wrong with importing modules where there is no ROS."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS, *modules],
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_imports_run_downward():
    assert forbidden_imports(MAY_IMPORT) == []


def test_an_import_against_the_rules_is_found():
    found = forbidden_imports({**MAY_IMPORT, "leg_statics.drawing": {"leg_kinematics"}})
    assert "leg_statics.drawing.maps imports leg_statics.maps" in found


def test_there_is_no_circle():
    try:
        list(TopologicalSorter({name: imports_of(name) for name in MODULES}).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_the_mathematics_is_imported_without_ros(tmp_path):
    modules = [name for name in MODULES if not needs_ros(name)]
    assert {"leg_kinematics.robot", "leg_statics.footholds", "leg_msgs_py.arrays"} <= {*modules}
    assert import_without_ros(modules, tmp_path) == ""


@pytest.mark.parametrize("package", ["rclpy", "leg_msgs.msg", "std_msgs"])
def test_a_module_that_imports_ros_is_found(tmp_path, package):
    (tmp_path / "impure.py").write_text(
        f"try:\n    import {package}\nexcept ImportError:\n    pass\n"
    )
    told = import_without_ros(["leg_kinematics", "impure"], tmp_path)
    assert told == f"impure: {package.partition('.')[0]} is of ROS\n"
