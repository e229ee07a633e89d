# SPDX-License-Identifier: Apache-2.0
"""What the docs name is there: modules and functions, files of recipes, pages of links."""

import ast
import importlib
import importlib.metadata
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ARCHITECTURE, PAPERS = ROOT / "docs" / "architecture.md", ROOT / "docs" / "papers.md"
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/*.md", "examples/*.md", "benchmarks/*.md")
    for page in ROOT.glob(pattern)
)
REFERENCE = re.compile(r"`((?:leg_kinematics|leg_msgs_py|leg_statics)(?:\.\w+)*)`")
LINK = re.compile(r"\]\(([^)\s]+)\)")


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
    assert told == {path.stem.removeprefix("paper_") for path in comparisons()}


def comparisons():
    return (ROOT / "leg_statics" / "leg_statics" / "published").glob("paper_*.py")


def paths_of_recipes():
    return sorted(set(re.findall(r"`([\w.-]+/[\w./-]*)`", (ROOT / "CONTRIBUTING.md").read_text())))


@pytest.mark.parametrize("path", [p for p in paths_of_recipes() if not p.startswith(".venv/")])
def test_the_recipes_name_files_that_are_there(path):
    assert (ROOT / path).exists()


def imported_by_snippets():
    """What the Python snippets of the pages import, as dotted names."""
    text = "".join(page.read_text() for page in PAGES)
    for snippet in re.findall(r"```python[^\n]*\n(.*?)```", text, re.DOTALL):
        for node in ast.walk(ast.parse(snippet)):
            if isinstance(node, ast.ImportFrom):
                yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("reference", sorted(set(imported_by_snippets())))
def test_what_the_snippets_import_exists(reference):
    assert resolve(reference) is not None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_commands_that_a_page_names_exist(page):
    text = page.read_text()
    for package, command in re.findall(r"ros2 run ([a-z]\w+) (\w+)", text):
        scripts = importlib.metadata.distribution(package).entry_points.select(name=command)
        assert scripts, command
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"`make ([a-z-]+)", text)) <= {*targets}


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
