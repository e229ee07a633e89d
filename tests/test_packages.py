# SPDX-License-Identifier: Apache-2.0
"""What a package promises outside its code: manifests, entry points, interfaces, clean files."""

import ast
import importlib
import importlib.metadata
import re
import subprocess
import sys
from pathlib import Path

import pytest
from catkin_pkg.package import parse_package

ROOT = Path(__file__).resolve().parent.parent
MANIFESTS = sorted(ROOT.glob("*/package.xml"))
PYTHON_PACKAGES = [path.parent.name for path in sorted(ROOT.glob("*/setup.py"))]
INTERFACES = sorted(
    path
    for kind in ("msg", "srv", "action")
    for path in (ROOT / "leg_msgs" / kind).glob("*." + kind)
)

# The names under which rosdep knows what is imported under another name.
ROSDEP_KEYS = {"ruamel": "python3-ruamel.yaml"}
# What rosdep has no name for, as `requirements.in` names it: bags, design studies and the view need
# it, docs/installing.md tells to install it.
FROM_PYPI = {
    "backports": "backports.zstd",
    "distributed": "distributed",
    "lz4": "lz4",
    "markdown_it": "markdown-it-py",
    "mujoco": "mujoco-core",
    "pyarrow": "pyarrow",
    "pymoo": "pymoo",
    "rosbags": "rosbags",
    "viser": "viser",
    "xacro": "xacro",
}

LICENCE = "# SPDX-License-Identifier: Apache-2.0\n"
MACHINE_PATH = re.compile(r"(?<![\w.}/])/(root|home|work|Users)/\w")
REGISTRY = re.compile(r"pypi\.org|python[h]osted|npm[j]s|--(extra-)?index[-]url|/simpl[e]/")


def interface_id(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


def declarations(path: Path) -> list[tuple[str, bool]]:
    """Return the fields and constants of an interface file, and whether each has a comment.

    A comment stands behind the declaration, or on the line above it.
    """
    found = []
    above = ""
    for line in path.read_text().splitlines():
        declaration, _, comment = line.partition("#")
        if declaration.strip() not in ("", "---"):
            found.append((declaration.strip(), bool(comment.strip()) or above.startswith("#")))
        above = line
    return found


def imported_modules(package: str) -> set[str]:
    """Return the top-level modules that the code of a package imports."""
    modules = set()
    for path in (ROOT / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                modules |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules.add(node.module.partition(".")[0])
    return modules


def versionable_files() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=True,
        text=True,
    )
    paths = (ROOT / name for name in listed.stdout.split("\0") if name)
    return [path for path in paths if path.is_file()]


def test_the_workspace_has_its_five_packages():
    names = {parse_package(path).name for path in MANIFESTS}
    assert names == {"leg_bringup", "leg_kinematics", "leg_msgs", "leg_msgs_py", "leg_statics"}


@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.parent.name)
def test_manifest_is_valid_and_without_warnings(path):
    warnings = []
    package = parse_package(path, warnings=warnings)
    package.validate(warnings=warnings)
    assert warnings == []
    assert package.package_format == 3
    assert package.licenses == ["Apache-2.0"]


def test_all_packages_have_one_version():
    versions = {parse_package(path).version for path in MANIFESTS}
    versions |= {importlib.metadata.version(name) for name in PYTHON_PACKAGES}
    assert len(versions) == 1


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_what_the_code_imports_is_declared_and_nothing_else(package):
    imported = imported_modules(package) - {package} - set(sys.stdlib_module_names)
    manifest = parse_package(ROOT / package / "package.xml")
    declared = {dependency.name for dependency in manifest.exec_depends}
    missing = {
        name
        for name in imported - set(FROM_PYPI)
        if not {name, f"python3-{name}", ROSDEP_KEYS.get(name)} & declared
    }
    assert missing == set()
    known_as = {key: name for name, key in ROSDEP_KEYS.items()}
    needed = {known_as.get(name, name.removeprefix("python3-")) for name in declared}
    assert needed - imported == set()


def test_what_rosdep_does_not_know_is_required_and_told():
    required = (ROOT / "requirements.in").read_text()
    told = (ROOT / "docs" / "installing.md").read_text()
    for name in FROM_PYPI.values():
        assert re.search(rf"^{re.escape(name)}\b", required, re.MULTILINE), name
        assert name in told


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_every_entry_point_can_be_loaded_and_is_installed(package):
    for entry_point in importlib.metadata.distribution(package).entry_points:
        assert callable(entry_point.load())
        assert Path(sys.prefix, "lib", package, entry_point.name).is_file()


def test_each_node_package_installs_its_node():
    installed = {
        entry_point.name
        for package in PYTHON_PACKAGES
        for entry_point in importlib.metadata.distribution(package).entry_points
    }
    assert {"kinematics_node", "maps_node", "statics_node"} <= installed


@pytest.mark.parametrize("path", INTERFACES, ids=interface_id)
def test_every_field_and_constant_has_a_comment(path):
    bare = [declaration for declaration, commented in declarations(path) if not commented]
    assert bare == []


@pytest.mark.parametrize("path", INTERFACES, ids=interface_id)
def test_interface_is_built_with_the_declared_names(path):
    interface = getattr(importlib.import_module(f"leg_msgs.{path.parent.name}"), path.stem)
    parts = [
        getattr(interface, part, None)
        for part in ("Request", "Response", "Goal", "Result", "Feedback")
    ]
    built = {name for part in [interface, *parts] if part for name in dir(part)}
    declared = {
        re.split(r"[=\s]", declaration.split(None, 1)[1])[0]
        for declaration, _ in declarations(path)
    }
    assert declared <= built


def test_every_source_file_names_its_licence():
    sources = [path for path in versionable_files() if path.suffix in (".py", ".cmake")]
    assert sources
    nameless = [path for path in sources if not path.read_text().startswith(LICENCE)]
    assert nameless == []


def test_no_file_names_a_machine_path_or_a_registry():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line[:100]}"
        for path in versionable_files()
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1)
        if MACHINE_PATH.search(line) or REGISTRY.search(line)
    ]
    assert found == []
