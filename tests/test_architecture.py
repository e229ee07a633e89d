"""The rules of docs/architecture.md: imports run downward, in no circle; what docs name exists."""

import ast
import graphlib
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("leg_kinematics", "leg_statics", "leg_msgs_py")
ARCHITECTURE, PAPERS = ROOT / "docs" / "architecture.md", ROOT / "docs" / "papers.md"
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/*.md", "examples/*.md", "benchmarks/*.md")
    for page in ROOT.glob(pattern)
)
REFERENCE = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)*)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")


@cache
def modules():
    """The source file of every module of the packages, by the module's name."""
    found = {}
    for package in PACKAGES:
        for path in (ROOT / package / package).rglob("*.py"):
            parts = path.relative_to(ROOT / package).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def executed(tree):
    """Nodes of a module that Python executes, sooner or later."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            for other in node.orelse:
                yield from [other, *executed(other)]
            continue
        yield node
        yield from executed(node)


def imports(tree, found):
    """Modules of the packages that a syntax tree imports."""
    for node in executed(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in found else node.module for name in whole]
        else:
            continue
        yield from (name for name in names if name in found)


@cache
def graph():
    """What each module imports."""
    found = modules()
    return {
        name: set(imports(ast.parse(path.read_text()), found)) - {name}
        for name, path in found.items()
    }


def layers(text):
    """Modules and folders of the table in docs/architecture.md, a list a row, the lowest first."""
    table = text[text.index("## Who may import whom") : text.index("## Folders beside")]
    rows = [line.split("|")[2] for line in table.splitlines() if line.startswith("| ")]
    return [found for row in rows if (found := REFERENCE.findall(row))]


def layer_of(module, rows):
    """Number of the row that names a module or, of the folders it is in, the innermost."""
    named = {name: number for number, row in enumerate(rows) for name in row}
    name = module
    while name not in named:
        parent, _, _ = name.rpartition(".")
        if parent in PACKAGES and parent != "leg_msgs_py":  # each of their folders has its row
            return None
        name = parent
    return named[name]


def upward(imported, rows):
    """Imports from a higher layer, as pairs."""
    return [
        (module, name)
        for module, names in imported.items()
        for name in names
        if layer_of(name, rows) > layer_of(module, rows)
    ]


ROWS = layers(ARCHITECTURE.read_text())


@pytest.mark.parametrize("module", sorted(modules()))
def test_every_module_has_its_layer(module):
    assert layer_of(module, ROWS) is not None, f"docs/architecture.md does not name {module}"


def test_no_module_imports_from_a_higher_layer():
    assert upward(graph(), ROWS) == []


def test_an_import_from_a_higher_layer_would_be_found():
    spoilt = {**graph(), "leg_statics.drawing.maps": {"leg_statics.commands.leg_pictures"}}
    assert upward(spoilt, ROWS) == [
        ("leg_statics.drawing.maps", "leg_statics.commands.leg_pictures")
    ]


def test_imports_run_in_no_circle():
    tuple(graphlib.TopologicalSorter(graph()).static_order())  # raises CycleError


def test_only_published_modules_import_what_is_published():
    within = {name: names for name, names in graph().items() if ".published" not in name}
    assert [name for name, names in within.items() if any(".published" in n for n in names)] == []


def resolve(reference):
    """Import a module, or get what it defines, by its dotted name."""
    parts = reference.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for name in parts[end:]:
            found = getattr(found, name)
        return found
    raise ModuleNotFoundError(reference)


@pytest.mark.parametrize(
    "reference",
    sorted(
        {name for page in (ARCHITECTURE, PAPERS) for name in REFERENCE.findall(page.read_text())}
    ),
)
def test_what_the_docs_name_exists(reference):
    assert resolve(reference) is not None


def test_every_numbered_paper_is_told_and_compared():
    told = set(re.findall(r"^## Paper (\d{3})$", PAPERS.read_text(), re.MULTILINE))
    assert told == {path.stem.removeprefix("paper_") for path in modules_of_papers()}


def modules_of_papers():
    return (ROOT / "leg_statics" / "leg_statics" / "published").glob("paper_*.py")


def paths_of_recipes():
    return sorted(set(re.findall(r"`([\w.-]+/[\w./-]*)`", (ROOT / "CONTRIBUTING.md").read_text())))


@pytest.mark.parametrize("path", [p for p in paths_of_recipes() if not p.startswith(".venv/")])
def test_the_recipes_name_files_that_are_there(path):
    assert (ROOT / path).exists()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_relative_links_lead_somewhere(page):
    for link in LINK.findall(page.read_text()):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        place, _, anchor = link.partition("#")
        target = (page.parent / place).resolve() if place else page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


def anchors(page):
    """Anchors of the headings of a page, as they are made from their words."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
