"""What the optimiser found: poses, how each edge fares, how sure it all is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays
from segmap.graph.edges import Edge
from segmap.graph.marginals import Marginals
from segmap.graph.robust import Round
from segmap.graph.ways import Ways
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["HALF", "Iteration", "Optimised", "Part", "Residual"]

HALF = 0.5
"""an edge with a smaller weight is silenced"""


@dataclass(frozen=True)
class Residual:
    """What is left between where an edge puts its second scan and where the graph puts it."""

    edge: Edge
    translation: float
    """metres"""
    rotation: float
    """radians, in [0, pi]"""
    chi: float
    """Mahalanobis distance: the length of the residual in standard deviations; sqrt(3) on average"""
    weight: float
    """0..1; how much the edge counts"""

    @property
    def silenced(self) -> bool:
        """Whether the robust kernel takes the edge for wrong."""
        return self.weight < HALF


@dataclass(frozen=True, eq=False)
class Iteration:
    """One round of the optimiser on one component."""

    component: int
    """number of the component, from 0"""
    error: float
    """sum of squared Mahalanobis distances, those of silenced edges cut at the gate"""
    silenced: int
    """edges that do not count now"""
    poses: FloatArray = field(repr=False)
    """(n, 3) of the component's scans, in the frame of the first"""


@dataclass(frozen=True, eq=False)
class Part:
    """A component by itself. It depends on its own edges alone, so that later results hold the same object."""

    scans: tuple[ScanId, ...]
    """ascending; the first is the frame"""
    edges: tuple[Edge, ...]
    poses: Mapping[ScanId, Pose2]
    residuals: tuple[Residual, ...]
    """in the order of the edges"""
    rounds: tuple[Round, ...] = field(repr=False)
    given: bool
    """whether poses were given where the search began"""
    agreed: bool
    """whether edges that could be silenced all agreed at once: nothing else was looked for"""

    @cached_property
    def counting(self) -> tuple[Edge, ...]:
        """The edges that are not silenced."""
        return tuple(one.edge for one in self.residuals if not one.silenced)

    @cached_property
    def ways(self) -> Ways:
        """The net of the edges that count."""
        return Ways(self.counting)

    @cached_property
    def marginals(self) -> Marginals:
        """Covariances within the component."""
        arrays = EdgeArrays.of(self.counting, {scan: i for i, scan in enumerate(self.scans)})
        return Marginals(arrays, np.array([tuple(self.poses[scan]) for scan in self.scans]))


@dataclass(frozen=True, eq=False)
class Optimised:
    """The poses that fit the edges best."""

    parts: tuple[Part, ...]
    """the components, by their first scans"""
    residuals: tuple[Residual, ...]
    """in the order of the edges"""
    gate: float
    """standard deviations beyond which an edge that is not trusted was silenced; infinite where none could be"""
    backend: str
    """``scipy`` or ``gtsam``"""
    most: float = math.inf
    """metres beyond which such an edge was silenced, however little it claims to know"""

    @cached_property
    def poses(self) -> Mapping[ScanId, Pose2]:
        """``T_first_scan`` of every scan an edge holds, in the frame of the first scan of its component."""
        return {scan: pose for part in self.parts for scan, pose in part.poses.items()}

    @property
    def components(self) -> tuple[tuple[ScanId, ...], ...]:
        """Each ascending; its first scan is the frame."""
        return tuple(part.scans for part in self.parts)

    @property
    def history(self) -> tuple[Iteration, ...]:
        """What the optimiser did, one component after the other."""
        rounds = ((number, one) for number, part in enumerate(self.parts) for one in part.rounds)
        return tuple(Iteration(number, one.error, one.silenced, one.poses) for number, one in rounds)

    @property
    def error(self) -> float:
        """Sum of the squared Mahalanobis distances of the edges that count."""
        return sum(one.weight * one.chi**2 for one in self.residuals)

    @property
    def variance_factor(self) -> float | None:
        """How many times larger the variances of the edges are than these say, by their residuals.

        1 where covariances tell the truth, less where they are too careful. None where nothing is left over to
        tell by: as many edges as it takes to hold the scans.
        """
        kept = sum(not one.silenced for one in self.residuals)
        spare = 3 * (kept - len(self.poses) + len(self.components))
        return self.error / spare if spare > 0 else None

    @property
    def silenced(self) -> tuple[Residual, ...]:
        """The edges the robust kernel takes for wrong."""
        return tuple(one for one in self.residuals if one.silenced)

    def component_of(self, scan: ScanId) -> int | None:
        """The number of the component that holds a scan; None where no edge does."""
        return self._numbers.get(scan)

    def part_of(self, scan: ScanId) -> Part | None:
        """The component that holds a scan; None where no edge does."""
        number = self._numbers.get(scan)
        return None if number is None else self.parts[number]

    def counting(self, component: int) -> tuple[Edge, ...]:
        """The edges of a component, by its number, that are not silenced."""
        return self.parts[component].counting

    def ways(self) -> Ways:
        """The net of the edges that count."""
        return Ways(edge for part in self.parts for edge in part.counting)

    def covariance(self, scan: ScanId, of: ScanId | None = None) -> FloatArray:
        """Covariance (3, 3) of x, y (metres) and theta (radians) of a scan's pose in the frame of scan ``of``.

        By default that of the first scan of its component. Edges that are silenced do not count.

        Raises:
            GraphError: no edge holds one of the scans, or they are in different components.
        """
        number = self._number(scan)
        part = self.components[number]
        of = part[0] if of is None else of
        if self._number(of) != number:
            raise GraphError(f"Scans {of} and {scan} are in different components: nothing relates their poses.")
        return self.marginals(number).between(part.index(of), part.index(scan))

    def marginals(self, component: int) -> Marginals:
        """Covariances within a component, by its number; made when first asked for."""
        return self.parts[component].marginals

    @cached_property
    def _numbers(self) -> Mapping[ScanId, int]:
        return {scan: number for number, part in enumerate(self.parts) for scan in part.scans}

    def _number(self, scan: ScanId) -> int:
        number = self.component_of(scan)
        if number is None:
            raise GraphError(f"No edge holds scan {scan}: its place is not known.")
        return number
