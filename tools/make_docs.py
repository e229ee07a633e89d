# SPDX-License-Identifier: Apache-2.0
"""Build the docs site into a folder; a link that leads nowhere ends it with exit code 1."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from docs_pages import PACKAGES, ROOT, Nav, stage
from latex2mathml.converter import convert
from mkdocs.commands.build import build
from mkdocs.config import load_config
from mkdocs.exceptions import Abort
from pymdownx.superfences import fence_code_format

OPTIONS = {
    "docstring_style": "google",
    "docstring_options": {"warn_unknown_params": False, "warnings": False},
    "members_order": "source",
    "show_root_heading": False,
    "show_root_toc_entry": False,
    "show_source": False,
    "show_signature_annotations": True,
    "separate_signature": True,
    "heading_level": 2,
}


def main() -> int:
    """Build the site."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "site", metavar="DIR")
    output = parser.parse_args().output.resolve()
    with tempfile.TemporaryDirectory() as folder:
        pages = Path(folder, "docs")
        nav = stage(pages, lambda latex, display: convert(latex, display=display))
        config = Path(folder, "mkdocs.yml")
        config.write_text("site_name: Leg capacity\n")
        try:
            build(load_config(str(config), **settings(nav, pages, output)))
        except Abort:
            return 1
    print(f"{output / 'index.html'}")
    return 0


def settings(nav: Nav, pages: Path, output: Path) -> dict[str, Any]:
    """Return the settings of mkdocs."""
    mermaid = {"name": "mermaid", "class": "mermaid", "format": fence_code_format}
    return {
        "docs_dir": str(pages),
        "site_dir": str(output),
        "strict": True,
        "use_directory_urls": False,  # so that it can be read from a disk
        "nav": nav,
        "validation": {"links": {"anchors": "warn"}},
        "theme": {"name": "material", "font": False, "features": ["navigation.tabs"]},
        "plugins": [
            "search",
            {
                "mkdocstrings": {
                    "handlers": {
                        "python": {
                            "paths": [str(ROOT / package) for package in PACKAGES],
                            "options": OPTIONS,
                        }
                    }
                }
            },
        ],
        "markdown_extensions": [
            "attr_list",
            "tables",
            {"toc": {"permalink": True}},
            "pymdownx.highlight",
            {"pymdownx.superfences": {"custom_fences": [mermaid]}},
        ],
    }


if __name__ == "__main__":
    sys.exit(main())
