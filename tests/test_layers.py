# SPDX-License-Identifier: Apache-2.0
"""Who may import whom: imports run downward, without a circle, and the mathematics knows no ROS.

The layers are those of the table in docs/architecture.md.
"""

import ast
import os
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("leg_kinematics", "leg_msgs_py", "leg_statics")
SPREAD = {"leg_kinematics", "leg_statics"}
PAGE = ROOT / "docs" / "architecture.md"

# All others can be imported where there is no ROS: rclpy, or packages of messages.
NEEDS_ROS = {
    *("leg_kinematics.nodes", "leg_statics.nodes"),
    *("leg_msgs_py.recordings", "leg_statics.recordings"),
    *("leg_msgs_py.client", "leg_msgs_py.clouds", "leg_msgs_py.errors", "leg_msgs_py.frames"),
    *("leg_msgs_py.grounds", "leg_msgs_py.losses"),
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


def read_layers(page: str) -> list[set[str]]:
    """Return the modules and folders of each layer, from the lowest."""
    table = page[page.index("## Who may import whom") : page.index("## Folders beside")]
    rows = [line.split("|")[2] for line in table.splitlines() if line.startswith("| ")]
    names = [set(re.findall(r"`([\w.]+)`", row)) for row in rows]
    return [row for row in names if row]  # the head of the table names none


LAYERS = read_layers(PAGE.read_text())


def layer_of(module: str) -> int | None:
    """Return the number of the layer that names a module, or else the folder it is in.

    The name of a package that is spread over layers stands for its `__init__` only.
    """
    name = module
    while name:
        for number, layer in enumerate(LAYERS):
            if name in layer and (name == module or name not in SPREAD):
                return number
        name = name.rpartition(".")[0]
    return None


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


def upward_imports(imports: dict[str, set[str]]) -> list[str]:
    """Return who imports from a higher layer."""
    return [
        f"{module} imports {imported}"
        for module, names in imports.items()
        for imported in sorted(names)
        if layer_of(imported) > layer_of(module)
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


@pytest.mark.parametrize("module", MODULES)
def test_every_module_has_its_layer(module):
    assert layer_of(module) is not None, f"{PAGE.name} does not say where {module} belongs"


def test_imports_run_downward():
    assert upward_imports({module: imports_of(module) for module in MODULES}) == []


def test_an_import_from_a_higher_layer_is_found():
    drawn = {"leg_statics.drawing.maps": {"leg_statics.maps", "leg_statics.commands.leg_pictures"}}
    assert upward_imports(drawn) == [
        "leg_statics.drawing.maps imports leg_statics.commands.leg_pictures"
    ]


def test_nothing_imports_what_is_published_but_itself():
    importing = [
        module
        for module in MODULES
        if any(name.startswith("leg_statics.published") for name in imports_of(module))
    ]
    assert importing
    assert all(module.startswith("leg_statics.published.") for module in importing)


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
