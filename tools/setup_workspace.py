# SPDX-License-Identifier: Apache-2.0
"""Make the workspace usable from a bare machine: virtual environment, dependencies, packages.

Run it with the Python the workspace shall use; `make` does so before every target. It does only
what is missing: a second run looks at the stamps in `.venv` and returns at once. It needs nothing
but the standard library, and the network only when it installs.
"""

import contextlib
import fcntl
import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import xml.etree.ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

OLDEST_PYTHON, NEWEST_PYTHON = (3, 10), (3, 13)  # what the ROS wheels are built for

# Before anything that an older Python would stumble over with an error nobody understands.
if not OLDEST_PYTHON <= sys.version_info[:2] <= NEWEST_PYTHON:
    sys.exit(
        f"This workspace needs Python 3.10 to 3.13 and `{sys.executable}` is Python "
        f"{sys.version_info[0]}.{sys.version_info[1]}; name another one: make PYTHON=python3.12"
    )

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
VENV_PYTHON = VENV / "bin" / "python"
STAMPS = VENV / "workspace.json"
REQUIREMENTS = ROOT / "requirements.txt"
DEMO_ROBOT = "hexapod"
WHEEL_BUILD = ROOT / "tools" / "wheel_build.cmake"

# The interpreter behind this one, when this one is the workspace's own.
BASE_PYTHON = os.path.realpath(sys.executable)
ON_TERMINAL = sys.stdout.isatty()


def main() -> None:
    """Bring the workspace up to date with its sources."""
    with one_at_a_time():
        stamps = read_stamps()
        if stamps.get("environment") != environment_stamp():
            check_prerequisites()
            create_environment()
            stamps = {"environment": environment_stamp(), "packages": {}}
            write_stamps(stamps)
        sources = {name: package_stamp(folder) for name, folder in find_packages().items()}
        changed = [name for name, stamp in sources.items() if stamps["packages"].get(name) != stamp]
        if changed:
            with warm_kernels():
                build(changed)
            write_stamps({**stamps, "packages": sources})


@contextlib.contextmanager
def one_at_a_time() -> Iterator[None]:
    """Hold the workspace for this process; a second one waits, then finds the work done."""
    with Path(__file__).open() as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("Waiting for another set-up of this workspace to end ...", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


# --- what is there, what is wanted ----------------------------------------------------------------


def read_stamps() -> dict[str, Any]:
    """Return what the last set-up completed; empty if there was none, or it was interrupted."""
    try:
        return json.loads(STAMPS.read_text())
    except (OSError, ValueError):
        return {}


def write_stamps(stamps: dict[str, Any]) -> None:
    """Record what is complete, whole or not at all."""
    draft = STAMPS.with_suffix(".draft")
    draft.write_text(json.dumps(stamps, indent=2) + "\n")
    draft.replace(STAMPS)


def environment_stamp() -> list[str]:
    """Return what the environment depends on: the lock, the Python, the place (it cannot move)."""
    lock = hashlib.sha256(REQUIREMENTS.read_bytes()).hexdigest()
    return [lock, sysconfig.get_python_version(), str(VENV)]


def find_packages() -> dict[str, Path]:
    """Return the ROS packages of this workspace, name to folder."""
    return {
        xml.etree.ElementTree.parse(manifest).findtext("name", ""): manifest.parent
        for manifest in sorted(ROOT.glob("*/package.xml"))
    }


def package_stamp(folder: Path) -> str:
    """Return a digest of what a build of the package depends on.

    Python modules are linked into the environment, not copied: of them only the names count.
    """
    digest = hashlib.sha256(WHEEL_BUILD.read_bytes())
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and not {"test", "__pycache__"} & set(name.parts):
            linked = path.suffix == ".py" and path.name != "setup.py"
            digest.update(f"{name}\0".encode() + (b"" if linked else path.read_bytes()))
    return digest.hexdigest()


# --- the environment ------------------------------------------------------------------------------


def check_prerequisites() -> None:
    """End with one clear sentence if the machine lacks what no package can bring."""
    if not sys.platform.startswith("linux"):
        sys.exit(f"The ROS 2 wheels exist for Linux only, and this is {sys.platform}.")
    for module in ("venv", "ensurepip"):
        if importlib.util.find_spec(module) is None:
            sys.exit(
                f"Python's `{module}` module is missing; on Debian or Ubuntu install python3-venv."
            )
    tools = {
        "C compiler": os.environ.get("CC", "cc").split()[0],
        "C++ compiler": os.environ.get("CXX", "c++").split()[0],
        "make": "make",
    }
    for tool, command in tools.items():
        if shutil.which(command) is None:
            sys.exit(
                f"No {tool} (`{command}`) was found; on Debian or Ubuntu install build-essential."
            )
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        sys.exit("Python's header files are missing; on Debian or Ubuntu install python3-dev.")


def create_environment() -> None:
    """Make `.venv` anew with exactly what the lock names."""
    print(f"Creating .venv with Python {sysconfig.get_python_version()} ...", flush=True)
    subprocess.run([BASE_PYTHON, "-m", "venv", "--clear", VENV], check=True)
    print("Installing the dependencies into .venv, about a minute ...", flush=True)
    # The lock is complete, so pip need not resolve anything (--no-deps). Not compiling modules that
    # nobody imports saves a quarter of the time.
    run_module(
        *("pip", "install", "--disable-pip-version-check", "--no-compile"),
        *("--no-deps", "--require-hashes", "--requirement", REQUIREMENTS),
        log="pip.log",
        progress=r"Collecting \S+|Installing collected packages",
    )


# --- the packages of the workspace ----------------------------------------------------------------


def build(packages: list[str]) -> None:
    """Build the packages into `.venv`, so that nodes start with no environment set up."""
    print(f"Building {', '.join(packages)} ...", flush=True)
    run_module(
        *("colcon", "--log-base", VENV / "log" / "colcon", "build"),
        *("--base-paths", ROOT, "--build-base", VENV / "build", "--install-base", VENV),
        *("--merge-install", "--symlink-install", "--packages-select", *packages),
        *("--cmake-args", f"-DCMAKE_PROJECT_INCLUDE={WHEEL_BUILD}", "-DBUILD_TESTING=OFF"),
        log="build.log",
        progress=r"(?:Starting >>>|Finished <<<) .*",
    )
    link_modules()


@contextlib.contextmanager
def warm_kernels() -> Iterator[None]:
    """Compile the mathematics meanwhile: it takes as long as the messages, on another core."""
    sources = os.pathsep.join(str(ROOT / name) for name in ("leg_kinematics", "leg_statics"))
    with (VENV / "log" / "kernels.log").open("w") as record:
        process = subprocess.Popen(
            [VENV_PYTHON, ROOT / "tools" / "warm_kernels.py", DEMO_ROBOT],
            env={**build_environment(), "PYTHONPATH": sources},
            stdout=record,
            stderr=subprocess.STDOUT,
        )
        try:
            yield
            process.wait()  # what failed here fails again, and tells why, where it is used
        finally:
            process.kill()


def link_modules() -> None:
    """Let the environment's Python find the linked packages.

    A symlink install leaves them in the build folder and counts on a sourced shell to name it.
    """
    linked = [
        VENV / "build" / name
        for name, folder in find_packages().items()
        if (folder / "setup.py").exists()
    ]
    site_packages = VENV / "lib" / f"python{sysconfig.get_python_version()}" / "site-packages"
    (site_packages / "workspace.pth").write_text("".join(f"{folder}\n" for folder in linked))


def run_module(*arguments: str | Path, log: str, progress: str) -> None:
    """Run a module of the environment's Python, showing what it is at; its output goes to a log.

    Args:
        arguments: The module and its arguments.
        log: Name of the log file in `.venv/log`.
        progress: Pattern of what to show of the output.
    """
    path = VENV / "log" / log
    path.parent.mkdir(exist_ok=True)
    started = time.monotonic()
    shown = float("-inf")
    with path.open("w") as record:
        process = subprocess.Popen(
            [VENV_PYTHON, "-m", *arguments],
            cwd=ROOT,
            env=build_environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        for line in process.stdout or ():
            record.write(line)
            found = re.search(progress, line)
            seconds = time.monotonic() - started
            if found and (ON_TERMINAL or seconds - shown > 5.0):
                shown = seconds
                show(f"  {seconds:3.0f} s  {found.group()[:80]}")
    if process.wait():
        show("".join(path.read_text().splitlines(keepends=True)[-40:]))
        sys.exit(f"\n`python -m {arguments[0]}` failed; its whole output is in {path}.")
    show(f"  done in {time.monotonic() - started:.0f} s\n")


def show(text: str) -> None:
    """Print a line of progress: on a terminal in place of the last one, elsewhere below it."""
    print(
        f"\r\033[K{text}" if ON_TERMINAL else text.rstrip("\n"),
        end="" if ON_TERMINAL else "\n",
        flush=True,
    )


def build_environment() -> dict[str, str]:
    """Return the environment of an activated `.venv`, with no other ROS showing through."""
    # The ROS wheels restart Python once with LD_LIBRARY_PATH set, and mark it: pass on neither.
    foreign = {"PYTHONPATH", "PYTHONHOME", "LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    environment = {name: value for name, value in os.environ.items() if name not in foreign}
    environment["PATH"] = f"{VENV / 'bin'}{os.pathsep}{environment['PATH']}"
    for name in ("VIRTUAL_ENV", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"):
        environment[name] = str(VENV)
    return environment


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("\nInterrupted; the next run goes on from what was complete.")
