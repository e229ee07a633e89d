# SPDX-License-Identifier: Apache-2.0
"""The docs site, as far as it is made without its builder: pages, references, links."""

import html
import re
from pathlib import Path

import pytest
from docs_pages import INTERFACES, ROOT, WRITTEN, public_modules, stage
from test_docs import LINK, anchors, resolve


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the staged pages, and the list of them."""
    folder = tmp_path_factory.mktemp("site")
    return folder, stage(folder, lambda latex, display: f"<math>{display}</math>")


def test_the_list_names_every_page_once(site):
    folder, nav = site
    listed = [
        place
        for section in nav
        for pages in section.values()
        for p in pages
        for place in p.values()
    ]
    assert sorted(listed) == sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*.md"))


def test_every_written_page_of_the_docs_is_in_the_site():
    written = {source for pages in WRITTEN.values() for source in pages.values()}
    assert {p.relative_to(ROOT).as_posix() for p in (ROOT / "docs").glob("*.md")} <= written


def test_every_link_of_the_site_leads_to_a_page_and_its_anchor(site):
    folder, _ = site
    count = 0
    for page in folder.rglob("*.md"):
        text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        for link in LINK.findall(text):
            if link.startswith(("http://", "https://", "mailto:")):
                continue
            place, _, anchor = link.partition("#")
            target = page.parent / place if place else page
            assert target.is_file(), (page, link)
            assert not anchor or anchor in anchors(target), (page, link)
            count += 1
    assert count > 20


@pytest.mark.parametrize("kind", INTERFACES)
def test_the_reference_tells_every_field_with_its_comment(site, kind):
    folder, _ = site
    page = (folder / "interfaces" / f"{kind}.md").read_text()
    for path in (ROOT / "leg_msgs" / kind).glob(f"*.{kind}"):
        (section,) = re.findall(
            rf"^## {path.stem}$(.*?)(?=^## |\Z)", page, re.DOTALL | re.MULTILINE
        )
        for line in path.read_text().splitlines():
            declaration, _, comment = line.partition("#")
            if declaration.strip() in ("", "---"):
                continue
            type_, name = declaration.strip().split(None, 1)
            start = f"| `{name.strip()}` | `{type_}` | "
            rows = [row for row in section.splitlines() if row.startswith(start)]
            said = [
                html.unescape(row).replace("\\", "").removeprefix(start).removesuffix(" |")
                for row in rows
            ]
            assert comment.strip() in said or (not comment and all(said) and said)


def test_the_reference_tells_the_modules_that_hold_what_the_packages_export():
    named = set(public_modules())
    assert all(resolve(name) is not None for name in named)
    for package in ("leg_kinematics", "leg_statics"):
        exports = resolve(f"{package}.exports")
        homes = {getattr(vars(exports)[name], "__module__", None) for name in exports.__all__}
        inner = ("leg_kinematics.mechanisms", "leg_statics.foothold_kernel", "leg_statics.indices")
        assert homes - named - {None, *inner} == set()


def test_equations_become_mathematics_and_code_stays(site):
    folder, _ = site
    text = (folder / "conventions.md").read_text()
    assert "<math>block</math>" in text
    assert "<math>inline</math>" in text
    assert "$" not in text
    assert Path(folder, "index.md").read_text().count("```") == (
        ROOT / "README.md"
    ).read_text().count("```")
