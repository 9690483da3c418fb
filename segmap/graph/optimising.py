"""Edges -> poses, and how each edge fares."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays, gaps, residuals
from segmap.graph.deciding import decided
from segmap.graph.edges import Edge, components
from segmap.graph.least_squares import LeastSquares
from segmap.graph.optimised import Optimised, Part, Residual
from segmap.graph.reattaching import reattached
from segmap.graph.robust import Problem, Round, Start, graduated
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
    known: Optimised | None = None,
    check: Callable[[], None] | None = None,
) -> Optimised:
    """The poses of the scans that edges join, each component on its own.

    ``initial`` poses, in one frame, are where the search begins, and help it only: a better place found from
    where the most reliable edges put the scans is preferred. ``robust`` lets edges that are not trusted be
    silenced where they are farther off than ``gate`` standard deviations, or than ``most`` metres, however
    little they claim to know. Components of the same edges as in ``known``, an earlier result of the same
    settings, are taken from there: they would come out the same. ``check`` is called between steps and raises
    to stop.

    Raises:
        GraphError: there is no such backend, or it is not installed.
    """
    if backend not in BACKENDS:
        raise GraphError(f"There is no backend {backend!r}. Backends are: {', '.join(BACKENDS)}.")
    solve = _BACKENDS[backend]
    found = components(edges)
    number = {scan: i for i, scans in enumerate(found) for scan in scans}
    members: list[list[int]] = [[] for _ in found]
    for i, edge in enumerate(edges):
        members[number[edge.first]].append(i)
    settings = gate if robust else math.inf, most if robust else math.inf, "scipy" if backend == "auto" else backend
    held = _reusable(known, settings)
    solved: list[Part] = []
    for scans, those in zip(found, members, strict=True):
        own, part = tuple(edges[i] for i in those), held.get(scans[0])
        if part is None or part.edges != own:
            part = _solved(scans, own, initial or {}, gate if robust else None, most, solve, check)
        solved.append(part)
    fares: dict[int, Residual] = {}
    for those, part in zip(members, solved, strict=True):
        fares.update(zip(those, part.residuals, strict=True))
    return Optimised(tuple(solved), tuple(fares[i] for i in range(len(edges))), settings[0], settings[2], settings[1])


def _reusable(known: Optimised | None, settings: tuple[float, float, str]) -> Mapping[ScanId, Part]:
    """Components that come out the same again, by their first scans; where poses were given, that depends on them."""
    if known is None or (known.gate, known.most, known.backend) != settings:
        return {}
    return {part.scans[0]: part for part in known.parts if not part.given}


_Solve: TypeAlias = Callable[[Problem, Callable[[], None] | None], tuple[FloatArray, FloatArray]]


def _solved(
    scans: tuple[ScanId, ...],
    edges: tuple[Edge, ...],
    initial: Mapping[ScanId, Pose2],
    gate: float | None,
    most: float,
    solve: _Solve,
    check: Callable[[], None] | None,
) -> Part:
    """One component."""
    arrays = EdgeArrays.of(edges, {scan: i for i, scan in enumerate(scans)})
    rounds: list[Round] = []
    starts: list[Start] = [
        lambda: first_poses(scans, edges),
        lambda: _voted(scans, edges, arrays, gate or np.inf),
    ]
    given = any(scan in initial for scan in scans)
    if given:
        starts.insert(0, lambda: first_poses(scans, edges, initial))
    problem = Problem(
        edges=arrays,
        count=len(scans),
        starts=starts,
        given=given,
        reliance=np.array([1.0 / (1.0 + steps_between(edge)) for edge in edges]),
        free=np.array([i for i, edge in enumerate(edges) if gate is not None and not edge.trusted], np.int64),
        gate=gate or np.inf,
        most=most,
        tell=rounds.append,
    )
    poses, weights = solve(problem, check)
    placed = {scan: Pose2(*row) for scan, row in zip(scans, poses.tolist(), strict=True)}
    left = tuple(_residuals(arrays, edges, poses, weights))
    return Part(scans, edges, placed, left, tuple(rounds), given, bool(len(problem.free)) and len(rounds) == 1)


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
    minimise = LeastSquares(problem.edges, problem.count, check).minimised
    return decided(problem, minimise, lambda poses: graduated(problem, poses, minimise))


def _with_gtsam(problem: Problem, check: Callable[[], None] | None) -> tuple[FloatArray, FloatArray]:
    solver = Gtsam(problem.edges, check)
    return decided(problem, solver.minimised, lambda poses: solver.graduated(poses, problem.free, problem.gate))


_BACKENDS: Mapping[str, _Solve] = {"auto": _with_scipy, "scipy": _with_scipy, "gtsam": _with_gtsam}
