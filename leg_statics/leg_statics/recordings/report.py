# SPDX-License-Identifier: Apache-2.0
"""The report of a judged recording: Markdown with pictures beside it, or one HTML file.

HTML is made from the same Markdown, with the pictures inside.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

from markdown_it import MarkdownIt
from matplotlib.figure import Figure

from leg_kinematics.errors import ValueRangeError
from leg_statics.recordings.report_case import Case
from leg_statics.recordings.report_curves import draw_leg, draw_queries
from leg_statics.recordings.report_text import report_text

SUFFIXES = (".html", ".md")

PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; }}
table {{ border-collapse: collapse; margin: 0.8rem 0; }}
th, td {{ border-bottom: 1px solid #ccc; padding: 0.2rem 0.7rem; text-align: left; }}
td {{ font-variant-numeric: tabular-nums; }}
img {{ max-width: 100%; }}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def check_suffix(path: Path) -> None:
    """Raise a ValueRangeError if a report cannot have this name."""
    if path.suffix not in SUFFIXES:
        raise ValueRangeError(f"report {path}: got {path.suffix!r}; allowed: {', '.join(SUFFIXES)}")


def picture_files(path: Path, shown: Iterable[str]) -> dict[str, Path]:
    """Return the files of the pictures beside a report, by what they show; HTML holds its own."""
    if path.suffix != ".md":
        return {}
    return {name: path.with_name(f"{path.stem}_{name}.png") for name in shown}


def write_report(path: Path, case: Case) -> None:
    """Write the report, as HTML or Markdown by its suffix."""
    pictures = _pictures(case)
    if path.suffix == ".md":
        files = picture_files(path, pictures)
        for name, file in files.items():
            file.write_bytes(pictures[name])
        links = {name: file.name for name, file in files.items()}
        path.write_text(report_text(case, links), encoding="utf-8")
        return
    links = {
        name: f"data:image/png;base64,{base64.b64encode(picture).decode()}"
        for name, picture in pictures.items()
    }
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    body = markdown.render(report_text(case, links))
    title = html.escape(f"Judgement of {case.bag.path.name}")
    path.write_text(PAGE.format(title=title, body=body), encoding="utf-8")


def _pictures(case: Case) -> dict[str, bytes]:
    """Return the curves of legs and queries as PNG, by leg or service."""
    start = case.bag.start
    return {
        **{
            leg: _png(draw_leg(curves, start, case.friction, title=leg))
            for leg, curves in case.findings.curves.items()
        },
        **{
            service: _png(draw_queries(curves, start, case.queries.services[service]))
            for service, curves in case.query_findings.curves.items()
        },
    }


def _png(figure: Figure) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()
