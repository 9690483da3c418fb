"""Edges of a pose graph, what hangs together by them, and their shortest ways."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from segmap.errors import GraphError
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["SOURCES", "Covariance", "Edge", "Parts", "as_covariance", "components", "joined"]

Covariance: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
"""of x, y (metres) and theta (radians), rows and columns in this order"""
SOURCES = ("matched", "imported", "manual")
"""where an edge can come from: two scans matched here, a pose graph of another program, a person's hand"""
ASYMMETRY = 1e-6
"""relative; a covariance less symmetric than this is a mistake"""


@dataclass(frozen=True)
class Edge:
    """An accepted integration: scan ``second`` was found at ``T_1_2`` in the frame of scan ``first``.

    Raises:
        GraphError: it joins a scan with itself, a number is not finite, or the covariance is none.
    """

    first: ScanId
    second: ScanId
    T_1_2: Pose2
    covariance: Covariance
    """of the numbers x, y (metres, axes of frame 1) and theta (radians) of ``T_1_2``, as
    :func:`segmap.refinement.uncertainty` gives it; theta turns frame 2 about its own origin. An array of
    shape (3, 3) is taken too."""
    trusted: bool = False
    """never silenced: the robust kernel passes it over"""
    source: str = "matched"
    """``matched``, ``imported`` or ``manual``"""

    def __post_init__(self) -> None:
        if self.first == self.second:
            raise GraphError(f"An edge joins scan {self.first} with itself: it needs two different scans.")
        if not math.isfinite(self.T_1_2.x + self.T_1_2.y + self.T_1_2.theta):
            raise GraphError(f"The pose of edge {self.name} is not finite.")
        if self.source not in SOURCES:
            raise GraphError(f"Edge {self.name} comes from {self.source!r}; sources are {', '.join(SOURCES)}.")
        object.__setattr__(self, "covariance", _checked(self.covariance, self.name))

    @property
    def name(self) -> str:
        """Its two scans: ``0.12-0.13``."""
        return f"{self.first}-{self.second}"

    def reversed(self) -> Edge:
        """The same evidence, told from the other scan's frame; it weighs exactly the same in a graph."""
        T_2_1 = self.T_1_2.inverse()
        turn = _turned(T_2_1.theta)
        turn[:2, 2] = -T_2_1.y, T_2_1.x  # an error of theta moves the other origin sideways
        covariance = turn @ np.array(self.covariance) @ turn.T
        return replace(self, first=self.second, second=self.first, T_1_2=T_2_1, covariance=as_covariance(covariance))


def _turned(theta: float) -> FloatArray:
    cosine, sine = math.cos(theta), math.sin(theta)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def as_covariance(matrix: FloatArray) -> Covariance:
    """A matrix (3, 3) as an edge keeps it."""
    a, b, c = ((float(row[0]), float(row[1]), float(row[2])) for row in matrix)
    return a, b, c


def _checked(covariance: ArrayLike, name: str) -> Covariance:
    matrix = np.asarray(covariance, np.float64)
    if matrix.shape != (3, 3):
        raise GraphError(f"The covariance of edge {name} has shape {matrix.shape} instead of (3, 3).")
    a, b, c = as_covariance(matrix)
    if not math.isfinite(sum((*a, *b, *c))):
        raise GraphError(f"The covariance of edge {name} is not finite.")
    if max(abs(a[1] - b[0]), abs(a[2] - c[0]), abs(b[2] - c[1])) > ASYMMETRY * max(a[0], b[1], c[2]):
        raise GraphError(f"The covariance of edge {name} is not symmetric.")
    minor = a[0] * b[1] - a[1] * b[0]
    whole = c[2] * minor - c[1] * (a[0] * b[2] - a[2] * b[0]) + c[0] * (a[1] * b[2] - a[2] * b[1])
    if not (a[0] > 0.0 and minor > 0.0 and whole > 0.0):
        raise GraphError(f"The covariance of edge {name} is not positive definite: every direction needs a variance.")
    return a, b, c


class Parts:
    """Which things hang together, by union-find; the lowest number of a part names it."""

    def __init__(self, count: int) -> None:
        self._parents = list(range(count))

    def of(self, item: int) -> int:
        """The name of an item's part."""
        parents = self._parents
        while parents[item] != item:
            parents[item] = parents[parents[item]]
            item = parents[item]
        return item

    def join(self, a: int, b: int) -> bool:
        """Make one part of two; False where they were one."""
        a, b = self.of(a), self.of(b)
        if a == b:
            return False
        self._parents[max(a, b)] = min(a, b)
        return True


def components(edges: Sequence[Edge], scans: Iterable[ScanId] = ()) -> tuple[tuple[ScanId, ...], ...]:
    """The scans that edges hold together, each component ascending, by their first scans.

    ``scans`` that no edge holds are components of their own.
    """
    ordered = sorted({*scans, *(scan for edge in edges for scan in (edge.first, edge.second))})
    places = {scan: place for place, scan in enumerate(ordered)}
    parts = joined(edges, places)
    found: dict[int, list[ScanId]] = {}
    for place, scan in enumerate(ordered):
        found.setdefault(parts.of(place), []).append(scan)
    return tuple(tuple(part) for part in found.values())


def joined(edges: Iterable[Edge], places: Mapping[ScanId, int]) -> Parts:
    """The parts that edges make of scans numbered by ``places``."""
    parts = Parts(len(places))
    for edge in edges:
        parts.join(places[edge.first], places[edge.second])
    return parts
