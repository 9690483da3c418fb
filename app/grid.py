"""The grid under a picture: something to measure by."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from app.content import Content
from app.drawables import Drawable, lines
from segmap.pose import FloatArray

__all__ = ["caption", "draw", "spacing"]

BOLD = 5
"""every so many lines one is bold"""
MOST_CELLS = 40
"""along the longer side of what is drawn"""
ROOM = 1.0
"""how far the grid goes on beyond what is drawn, in widths of it"""


def spacing(content: Content) -> float:
    """Metres between two lines: 1, or a larger round number for larger maps."""
    widest = max(_size(content))
    step = 1.0
    while widest / step > MOST_CELLS:
        step *= BOLD if math.log10(step).is_integer() else 2.0
    return step


def caption(content: Content) -> str:
    """What the grid measures."""
    step = spacing(content)
    return f"squares of {step:g} m, bold every {BOLD * step:g} m"


def draw(content: Content) -> Iterator[Drawable]:
    """Fine and bold lines, through the origin of the first map's frame."""
    step, palette = spacing(content), content.palette
    for name, every, strength in zip(("fine", "bold"), (step, BOLD * step), palette.grid, strict=True):
        colour = palette.faint(palette.neutral, strength)
        yield Drawable(f"grid/{name}", "grid", "lines", lines(_grid(content, every)), colour, depth=-2, thickness=1.0)


def _size(content: Content) -> tuple[float, float]:
    left, bottom, right, top = content.bounds or (-5.0, -5.0, 5.0, 5.0)
    return right - left, top - bottom


def _grid(content: Content, every: float) -> FloatArray:
    """Lines ``every`` metres, shape (n, 4); they end at whole bold lines, so that they rarely change."""
    left, bottom, right, top = content.bounds or (-5.0, -5.0, 5.0, 5.0)
    room, coarse = ROOM * max(_size(content)), BOLD * spacing(content)
    x1, y1 = (coarse * math.floor((low - room) / coarse) for low in (left, bottom))
    x2, y2 = (coarse * math.ceil((high + room) / coarse) for high in (right, top))
    xs, ys = np.arange(x1, x2 + every / 2.0, every), np.arange(y1, y2 + every / 2.0, every)
    upright = np.stack((xs, np.full_like(xs, y1), xs, np.full_like(xs, y2)), axis=-1)
    level = np.stack((np.full_like(ys, x1), ys, np.full_like(ys, x2), ys), axis=-1)
    return np.concatenate((upright, level))
