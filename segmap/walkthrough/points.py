"""Clustering and splitting: how the points of a scan become segments (Section III-D)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from segmap.fusion import closest_edges
from segmap.parameters import Parameters
from segmap.pose import FloatArray
from segmap.segments import SegmentMap, approximate
from segmap.tracing import Event
from segmap.walkthrough.steps import CHAINS, Mark, Shape, Stage, Step, around, lines, metres, of, path, points

__all__ = ["points_stage"]


@dataclass(frozen=True, eq=False)
class _Bend:
    """A polyline through a cluster on its way to the segments."""

    cluster: int
    corners: FloatArray
    farthest: FloatArray
    """the point farthest from the polyline"""
    edge: FloatArray
    """the piece it is compared with"""
    distance: float


def points_stage(which: int, event: Event, parameters: Parameters, name: str = "") -> Stage:
    """The stage of one scan of a pair, told by what :func:`segmap.segments.extract` reported of it.

    ``name``: what the log calls the scan, if that is known.
    """
    held = _Scan(which, event, parameters, name)
    first_split = next((k for k, bend in enumerate(held.bends) if bend.distance > parameters.split_tolerance), 0)
    marks = (Mark(0, "all points"), Mark(1, "clusters"), Mark(2 + first_split, "the first bend"))
    return Stage(
        id=f"points-{which}",
        title=f"Points to segments, scan {which}",
        about="A laser scan is a row of points. Points that lie close together in a row become a cluster, and a cluster"
        " becomes straight segments: these are all that the method works with from here on.",
        algorithm="points",
        count=len(held.bends) + 3,
        step=held.step,
        marks=(*marks, Mark(len(held.bends) + 2, "the segments")),
        box=around(held.points, np.zeros((1, 2))),
    )


class _Scan:
    def __init__(self, which: int, event: Event, parameters: Parameters, name: str) -> None:
        self.which, self.parameters, self.name = which, parameters, name
        self.points: FloatArray = event["points"]
        self.clusters: list[FloatArray] = event["clusters"]
        self.map: SegmentMap = event["map"]
        self.role = ("first", "second")[which - 1]
        self.bends = [
            bend
            for number, cluster in enumerate(self.clusters)
            if len(cluster) > 1
            for bend in _bends(number, cluster, parameters.split_tolerance)
        ]

    def step(self, k: int) -> Step:
        """Any step."""
        if k == 0:
            return self._raw()
        if k == 1:
            return self._clustered()
        return self._split(self.bends[k - 2]) if k < len(self.bends) + 2 else self._whole()

    def _raw(self) -> Step:
        known = f"Scan {self.name} of the log is called scan {self.which} here, and will become map {self.which}. "
        say = (
            f"{known if self.name else ''}The sensor stands at the cross and turned once; each of the"
            f" {len(self.points)} dots is where a beam met something."
        )
        return Step("1", say, (_sensor(), points(self.points, self.role)), (("points", str(len(self.points)), ""),))

    def _clustered(self) -> Step:
        lone = sum(len(cluster) == 1 for cluster in self.clusters)
        say = (
            f"Each colour is a cluster. Two neighbours farther apart than {self.parameters.cluster_distance:.2f} m"
            " belong to different ones: look at the gaps, doors and corners that hide something."
        )
        shapes = [points(one, f"chain-{k % CHAINS}") for k, one in enumerate(self.clusters)]
        told = (("clusters", str(len(self.clusters)), ""), ("of a single point", str(lone), ""))
        return Step("2", say, (_sensor(), *shapes), (*told, metres("gap", self.parameters.cluster_distance, 2)))

    def _split(self, bend: _Bend) -> Step:
        tolerance, straight = self.parameters.split_tolerance, len(bend.corners) == 2
        on = bend.distance > tolerance
        line = ("3" if straight else "4") if on else "6"
        if on:
            say = (
                f"Cluster {bend.cluster + 1}: the marked point lies {bend.distance:.3f} m off the line, more than"
                f" {tolerance:.3f} m: the line will be bent there."
            )
        else:
            say = (
                f"Cluster {bend.cluster + 1} is done: no point lies farther than {tolerance:.3f} m from its line."
                f" It gives {_count(len(bend.corners) - 1, 'segment')}."
            )
        shapes: list[Shape] = [_sensor(), points(self.points, "faint")]
        shapes += [points(self.clusters[bend.cluster], self.role), path(bend.corners, "new", width=2.5)]
        if on:
            shapes += [lines(bend.edge, "accent"), points(bend.farthest, "accent", size=7)]
        told = (metres("farthest point from the line", bend.distance), metres("split_tolerance", tolerance))
        return Step(line, say, tuple(shapes), (*told, ("pieces", str(len(bend.corners) - 1), "")))

    def _whole(self) -> Step:
        pieces = len(approximate(self.clusters, self.parameters.split_tolerance))
        short = pieces - len(self.map)
        left_out = (
            f" {_count(short, 'piece')} shorter than {self.parameters.min_segment_length:.2f} m"
            f" {'was' if short == 1 else 'were'} left out."
            if short
            else ""
        )
        name = ("first", "second")[self.which - 1]
        say = (
            f"The {_count(len(self.map), 'segment')} of scan {self.which}: it is now a small map, map {self.which}. Its"
            f" segments are numbered from 0.{left_out}"
            " Long ones are walls the sensor saw well; many short ones mean clutter."
        )
        told = (("segments", str(len(self.map)), ""), metres("total length", float(self.map.lengths.sum()), 2))
        longest = metres("longest", float(self.map.lengths.max(initial=0.0)), 2)
        shapes = (_sensor(), points(self.points, "faint"), of(name, self.role, width=3))
        return Step("6", say, shapes, (*told, longest))


def _sensor() -> Shape:
    return {"kind": "points", "at": [[0.0, 0.0]], "role": "text", "size": 9, "mark": "cross"}


def _bends(number: int, cluster: FloatArray, tolerance: float) -> Iterator[_Bend]:
    """The polylines of a cluster from one line to the last, asked of the one that splits by ever smaller tolerances."""
    asked, corners = np.inf, cluster[[0, -1]]
    while True:
        bend = _farthest(number, cluster, corners)
        yield bend
        if bend.distance <= tolerance or asked <= tolerance:
            return
        while asked > tolerance:
            asked = max(tolerance, min(asked, bend.distance) * (1.0 - 1e-6))
            pieces = approximate([cluster], asked)
            if len(pieces) + 1 > len(corners):
                corners = np.concatenate((pieces[:, :2], pieces[-1:, 2:]))
                break


def _farthest(number: int, cluster: FloatArray, corners: FloatArray) -> _Bend:
    """The point of a cluster that is farthest from the piece of the polyline that stands for it."""
    places = _places(cluster, corners)
    best: tuple[float, int, int] = (-1.0, 0, 0)
    for edge, (first, last) in enumerate(pairwise(places)):
        held = cluster[first : last + 1]
        distances, _ = closest_edges(np.concatenate((held, held), axis=1), corners[edge : edge + 2])
        row = int(np.argmax(distances))
        best = max(best, (float(distances[row]), -(first + row), edge))
    distance, row, edge = best
    return _Bend(number, corners, cluster[-row], np.concatenate((corners[edge], corners[edge + 1])), distance)


def _places(cluster: FloatArray, corners: FloatArray) -> list[int]:
    """Where each corner stands in its cluster."""
    places = [0]
    for corner in corners[1:-1]:
        after = cluster[places[-1] + 1 :]
        places.append(places[-1] + 1 + int(np.flatnonzero((after == corner).all(axis=1))[0]))
    return [*places, len(cluster) - 1]


def _count(number: int, one: str) -> str:
    return f"{number} {one}" if number == 1 else f"{number} {one}s"
