"""Edges -> poses, and how each edge fares."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays, gaps, residuals
from segmap.graph.deciding import decided
from segmap.graph.edges import Edge, components
from segmap.graph.least_squares import LeastSquares
from segmap.graph.optimised import Iteration, Optimised, Residual
from segmap.graph.reattaching import reattached
from segmap.graph.robust import Problem, Round, graduated
from segmap.graph.start import along_logs, composed_along, first_poses, steps_between, tree
from segmap.graph.with_gtsam import Gtsam
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["BACKENDS", "GATE", "optimise"]

BACKENDS = ("auto", "scipy", "gtsam")
"""``auto`` is scipy: the same result whatever is installed, and the quicker of the two by far"""
VOTES = 5
"""joints between parts of a log, those of scans farthest apart in it, that all edges across them vote on"""
GATE = 5.0
"""standard deviations; of right edges with honest covariances one in 65,000 is farther off"""


def optimise(
    edges: Sequence[Edge],
    initial: Mapping[ScanId, Pose2] | None = None,
    *,
    robust: bool = True,
    gate: float = GATE,
    most: float = math.inf,
    backend: str = "auto",
    check: Callable[[], None] | None = None,
) -> Optimised:
    """The poses of the scans that edges join, each component on its own.

    ``initial`` poses, in one frame, are where the search begins, and help it only: a better place found from
    where the most reliable edges put the scans is preferred. ``robust`` lets edges that are not trusted be
    silenced where they are farther off than ``gate`` standard deviations, or than ``most`` metres, however
    little they claim to know; ``check`` is called between steps and raises to stop.

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
        _solved(part, [edges[i] for i in those], initial or {}, gate if robust else None, most, solve, check)
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
        most=most if robust else math.inf,
    )


@dataclass(frozen=True, eq=False)
class _Solution:
    poses: dict[ScanId, Pose2]
    residuals: list[Residual]
    rounds: list[Round]


_Solve: TypeAlias = Callable[[Problem, Callable[[], None] | None], tuple[FloatArray, FloatArray]]


def _solved(
    scans: Sequence[ScanId],
    edges: Sequence[Edge],
    initial: Mapping[ScanId, Pose2],
    gate: float | None,
    most: float,
    solve: _Solve,
    check: Callable[[], None] | None,
) -> _Solution:
    """One component."""
    arrays = EdgeArrays.of(edges, {scan: i for i, scan in enumerate(scans)})
    rounds: list[Round] = []
    starts = [first_poses(scans, edges, initial)] if any(scan in initial for scan in scans) else []
    problem = Problem(
        edges=arrays,
        starts=(*starts, first_poses(scans, edges), _voted(scans, edges, arrays, gate or np.inf)),
        given=bool(starts),
        reliance=np.array([1.0 / (1.0 + steps_between(edge)) for edge in edges]),
        free=np.array([i for i, edge in enumerate(edges) if gate is not None and not edge.trusted], np.int64),
        gate=gate or np.inf,
        most=most,
        tell=rounds.append,
    )
    poses, weights = solve(problem, check)
    placed = {scan: Pose2(*row) for scan, row in zip(scans, poses.tolist(), strict=True)}
    return _Solution(placed, _residuals(arrays, edges, poses, weights), rounds)


def _voted(scans: Sequence[ScanId], edges: Sequence[Edge], arrays: EdgeArrays, gate: float) -> FloatArray:
    """Poses (n, 3) along the logs; where only edges between scans far apart lead on, most of these decide."""
    along = tree(scans, edges, {}, along_logs)
    poses, kept = composed_along(scans, along), along[: max(0, len(along) - VOTES)]
    weights = np.zeros(len(edges))
    place = {id(edge): i for i, edge in enumerate(edges)}
    weights[[place[id(edge)] for edge in kept]] = 1.0
    return reattached(arrays, poses, weights, gate)


def _residuals(arrays: EdgeArrays, edges: Sequence[Edge], poses: FloatArray, weights: FloatArray) -> list[Residual]:
    angles = np.abs(residuals(poses, arrays)[:, 2])
    columns = zip(gaps(poses, arrays), angles, np.sqrt(arrays.squares(poses)), weights, strict=True)
    return [Residual(edge, *map(float, row)) for edge, row in zip(edges, columns, strict=True)]


def _with_scipy(problem: Problem, check: Callable[[], None] | None) -> tuple[FloatArray, FloatArray]:
    minimise = LeastSquares(problem.edges, len(problem.starts[0]), check).minimised
    return decided(problem, minimise, lambda poses: graduated(problem, poses, minimise))


def _with_gtsam(problem: Problem, check: Callable[[], None] | None) -> tuple[FloatArray, FloatArray]:
    solver = Gtsam(problem.edges, check)
    return decided(problem, solver.minimised, lambda poses: solver.graduated(poses, problem.free, problem.gate))


_BACKENDS: Mapping[str, _Solve] = {"auto": _with_scipy, "scipy": _with_scipy, "gtsam": _with_gtsam}
