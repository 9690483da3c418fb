"""The pose graph, step by step: scans move until all integrations fit, and those that contradict fall silent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from segmap import tracing
from segmap.graph import Covariance, Edge, Optimised, components, optimise
from segmap.graph.arrays import EdgeArrays
from segmap.integration import Verdict, match_maps
from segmap.links import covariance_of
from segmap.matches import Candidate
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.tracing import Event
from segmap.walkthrough.steps import (
    Box,
    Mark,
    Shape,
    Stage,
    Step,
    Walkthrough,
    around,
    metres,
    of,
    path,
    points,
    rounded,
)

__all__ = ["graph_stages", "matched_edges", "walk_graph"]

REACH = 3
"""scans up to so many places apart are matched"""
UNKNOWN: Covariance = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, math.radians(2.0) ** 2))
"""of a pose of paper mode, which does not say how sure it is"""
MOST = 300
"""steps that are shown"""
MILLIMETRE = 0.001
SILENT = 0.5
"""a smaller weight"""


def matched_edges(
    maps: Mapping[ScanId, SegmentMap], parameters: Parameters, heuristic: str | None, mode: str
) -> list[Edge]:
    """Integrations of scans near each other in a sequence, all that were not rejected, as edges of a graph."""
    scans, edges = list(maps), list[Edge]()
    for i, first in enumerate(scans):
        for second in scans[i + 1 : i + 1 + REACH]:
            match = match_maps(maps[first], maps[second], parameters, heuristic, mode)
            if match.best is not None and match.verdict is not Verdict.REJECTED:
                edges.append(Edge(first, second, match.best.T_1_2, _covariance(match.best)))
    return edges


def _covariance(candidate: Candidate) -> Covariance:
    return UNKNOWN if candidate.uncertainty is None else covariance_of(candidate)


def walk_graph(edges: Sequence[Edge], maps: Mapping[ScanId, SegmentMap], title: str = "") -> Walkthrough:
    """A walkthrough of the optimisation of some integrations."""
    base = {f"scan {scan}": rounded(one.coordinates) for scan, one in maps.items()}
    return Walkthrough(title, tuple(graph_stages(edges, maps)), base)


def graph_stages(edges: Sequence[Edge], maps: Mapping[ScanId, SegmentMap]) -> list[Stage]:
    """The optimisation of the largest part that hangs together; none where there are no two edges in it."""
    parts = components(edges)
    largest = max(parts, key=len, default=())
    held = [edge for edge in edges if edge.first in largest]
    if len(held) < 2:
        return []
    with tracing.recording() as trace:
        found = optimise(held)
    rounds = _Rounds(held, largest, _thinned(trace.all("stepped")), found, maps)
    marks = [Mark(0, "the beginning"), Mark(rounds.count - 1, "the end")]
    if rounds.silenced_first is not None:
        marks.insert(1, Mark(rounds.silenced_first, "the first edge falls silent"))
    stage = Stage(
        id="graph",
        title="The pose graph, step by step",
        about="Each integration says where one scan lies from another. Round a loop these do not quite add up: the"
        " graph moves all scans a little until everything fits best, and silences an integration that the others"
        " contradict.",
        algorithm="graph",
        count=rounds.count,
        step=rounds.step,
        marks=tuple(marks),
        box=rounds.box,
        chart=rounds.chart(),
    )
    return [stage]


def _thinned(events: list[Event]) -> list[Event]:
    """All of few steps; of many, some, the last included."""
    stride = -(-len(events) // MOST) if events else 1
    return events[::-1][::stride][::-1]


class _Rounds:
    def __init__(
        self,
        edges: Sequence[Edge],
        scans: Sequence[ScanId],
        events: list[Event],
        found: Optimised,
        maps: Mapping[ScanId, SegmentMap],
    ) -> None:
        self.edges, self.scans, self.events, self.maps = edges, scans, events, maps
        self._gate = found.gate
        self._final = np.array([tuple(found.poses[scan]) for scan in scans])
        self._weights = np.array([residual.weight for residual in found.residuals])
        self._number = {scan: number for number, scan in enumerate(scans)}
        self._arrays = EdgeArrays.of(edges, self._number)
        self.count = len(events) + 2
        silent = [k + 1 for k, event in enumerate(events) if (event["weights"] < SILENT).any()]
        self.silenced_first = silent[0] if silent else None
        self.box: Box | None = around(self._final[:, :2], *(self._moved(scan) for scan in scans if scan in maps))

    def _moved(self, scan: ScanId) -> FloatArray:
        return self.maps[scan].moved(Pose2(*self._final[self._number[scan]])).coordinates

    def _state(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Poses and weights before the first step, after each, and those the graph ends with."""
        if k == 0 and self.events:
            return self.events[0]["before"], self.events[0]["weights"]
        if k - 1 < len(self.events):
            return self.events[k - 1]["poses"], self.events[k - 1]["weights"]
        return self._final, self._weights

    def _error(self, k: int) -> float:
        return float(np.minimum(self._arrays.squares(self._state(k)[0]), self._gate**2).sum())

    def chart(self) -> dict[str, object]:
        """What is left over, round by round."""
        values = [[k, round(self._error(k), 3)] for k in range(self.count)]
        return {"kind": "series", "title": "What is left over", "x": "step", "y": "sd²", "values": values}

    def step(self, k: int) -> Step:
        """One round, or the end."""
        poses, weights = self._state(k)
        before = self._state(k - 1)[0] if k else poses
        moved = float(np.hypot(*(poses - before)[:, :2].T).max())
        silent = int((weights < SILENT).sum())
        end = k == self.count - 1
        say = (
            f"The end: every scan is where the integrations that count want it. {_silenced(silent)}"
            if end
            else self._beginning()
            if k == 0
            else f"Step {k}: {_moved(moved)} {_silenced(silent)}"
        )
        told = (metres("moved by at most", moved), ("silenced", str(silent), f"of {len(self.edges)}"))
        left = ("left over, squared standard deviations", f"{self._error(k):.2f}", "")
        line = "5" if end else "2" if k == 0 else "4" if silent else "3"
        at = (float(k), round(self._error(k), 3))
        return Step(line, say, tuple(self._shapes(poses, weights)), (*told, left), at=at)

    def _beginning(self) -> str:
        beyond = any(abs(edge.second.scan - edge.first.scan) > 1 for edge in self.edges)
        alone = sum(scan not in self._number for scan in self.maps)
        return (
            f"The beginning: {len(self.edges)} integrations hold {len(self.scans)} scans together"
            f"{', those of scans that are no neighbours included' if beyond else ''}. A dot is where a sensor stood, a"
            " stroke an integration: green ones count, dashed red ones are silenced. The scans stand where the surest"
            " integrations put them, one after the other."
            f"{f' Left out, as nothing ties them to these: {alone} more.' if alone else ''}"
        )

    def _shapes(self, poses: FloatArray, weights: FloatArray) -> list[Shape]:
        shapes = [
            of(f"scan {scan}", "faint", pose=Pose2(*poses[self._number[scan]]), width=1.5)
            for scan in self.scans
            if scan in self.maps
        ]
        for edge, weight in zip(self.edges, weights, strict=True):
            ends = poses[[self._number[edge.first], self._number[edge.second]], :2]
            counts = weight >= SILENT
            shapes.append(path(ends, "good" if counts else "bad", width=1.0 + 2.0 * float(weight), dash=not counts))
        return [*shapes, points(poses[:, :2], "first", size=8)]


def _moved(length: float) -> str:
    if length < MILLIMETRE / 2.0:
        return "no scan moves by as much as a millimetre any more."
    return f"the scans moved by up to {length:.3f} m."


def _silenced(count: int) -> str:
    if not count:
        return "No integration is silenced."
    if count == 1:
        return "1 integration is silenced, as the others contradict it."
    return f"{count} integrations are silenced, as the others contradict them."
