# SPDX-License-Identifier: Apache-2.0
"""The pages of the docs site: those that are written, and references made from the sources.

Links to what is no page of the site, such as a source file, become its name.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Pages by section: the title in the list of pages, and where its text is.
WRITTEN: dict[str, dict[str, str]] = {
    "Start": {
        "Leg capacity": "README.md",
        "Installing on a robot": "docs/installing.md",
        "Examples": "examples/README.md",
    },
    "Tutorials": {
        "First query": "docs/first_query.md",
        "Your own leg": "docs/your_own_leg.md",
        "A stance on a terrain": "docs/stance_on_terrain.md",
        "Recordings": "docs/recordings.md",
        "A design study": "docs/design_study.md",
    },
    "Guide": {
        "Conventions": "docs/conventions.md",
        "The view": "docs/view.md",
        "Stances": "docs/stances.md",
        "Physics as witness": "docs/physics.md",
        "Papers and equations": "docs/papers.md",
        "How it is checked": "docs/checks.md",
        "Speed": "benchmarks/README.md",
    },
    "Development": {
        "Architecture": "docs/architecture.md",
        "Contributing": "CONTRIBUTING.md",
        "Changes": "CHANGELOG.md",
    },
}
INTERFACES = {"srv": "Services", "action": "Actions", "msg": "Messages"}
PACKAGES = ("leg_kinematics", "leg_statics", "leg_msgs_py")
# Of no use to who calls the libraries.
INNER = re.compile(
    r"\.(kernels|nodes|published|commands|exports|warm_up)\b|_kernels?\b|\.lazy_exports|\._"
)
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
BLOCKS = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.DOTALL | re.MULTILINE)
DISPLAYED, INLINE = re.compile(r"\$\$(.+?)\$\$", re.DOTALL), re.compile(r"\$([^$\n]+)\$")

Nav = list[dict[str, list[dict[str, str]]]]


def stage(folder: Path, equation: Callable[[str, str], str]) -> Nav:
    """Write all pages of the site and the pictures they show into a folder.

    Args:
        folder: An empty folder.
        equation: Makes HTML of an equation in LaTeX and of its display, "block" or "inline".

    Returns:
        The pages of each section, by title.
    """
    nav: Nav = []
    for section, pages in WRITTEN.items():
        nav.append({section: [{title: place_of(source)} for title, source in pages.items()]})
        for source in pages.values():
            text = with_equations((ROOT / source).read_text(), equation)
            write(folder / place_of(source), with_links(text, source))
    for picture in sorted((ROOT / "docs").glob("*.png")):
        shutil.copy(picture, folder / picture.name)
    nav.append({"Interfaces": list(stage_interfaces(folder))})
    nav.append({"API": list(stage_modules(folder))})
    return nav


def place_of(source: str) -> str:
    """Return where a page stands in the site."""
    path = Path(source)
    if source == "README.md":
        return "index.md"
    return f"{path.parent if path.name == 'README.md' else path.stem}.md".lower()


def with_links(text: str, source: str) -> str:
    """Return a page whose links lead to pages of the site; others become words."""
    pages = {page: place_of(page) for part in WRITTEN.values() for page in part.values()}

    def turned(match: re.Match[str]) -> str:
        picture, words, link = match.groups()
        if link.startswith(("http://", "https://", "mailto:", "#")):
            return match[0]
        place, _, anchor = link.partition("#")
        target = os.path.relpath((ROOT / source).parent / place, ROOT)
        if picture:
            return f"![{words}]({Path(target).name})"
        if target in pages:
            return f"[{words}]({pages[target]}{'#' if anchor else ''}{anchor})"
        return words if words.startswith("`") else f"{words} (`{target}`)"

    return outside(BLOCKS, text, lambda part: LINK.sub(turned, part))


def with_equations(text: str, equation: Callable[[str, str], str]) -> str:
    """Return a page whose equations in LaTeX are HTML."""

    def turned(part: str) -> str:
        part = DISPLAYED.sub(lambda match: equation(match[1], "block"), part)
        return INLINE.sub(lambda match: equation(match[1], "inline"), part)

    return outside(CODE, text, turned)


def outside(code: re.Pattern[str], text: str, change: Callable[[str], str]) -> str:
    """Return a page with all changed but its code."""
    done, parts = 0, []
    for held in code.finditer(text):
        parts += [change(text[done : held.start()]), held[0]]
        done = held.end()
    return "".join([*parts, change(text[done:])])


# --------------------------------------------------------------------------- interfaces


def stage_interfaces(folder: Path) -> Iterator[dict[str, str]]:
    """Write a page for each kind of interface, with what its files say of every field."""
    for kind, title in INTERFACES.items():
        paths = sorted((ROOT / "leg_msgs" / kind).glob(f"*.{kind}"))
        text = "\n\n".join([f"# {title}", *(interface_text(path) for path in paths)])
        place = f"interfaces/{kind}.md"
        write(folder / place, text + "\n")
        yield {title: place}


def interface_text(path: Path) -> str:
    """Return the section of an interface: its comment, then a table for each part of it."""
    heads = {"srv": ["request", "response"], "action": ["goal", "result", "feedback"]}
    names = heads.get(path.suffix[1:], ["fields"])
    lines = path.read_text().splitlines()
    about = []
    while lines and lines[0].startswith("#"):
        about.append(lines.pop(0).lstrip("# "))
    parts: list[list[tuple[str, str, str]]] = [[]]
    above = ""
    for line in lines:
        declaration, _, comment = line.partition("#")
        if declaration.strip() == "---":
            parts.append([])
        elif declaration.strip():
            kind, _, name = declaration.strip().partition(" ")
            parts[-1].append((kind, name.strip(), comment.strip() or above))
            above = ""
        else:
            above = comment.strip()
    text = [f"## {path.stem}", " ".join(about)]
    for name, fields in zip(names, parts, strict=False):
        if fields:
            rows = [f"| `{n}` | `{k}` | {escaped(c)} |" for k, n, c in fields]
            text += ["\n".join([f"| {name} | type | |", "|---|---|---|", *rows])]
    return "\n\n".join(filter(None, text))


def escaped(text: str) -> str:
    """Return text for a cell of a table."""
    return text.replace("|", "\\|").replace("*", "\\*").replace("<", "&lt;")


# --------------------------------------------------------------------------- API


def stage_modules(folder: Path) -> Iterator[dict[str, str]]:
    """Write a page for each module that users of the libraries call."""
    for name in public_modules():
        place = f"api/{name}.md"
        write(folder / place, f"# {name}\n\n::: {name}\n")
        yield {name: place}


def public_modules() -> list[str]:
    """Return the names of the modules that hold something and are no inner ones."""
    names = []
    for package in PACKAGES:
        for path in sorted((ROOT / package / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT / package).with_suffix("").parts)
            if path.name != "__init__.py" and not INNER.search(name):
                names.append(name)
    return names


def write(path: Path, text: str) -> None:
    """Write a page."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
