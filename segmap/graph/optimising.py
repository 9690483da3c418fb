"""Edges -> poses, and how each edge fares."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays, gaps, residuals
from segmap.graph.edges import Edge, components
from segmap.graph.least_squares import LeastSquares
from segmap.graph.robust import Round, graduated, settled, truncated
from segmap.graph.start import first_poses
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.scans import ScanId

__all__ = ["BACKENDS", "GATE", "Iteration", "Optimised", "Residual", "optimise"]

BACKENDS = ("auto", "scipy", "gtsam")
GATE = 4.03
"""standard deviations; of right edges with honest covariances one in a thousand is farther off"""
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
class Optimised:
    """The poses that fit the edges best."""

    poses: Mapping[ScanId, Pose2]
    """``T_first_scan`` of every scan an edge holds, in the frame of the first scan of its component"""
    components: tuple[tuple[ScanId, ...], ...]
    """each ascending; its first scan is the frame"""
    residuals: tuple[Residual, ...]
    """in the order of the edges"""
    history: tuple[Iteration, ...] = field(repr=False)
    backend: str
    """``scipy`` or ``gtsam``"""

    @property
    def error(self) -> float:
        """Sum of the squared Mahalanobis distances of the edges that count."""
        return sum(one.weight * one.chi**2 for one in self.residuals)

    @property
    def silenced(self) -> tuple[Residual, ...]:
        """The edges the robust kernel takes for wrong."""
        return tuple(one for one in self.residuals if one.silenced)


def optimise(
    edges: Sequence[Edge],
    initial: Mapping[ScanId, Pose2] | None = None,
    *,
    robust: bool = True,
    gate: float = GATE,
    backend: str = "auto",
    check: Callable[[], None] | None = None,
) -> Optimised:
    """The poses of the scans that edges join, each component on its own.

    ``initial`` poses, in one frame, are where the search begins; without one a scan begins where the most
    reliable edges put it. ``robust`` lets edges that are not trusted be silenced where they are farther off
    than ``gate`` standard deviations; ``check`` is called between steps and raises to stop.

    Raises:
        GraphError: there is no such backend, or it is not installed.
    """
    if backend not in BACKENDS:
        raise GraphError(f"There is no backend {backend!r}. Backends are: {', '.join(BACKENDS)}.")
    solve = _BACKENDS[backend]
    parts = components(edges)
    number = {scan: i for i, part in enumerate(parts) for scan in part}
    members: list[list[int]] = [[] for _ in parts]
    for i, edge in enumerate(edges):
        members[number[edge.first]].append(i)
    solutions = [
        _solved(part, [edges[i] for i in those], initial or {}, gate if robust else None, solve, check)
        for part, those in zip(parts, members, strict=True)
    ]
    fares: dict[int, Residual] = {}
    for those, solution in zip(members, solutions, strict=True):
        fares.update(zip(those, solution.residuals, strict=True))
    return Optimised(
        poses={scan: pose for s in solutions for scan, pose in s.poses.items()},
        components=parts,
        residuals=tuple(fares[i] for i in range(len(edges))),
        history=tuple(Iteration(i, r.error, r.silenced, r.poses) for i, s in enumerate(solutions) for r in s.rounds),
        backend=backend,
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    poses: dict[ScanId, Pose2]
    residuals: list[Residual]
    rounds: list[Round]


_Solve = Callable[
    [EdgeArrays, FloatArray, IntArray, float, Callable[[Round], None], Callable[[], None] | None],
    tuple[FloatArray, FloatArray],
]


def _solved(
    scans: Sequence[ScanId],
    edges: Sequence[Edge],
    initial: Mapping[ScanId, Pose2],
    gate: float | None,
    solve: _Solve,
    check: Callable[[], None] | None,
) -> _Solution:
    """One component."""
    arrays = EdgeArrays.of(edges, {scan: i for i, scan in enumerate(scans)})
    free = np.array([i for i, edge in enumerate(edges) if gate is not None and not edge.trusted], np.int64)
    start = first_poses(scans, edges, np.zeros(len(edges)), initial)
    rounds: list[Round] = []
    poses, weights = solve(arrays, start, free, gate or np.inf, rounds.append, check)
    placed = {scan: Pose2(*row) for scan, row in zip(scans, poses.tolist(), strict=True)}
    return _Solution(placed, _residuals(arrays, edges, poses, weights), rounds)


def _residuals(arrays: EdgeArrays, edges: Sequence[Edge], poses: FloatArray, weights: FloatArray) -> list[Residual]:
    angles = np.abs(residuals(poses, arrays)[:, 2])
    columns = zip(gaps(poses, arrays), angles, np.sqrt(arrays.squares(poses)), weights, strict=True)
    return [Residual(edge, *map(float, row)) for edge, row in zip(edges, columns, strict=True)]


def _with_scipy(
    edges: EdgeArrays,
    poses: FloatArray,
    free: IntArray,
    gate: float,
    tell: Callable[[Round], None],
    check: Callable[[], None] | None,
) -> tuple[FloatArray, FloatArray]:
    """Our own least squares.

    The rounds can end in a place that is worse than the one they began from, where the first poses are good:
    both are settled, and the smaller loss wins.
    """
    solver = LeastSquares(edges, len(poses), check)
    minimise = solver.minimised
    if not len(free):
        weights = np.ones(len(edges))
        poses = minimise(poses, weights)
        tell(Round(float(edges.squares(poses).sum()), 0, poses))
        return poses, weights
    results = [settled(edges, poses, free, gate, tell, minimise)]
    if not results[0][1].all():
        begun = graduated(edges, poses, free, gate, tell, minimise)
        results.append(settled(edges, begun, free, gate, tell, minimise))
    losses = [truncated(edges.squares(placed), gate, free) for placed, _ in results]
    poses, weights = results[int(np.argmin(losses))]
    return minimise(poses, weights), weights


_BACKENDS: Mapping[str, _Solve] = {"auto": _with_scipy, "scipy": _with_scipy}
