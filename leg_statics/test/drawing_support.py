# SPDX-License-Identifier: Apache-2.0
"""What a figure shows: its panels, colours and texts."""

from __future__ import annotations

from matplotlib.collections import QuadMesh
from matplotlib.text import Text


def meshes(figure):
    """The colour meshes of the panels, without that of a colour bar."""
    return [
        artist
        for ax in figure.axes
        if ax.get_label() != "<colorbar>"
        for artist in ax.collections
        if isinstance(artist, QuadMesh)
    ]


def panels(figure):
    return [ax for ax in figure.axes if ax.get_visible() and ax.get_label() != "<colorbar>"]


def texts(figure):
    """Everything that is written in a figure, also in its legends and the axes inside of axes."""
    return [text.get_text() for text in figure.findobj(Text)]


def labels(figure):
    """Titles, axis labels, x tick labels and legends as they are drawn."""
    found = [text for legend in figure.legends for text in legend.findobj(Text)] + figure.texts
    for ax in figure.axes:
        found += [ax.title, ax.xaxis.label, ax.yaxis.label] if ax.get_visible() else []
    for ax in panels(figure):
        low, high = ax.get_xlim()
        for place, text in zip(ax.get_xticks(), ax.get_xticklabels(), strict=False):
            found += [text] if low <= place <= high else []
    return [text for text in found if text.get_visible() and text.get_text()]
