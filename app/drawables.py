"""What a picture is made of: lines, points and labels in a frame, as plain arrays (no viser)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.palette import RGB
from segmap.pose import FloatArray, IntArray

__all__ = [
    "Array32",
    "Box",
    "Drawable",
    "Frame",
    "Pick",
    "around",
    "box",
    "dashes",
    "label",
    "lift",
    "lines",
    "points",
    "star",
]

Frame: TypeAlias = Literal["first", "second", "map"]
"""``first``: map 1, where the scene's origin is; ``second``: moves with the candidate; ``map``: the merged map"""
Array32: TypeAlias = NDArray[np.float32]
Box: TypeAlias = tuple[float, float, float, float]
"""x and y from, x and y to, metres"""
DASH = 0.15
"""metres, of a dash and of a gap"""


CHAIN = "chain"
"""the source of a Pick that names a matching chain, by its place in order of value"""


@dataclass(frozen=True)
class Pick:
    """One segment that can be clicked."""

    source: str
    """``first``, ``second``, the name of a component of the merged map, or ``CHAIN``"""
    segment: int


@dataclass(frozen=True, eq=False)
class Drawable:
    """Items of one layer and one look.

    Raises:
        ValueError: the arrays do not have the shapes told below, or are not finite.
    """

    name: str
    """unique in its frame, words joined by slashes"""
    layer: str
    kind: Literal["lines", "points", "label"]
    points: Array32
    """metres; lines: shape (n, 2, 3), points: (n, 3), label: (3,)"""
    colour: RGB
    frame: Frame = "first"
    depth: int = 0
    """higher lies over lower"""
    thickness: float = 2.0
    """pixels on the screen"""
    colours: NDArray[np.uint8] | None = None
    """one colour for each point or line, shape (n, 3)"""
    text: str = ""
    anchor: Literal["bottom-center", "top-center", "center-left"] = "center-left"
    """where a label has its place"""
    source: str = ""
    """where a click on a line leads: the source of a Pick; empty: nowhere"""
    segments: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    """the segment each line stands for, where a click leads somewhere"""

    def __post_init__(self) -> None:
        tail = {"lines": (2, 3), "points": (3,), "label": ()}[self.kind]
        shape = (3,) if self.kind == "label" else (len(self.points), *tail)
        if self.points.shape != shape or not np.isfinite(self.points).all():
            raise ValueError(f"{self.name}: {self.kind} cannot be drawn from an array of shape {self.points.shape}.")
        if self.colours is not None and self.colours.shape != (len(self.points), 3):
            raise ValueError(f"{self.name}: {len(self.colours)} colours for {len(self.points)} {self.kind}.")
        if self.source and len(self.segments) != len(self.points):
            raise ValueError(f"{self.name}: {len(self.segments)} segments for {len(self.points)} lines.")

    @property
    def path(self) -> str:
        """Its name in the scene: ``/frame/name``."""
        return f"/{self.frame}/{self.name}"

    def __len__(self) -> int:
        return 1 if self.kind == "label" else len(self.points)


def lift(flat: ArrayLike, height: float | FloatArray = 0.0) -> Array32:
    """Points of the plane, shape (..., 2), as points of space, shape (..., 3)."""
    array = np.asarray(flat, dtype=np.float64)
    heights = np.broadcast_to(np.asarray(height, dtype=np.float64), array.shape[:-1])
    return np.concatenate((array, heights[..., None]), axis=-1).astype(np.float32)


def lines(coordinates: ArrayLike) -> Array32:
    """Segments, shape (n, 4): x1, y1, x2, y2, as lines of shape (n, 2, 3)."""
    return lift(np.asarray(coordinates, dtype=np.float64).reshape(-1, 2, 2))


def points(flat: ArrayLike) -> Array32:
    """Points of the plane, shape (n, 2), as points of shape (n, 3)."""
    return lift(np.asarray(flat, dtype=np.float64).reshape(-1, 2))


def label(
    name: str,
    layer: str,
    text: str,
    at: Iterable[float],
    colour: RGB,
    frame: Frame = "first",
    depth: int = 0,
    anchor: Literal["bottom-center", "top-center", "center-left"] = "center-left",
) -> Drawable:
    """A word at a place (x, y) or (x, y, z)."""
    place = np.zeros(3, np.float32)
    coordinates = list(at)
    place[: len(coordinates)] = coordinates
    return Drawable(name, layer, "label", place, colour, frame, depth, text=text, anchor=anchor)


def dashes(start: FloatArray, end: FloatArray) -> FloatArray:
    """The dashed line between two points (2,), as segments of shape (n, 4); none where they are the same."""
    length = float(np.hypot(*(end - start)))
    if length == 0.0:
        return np.empty((0, 4))
    step = max(DASH, length / 200.0)
    starts = np.arange(0.0, length, 2.0 * step)
    ends = np.minimum(starts + step, length)
    along = (end - start) / length
    return np.concatenate((start + starts[:, None] * along, start + ends[:, None] * along), axis=1)


def star(centre: FloatArray, radius: float) -> FloatArray:
    """A mark around a point (2,): a small diamond, as segments of shape (4, 4)."""
    corners = np.asarray(centre) + radius * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def box(*parts: FloatArray) -> Box | None:
    """The box around all points (..., 2) of some arrays; None where there are none."""
    held = [np.asarray(part, dtype=np.float64).reshape(-1, 2) for part in parts if np.size(part)]
    if not held:
        return None
    together = np.concatenate(held)
    (x1, y1), (x2, y2) = together.min(axis=0), together.max(axis=0)
    return float(x1), float(y1), float(x2), float(y2)


def around(boxes: Iterable[Box | None]) -> Box | None:
    """The box around some boxes; None where there are none."""
    held = [one for one in boxes if one is not None]
    if not held:
        return None
    left, bottom, right, top = zip(*held, strict=True)
    return min(left), min(bottom), max(right), max(top)
