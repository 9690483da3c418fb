"""Edges -> poses, and how each edge fares."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays, gaps, residuals
from segmap.graph.edges import Edge, components
from segmap.graph.least_squares import STEPS, LeastSquares
from segmap.graph.optimised import HALF, Iteration, Optimised, Residual
from segmap.graph.robust import Minimise, Round, graduated, reconsidered, settled, truncated
from segmap.graph.start import first_poses
from segmap.graph.with_gtsam import Gtsam
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.scans import ScanId

__all__ = ["BACKENDS", "GATE", "optimise"]

BACKENDS = ("auto", "scipy", "gtsam")
"""``auto`` is scipy: the same result whatever is installed, and the quicker of the two by far"""
GATE = 5.0
"""standard deviations; of right edges with honest covariances one in 65,000 is farther off"""
MANY = 0.05
"""of the edges that can be silenced; where more are, the other road is tried too"""


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
        gate=gate if robust else math.inf,
        backend="scipy" if backend == "auto" else backend,
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    poses: dict[ScanId, Pose2]
    residuals: list[Residual]
    rounds: list[Round]


_Tell = Callable[[Round], None]
_Check = Callable[[], None] | None
_Solve = Callable[[EdgeArrays, FloatArray, IntArray, float, bool, _Tell, _Check], tuple[FloatArray, FloatArray]]


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
    poses, weights = solve(arrays, start, free, gate or np.inf, bool(initial), rounds.append, check)
    placed = {scan: Pose2(*row) for scan, row in zip(scans, poses.tolist(), strict=True)}
    return _Solution(placed, _residuals(arrays, edges, poses, weights), rounds)


def _residuals(arrays: EdgeArrays, edges: Sequence[Edge], poses: FloatArray, weights: FloatArray) -> list[Residual]:
    angles = np.abs(residuals(poses, arrays)[:, 2])
    columns = zip(gaps(poses, arrays), angles, np.sqrt(arrays.squares(poses)), weights, strict=True)
    return [Residual(edge, *map(float, row)) for edge, row in zip(edges, columns, strict=True)]


def _with_scipy(
    edges: EdgeArrays, poses: FloatArray, free: IntArray, gate: float, known: bool, tell: _Tell, check: _Check
) -> tuple[FloatArray, FloatArray]:
    minimise = LeastSquares(edges, len(poses), check).minimised

    def begin(poses: FloatArray) -> FloatArray:
        return graduated(edges, poses, free, gate, tell, minimise)

    return _decided(edges, poses, free, gate, known, tell, minimise, begin)


def _with_gtsam(
    edges: EdgeArrays, poses: FloatArray, free: IntArray, gate: float, known: bool, tell: _Tell, check: _Check
) -> tuple[FloatArray, FloatArray]:
    solver = Gtsam(edges, check)

    def begin(poses: FloatArray) -> FloatArray:
        return solver.graduated(poses, free, gate)

    return _decided(edges, poses, free, gate, known, tell, solver.minimised, begin)


def _decided(
    edges: EdgeArrays,
    poses: FloatArray,
    free: IntArray,
    gate: float,
    known: bool,
    tell: _Tell,
    minimise: Minimise,
    begin: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Poses and weights.

    Graduated non-convexity can end in a place that is worse than the one it began from, where the first poses
    are ``known`` to be good or much is wrong: then both are settled, and the smaller loss wins.
    """
    if not len(free):
        poses = minimise(poses, np.ones(len(edges)), STEPS)
        tell(Round(float(edges.squares(poses).sum()), 0, poses))
        return poses, np.ones(len(edges))
    results = [settled(edges, begin(poses), free, gate, tell, minimise)]
    if known or (results[0][1] < HALF).sum() > MANY * len(free):
        results.append(settled(edges, poses, free, gate, tell, minimise))
    losses = [truncated(edges.squares(placed), gate, free) for placed, _ in results]
    poses, weights = reconsidered(edges, *results[int(np.argmin(losses))], free, gate, tell, minimise)
    return minimise(poses, weights, STEPS), weights


_BACKENDS: Mapping[str, _Solve] = {"auto": _with_scipy, "scipy": _with_scipy, "gtsam": _with_gtsam}
