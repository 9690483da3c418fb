"""Buildings as line segments, and what a beam in them meets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from segmap.pose import FloatArray, Pose2

__all__ = ["Box", "Shape", "World", "box", "cast", "chair", "disc", "outline"]

Box: TypeAlias = tuple[float, float, float, float]
"""x and y from, x and y to, metres"""
Shape: TypeAlias = FloatArray
"""the corners of something solid, shape (corners, 2), counter-clockwise, metres"""


@dataclass(frozen=True, eq=False)
class World:
    """Everything a laser can see, in one frame.

    ``segments`` has shape (n, 4): x1, y1, x2, y2 in metres, rounded to a millimetre, directed so
    that free space is on the left.
    """

    name: str
    segments: FloatArray

    @classmethod
    def build(cls, name: str, free: Sequence[Box], solid: Sequence[Box] = (), shapes: Iterable[Shape] = ()) -> World:
        """A building: rooms and doors cut out of a solid block, things in them.

        ``free`` boxes are cut out together, ``solid`` ones put back (pillars, cupboards), and
        ``shapes`` stand in the free space.
        """
        parts = [outline(free, solid), *(_faces(shape) for shape in shapes)]
        return cls(name, np.concatenate(parts).round(3) + 0.0)

    def with_shapes(self, shapes: Iterable[Shape]) -> World:
        """The same building with more things in it."""
        parts = [self.segments, *(_faces(shape) for shape in shapes)]
        return World(self.name, np.concatenate(parts).round(3) + 0.0)


def outline(free: Sequence[Box], solid: Sequence[Box] = ()) -> FloatArray:
    """The border between the union of the ``free`` boxes, less the ``solid`` ones, and the rest.

    Returns segments of shape (n, 4), as long as they can be, free space on the left.

    >>> outline([(0, 0, 2, 1)]).tolist()
    [[0.0, 0.0, 2.0, 0.0], [2.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [2.0, 0.0, 2.0, 1.0]]
    """
    boxes = np.array([*free, *solid], dtype=np.float64).round(3)
    xs, ys = (np.unique(boxes[:, axis::2]) for axis in (0, 1))
    inside = np.zeros((len(xs) + 1, len(ys) + 1), bool)  # a rim of solid cells all round
    for number, (x1, y1, x2, y2) in enumerate(boxes):
        i, j = np.searchsorted(xs, (x1, x2)) + 1, np.searchsorted(ys, (y1, y2)) + 1
        inside[i[0] : i[1], j[0] : j[1]] = number < len(free)
    level = _runs(inside, xs, ys)
    upright = _runs(inside.T, ys, xs)[:, [1, 0, 3, 2]][:, [2, 3, 0, 1]]  # mirrored: the left is on the right
    return np.concatenate((level, upright))


def _runs(inside: NDArray[np.bool_], xs: FloatArray, ys: FloatArray) -> FloatArray:
    """The borders along x of the cells that are inside, [x cell, y cell]."""
    below, above = inside[:, :-1], inside[:, 1:]
    rows: list[tuple[float, float, float, float]] = []
    for edge, backwards in ((above & ~below, False), (below & ~above, True)):
        for j, y in enumerate(ys):
            steps = np.flatnonzero(np.diff(edge[:, j].astype(np.int8)))
            for start, end in zip(xs[steps[::2]], xs[steps[1::2]], strict=True):
                rows.append((end, y, start, y) if backwards else (start, y, end, y))
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _faces(shape: Shape) -> FloatArray:
    """The sides of something solid, free space on the left."""
    corners = shape[::-1]
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def box(x: float, y: float, width: float, depth: float, angle: float = 0.0) -> Shape:
    """A cupboard, a desk, a door leaf: a rectangle about (x, y), turned by ``angle`` radians."""
    half = np.array([[-width, -depth], [width, -depth], [width, depth], [-width, depth]]) / 2.0
    return Pose2(x, y, angle) @ half


def disc(x: float, y: float, radius: float, corners: int = 12) -> Shape:
    """A column, a bin, a plant: a round thing with flat sides."""
    around = np.arange(corners) * (2.0 * np.pi / corners)
    return np.stack((x + radius * np.cos(around), y + radius * np.sin(around)), axis=-1)


def chair(x: float, y: float, angle: float = 0.0, size: float = 0.42, leg: float = 0.04) -> list[Shape]:
    """Four legs, as a laser at shin height sees a chair, a table or a lab bench."""
    half = (size - leg) / 2.0
    feet = Pose2(x, y, angle) @ np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    return [box(foot_x, foot_y, leg, leg, angle) for foot_x, foot_y in feet]


def cast(segments: FloatArray, origin: Pose2, angles: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """How far each beam goes, and which segment it meets.

    Args:
        segments: shape (n, 4), in the frame of ``origin``'s numbers.
        origin: the sensor.
        angles: headings of the beams in the sensor's frame, shape (beams,), radians.

    Returns:
        Metres, shape (beams,), infinite where a beam meets nothing; and the index of the segment met, -1 for none.
    """
    if not len(segments):
        return np.full(len(angles), np.inf), np.full(len(angles), -1)
    heading = angles[:, None] + origin.theta
    along_x, along_y = np.cos(heading), np.sin(heading)
    to_x, to_y = segments[:, 0] - origin.x, segments[:, 1] - origin.y
    edge_x, edge_y = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = along_x * edge_y - along_y * edge_x
        distance = (to_x * edge_y - to_y * edge_x) / turn
        share = (to_x * along_y - to_y * along_x) / turn
        met = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    reach = np.where(met, distance, np.inf)
    nearest = reach.argmin(axis=1)
    ranges = reach[np.arange(len(angles)), nearest]
    return ranges, np.where(np.isfinite(ranges), nearest, -1)
