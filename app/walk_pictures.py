"""The steps of a walkthrough as images for slides: the same shapes, lines and sentences as in the player."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from textwrap import wrap
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from segmap.walkthrough import ALGORITHMS, Shape, Stage, Step, Walkthrough

__all__ = ["ROLES", "SIZE", "picture"]

SIZE = 1280, 720
"""pixels"""
FINER = 2
"""drawn so many times larger, then shrunk: smooth lines"""
WORDS = 400
"""pixels of the column of words"""
MARGIN = 20
ROLES = {
    "first": "#0067be",
    "second": "#e06000",
    "accent": "#c3225b",
    "good": "#12805c",
    "bad": "#c22f2f",
    "new": "#12805c",
    "faint": "#b9c2cb",
    "beam": "#c9a227",
    "shadowed": "#f08c00",
    "supported": "#12805c",
    "contradicted": "#c22f2f",
    "unseen": "#b9c2cb",
    "text": "#18212b",
    "chain-0": "#5834ed",
    "chain-1": "#1d978f",
    "chain-2": "#c3225b",
    "chain-3": "#8a6d00",
    "chain-4": "#00a3c7",
    "chain-5": "#662512",
    "chain-6": "#6f8f00",
    "chain-7": "#b745ca",
}
"""colours on white, those of static/css/figures.css"""
INK, MUTED, SUNKEN, RULE = "#18212b", "#566371", "#eef1f4", "#dbe1e7"

Place = Callable[[float, float], tuple[float, float]]


def picture(walk: Walkthrough, stage: Stage, k: int) -> Image.Image:
    """Step ``k`` of a stage: the picture at the left, the words at the right."""
    step = stage.step(k)
    image = Image.new("RGB", (SIZE[0] * FINER, SIZE[1] * FINER), "white")
    draw = ImageDraw.Draw(image)
    place, scale = _placing(step.box or stage.box or (-5.0, -5.0, 5.0, 5.0))
    for shape in step.shapes:
        _shape(draw, shape, walk, place)
    _ruler(draw, scale)
    draw.rectangle((_px(SIZE[0] - WORDS), 0, _px(SIZE[0]), _px(SIZE[1])), "white")
    _words(draw, stage, step, k)
    return image.resize(SIZE, Image.Resampling.LANCZOS)


def _px(pixels: float) -> float:
    return pixels * FINER


def _placing(box: Sequence[float]) -> tuple[Place, float]:
    """Where a point in metres is drawn, and pixels for a metre."""
    x1, y1, x2, y2 = box
    width, height = SIZE[0] - WORDS - 2 * MARGIN, SIZE[1] - 2 * MARGIN
    scale = min(width / max(x2 - x1, 1e-6), height / max(y2 - y1, 1e-6))
    left, top = MARGIN + (width - scale * (x2 - x1)) / 2.0, MARGIN + (height - scale * (y2 - y1)) / 2.0
    return lambda x, y: (_px(left + scale * (x - x1)), _px(top + scale * (y2 - y))), scale


# --- shapes -----------------------------------------------------------------------------------------


def _shape(draw: ImageDraw.ImageDraw, shape: Shape, walk: Walkthrough, place: Place) -> None:
    colour = _faded(ROLES[shape["role"]]) if shape.get("faded") else ROLES[shape["role"]]
    rows = _rows(shape, walk)
    if shape["kind"] == "text":
        x, y = place(*rows)
        draw.text((x + _px(5), y - _px(16)), shape["text"], colour, _font(15))
    elif shape["kind"] == "points":
        _points(draw, [place(x, y) for x, y in rows], shape, colour)
    else:
        joined = pairwise(rows) if shape["kind"] == "path" else ((r[:2], r[2:]) for r in rows)
        for start, end in joined:
            _line(draw, place(*start), place(*end), _px(shape.get("width", 2)), colour, dashed=bool(shape.get("dash")))


def _faded(colour: str) -> str:
    """A colour mixed into the white ground."""
    return "#" + bytes(round(0.35 * channel + 0.65 * 255) for channel in bytes.fromhex(colour[1:])).hex()


def _rows(shape: Shape, walk: Walkthrough) -> Any:
    """The coordinates of a shape, moved to where it is."""
    held = walk.base[shape["of"]] if "of" in shape else shape["at"]
    if "rows" in shape:
        held = [held[row] for row in shape["rows"]]
    if "pose" not in shape:
        return held
    x, y, theta = shape["pose"]
    cosine, sine = math.cos(theta), math.sin(theta)
    return [
        [
            moved
            for px, py in zip(row[::2], row[1::2], strict=True)
            for moved in (cosine * px - sine * py + x, sine * px + cosine * py + y)
        ]
        for row in held
    ]


def _line(
    draw: ImageDraw.ImageDraw,
    start: tuple[float, float],
    end: tuple[float, float],
    width: float,
    colour: str,
    *,
    dashed: bool,
) -> None:
    if not dashed:
        draw.line((*start, *end), colour, max(1, round(width)))
        return
    length, step = math.dist(start, end), _px(6)
    for begin in range(0, int(length / step) + 1, 2):
        a, b = begin * step / max(length, 1e-9), min(1.0, (begin + 1) * step / max(length, 1e-9))
        ends = [start[axis] + share * (end[axis] - start[axis]) for share in (a, b) for axis in (0, 1)]
        draw.line(ends, colour, max(1, round(width)))


def _points(draw: ImageDraw.ImageDraw, places: list[tuple[float, float]], shape: Shape, colour: str) -> None:
    half = _px(shape.get("size", 5)) / 2.0
    for x, y in places:
        if shape.get("mark") == "cross":
            draw.line((x - half, y - half, x + half, y + half), colour, round(_px(2.5)))
            draw.line((x - half, y + half, x + half, y - half), colour, round(_px(2.5)))
        else:
            draw.ellipse((x - half, y - half, x + half, y + half), colour)


def _ruler(draw: ImageDraw.ImageDraw, scale: float) -> None:
    raw = 110.0 / scale
    power = 10.0 ** math.floor(math.log10(raw))
    length = next(step * power for step in (5, 2, 1) if step * power <= raw)
    left, bottom = MARGIN, SIZE[1] - MARGIN
    draw.line((_px(left), _px(bottom), _px(left + length * scale), _px(bottom)), MUTED, round(_px(1.5)))
    words = f"{length:g} m" if length >= 1.0 else f"{100.0 * length:.0f} cm"
    draw.text((_px(left), _px(bottom - 20)), words, MUTED, _font(13))


# --- words ------------------------------------------------------------------------------------------


def _words(draw: ImageDraw.ImageDraw, stage: Stage, step: Step, k: int) -> None:
    left, y = SIZE[0] - WORDS + 14, 18.0
    draw.text((_px(left), _px(y)), stage.title, INK, _font(19))
    draw.text((_px(left), _px(y + 26)), f"step {k + 1} of {stage.count}", MUTED, _font(13))
    y += 54
    said = wrap(step.say, 50)
    draw.rectangle((_px(left - 6), _px(y - 6), _px(SIZE[0] - 10), _px(y + 20 * len(said) + 4)), SUNKEN)
    for line in said:
        draw.text((_px(left), _px(y)), line, INK, _font(15))
        y += 20
    y += 14
    for name, value, unit in step.quantities:
        draw.text((_px(left), _px(y)), name, MUTED, _font(13))
        draw.text((_px(SIZE[0] - 14), _px(y)), f"{value} {unit}".strip(), INK, _font(13), anchor="ra")
        y += 18
    _algorithm(draw, stage, step, left, y + 14)


def _algorithm(draw: ImageDraw.ImageDraw, stage: Stage, step: Step, left: float, y: float) -> None:
    """The lines of the algorithm around the current one, as many as there is room for."""
    algorithm = ALGORITHMS[stage.algorithm]
    draw.text((_px(left), _px(y)), algorithm.title, INK, _font(14))
    room = int((SIZE[1] - y - 36) / 17)
    current = next(number for number, line in enumerate(algorithm.lines) if line.number == step.line)
    first = max(0, min(current - room // 2, len(algorithm.lines) - room))
    for number, line in enumerate(algorithm.lines[first : first + max(0, room)], start=first):
        y += 17
        if number == current:
            draw.rectangle((_px(left - 6), _px(y + 5), _px(SIZE[0] - 10), _px(y + 22)), "#e3eff8")
        text = f"{line.number:>2}  {'   ' * line.indent}{line.text}"
        words = text if len(text) <= 62 else f"{text[:61]}…"
        draw.text((_px(left), _px(y + 6)), words, INK if number == current else MUTED, _font(12))


@cache
def _font(size: int) -> Any:
    return ImageFont.load_default(size * FINER)
