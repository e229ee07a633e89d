# SPDX-License-Identifier: Apache-2.0
"""How the pictures look: sizes, fonts, line styles, labels from the index registry, files.

Every picture is a `Figure` made for print at 100 mm width. Functions draw into the one they are
given, for example `plt.figure()` in a notebook, or else into a new one. Pictures do not rely on
colour alone: maps have contour lines, curves have line styles. Lengths are in m, forces in N.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure

from leg_statics.maps import find_layer

MILLIMETRE = 1.0 / 25.4  # in
WIDTH = 100.0  # mm, of every figure
FONT_SIZE = 7.5  # pt
SMALL_FONT_SIZE = 6.5  # pt
COLOUR_MAP = "viridis"
LINE_STYLES = ("-", "--", "-.", ":")
GREEK = ("eta", "mu")
GREY = "0.45"
WORKSPACE_GREY = "0.88"
FORMATS = ("png", "svg", "pdf")  # of files
RESOLUTION = 300  # of files [dots per inch]

# --------------------------------------------------------------------------- labels


def symbol_text(symbol: str) -> str:
    """Return the mathtext of a symbol of the index registry, such as "eta_cF"."""
    base, _, subscript = symbol.partition("_")
    letter = rf"\{base}" if base in GREEK else base
    return rf"${letter}_\mathrm{{{subscript}}}$" if subscript else f"${letter}$"


def layer_label(layer: str) -> str:
    """Return name, symbol and unit of a layer of an index map."""
    symbol, unit, _ = find_layer(layer)
    return f"{layer.replace('_', ' ')} {symbol_text(symbol)} [{unit_text(unit)}]"


def height_title(height: float) -> str:
    """Return the title of the plane z = height."""
    return f"$h$ = {number_text(height, 3)} m"


def unit_text(unit: str) -> str:
    """Return a unit as it is printed."""
    return unit.replace("N.m", "N·m")


def number_text(value: float, digits: int) -> str:
    """Return a number without trailing zeros (two decimals stay) and with a true minus sign."""
    text = f"{value:.{digits}f}"
    while text.endswith("0") and len(text.partition(".")[2]) > 2:
        text = text[:-1]
    return text.replace("-", "−")


# --------------------------------------------------------------------------- figures


def new_figure(figure: Figure | None, height: float) -> Figure:
    """Return a figure of the standard width and a height [mm], ready to draw into."""
    size = (WIDTH * MILLIMETRE, height * MILLIMETRE)
    if figure is None:
        return Figure(figsize=size, layout="constrained")
    figure.clear()
    figure.set_size_inches(*size)
    figure.set_layout_engine("constrained")
    return figure


def plain(ax: Axes) -> None:
    """Set small ticks and thin lines."""
    ax.tick_params(labelsize=SMALL_FONT_SIZE, width=0.5, length=2, pad=2)
    for spine in ax.spines.values():
        spine.set_linewidth(0.5)


def with_legend(figure: Figure, ax: Axes, title: str, columns: int) -> Figure:
    """Put title and legend above the diagrams; a title of its own would lie on the legend."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return titled(figure, title)
    outside_legend(
        figure, handles, labels, columns, fontsize=FONT_SIZE, title=title, handlelength=None
    )
    return figure


def outside_legend(
    figure: Figure,
    handles: Sequence[Any],
    labels: Sequence[str],
    columns: int,
    *,
    fontsize: float,
    title: str = "",
    below: bool = False,
    handlelength: float | None = None,
) -> None:
    """Put a legend above or below the diagrams of a figure, in a strip that is kept free for it.

    matplotlib before 3.7 does not know the places "outside ...".
    """
    columns = min(columns, len(handles))
    rows = math.ceil(len(handles) / columns)
    points = fontsize * (1.5 * rows + 1.0) + (1.5 * (fontsize + 1.0) if title else 0.0)
    strip = points / 72.0 / figure.get_size_inches()[1]
    place = (0.0, strip if below else 0.0, 1.0, 1.0 - strip)
    figure.set_layout_engine("constrained", rect=place)
    figure.legend(
        handles,
        labels,
        loc="lower center" if below else "upper center",
        ncols=columns,
        fontsize=fontsize,
        title=title or None,
        title_fontsize=fontsize + 1.0,
        frameon=False,
        handlelength=handlelength,
    )


def finish_bar(bar: Colorbar, label: str) -> None:
    """Label a colour bar and thin its lines."""
    bar.set_label(label, fontsize=FONT_SIZE)
    bar.ax.tick_params(labelsize=SMALL_FONT_SIZE, width=0.5, length=2)
    bar.outline.set_linewidth(0.5)  # type: ignore[operator]


def titled(figure: Figure, title: str) -> Figure:
    """Put a title, if there is one, above the figure."""
    if title:
        figure.suptitle(title, fontsize=FONT_SIZE + 1.0)
    return figure


def curve_styles(count: int, widest: float = 1.2) -> Iterator[dict[str, Any]]:
    """Yield colour, line style and width of each curve.

    If the widest is wide, each is thinner than those under it: curves that coincide all show.
    """
    colours = mpl.colormaps[COLOUR_MAP](np.linspace(0.0, 0.7, max(count, 2)))
    widths = np.linspace(widest, 1.2, count)
    for k in range(count):
        style = LINE_STYLES[k % len(LINE_STYLES)]
        yield {"color": colours[k], "linestyle": style, "linewidth": widths[k]}


def write_figure(figure: Figure, path: Path) -> Path:
    """Write a picture; the same picture gives the same bytes."""
    stamp = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix.lower())
    with mpl.rc_context({"svg.hashsalt": "leg_statics"}):
        figure.savefig(path, dpi=RESOLUTION, metadata=stamp)
    return path
