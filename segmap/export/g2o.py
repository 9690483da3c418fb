"""Pose graphs as g2o, what g2o, gtsam and others read, and the time stamps it has no place for beside it.

::

    VERTEX_SE2 id x y theta
    EDGE_SE2 id id x y theta I11 I12 I13 I22 I23 I33           the information in the frame of the second scan
    FIX id                                                     the first scan of each component

gtsam takes no more edges after a line it does not know, remarks and FIX included: they come last. An id is
the number of the scan in its log where there is one log, else the scan's place in the table of time stamps,
``id,log,scan,time``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from segmap.export.components import Content, ExportFormat, Files, told_of
from segmap.graph import Edge
from segmap.graph.arrays import turns
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["G2O", "pose_graph", "time_stamps", "write_g2o"]


def write_g2o(content: Content) -> Files:
    """All components in one graph, each in its own frame, and the time stamps."""
    parts = [component.poses for component in content.components]
    stamps = time_stamps([scan for poses in parts for scan in poses], content.times)
    graph = pose_graph(parts, content.edges, told_of(content.metadata))
    return {f"{content.stem}.g2o": graph, f"{content.stem}.times.csv": stamps}


def pose_graph(parts: Sequence[Mapping[ScanId, Pose2]], edges: Sequence[Edge], remarks: Sequence[str] = ()) -> bytes:
    """The poses of each component and the edges between them, as the bytes of a g2o file.

    Edges at scans without a pose are left out. ``remarks`` become comments at the end.
    """
    ids = _ids([scan for poses in parts for scan in poses])
    lines = [f"VERTEX_SE2 {ids[scan]} {_numbers(poses[scan])}" for poses in parts for scan in sorted(poses)]
    lines += _edges([edge for edge in edges if edge.first in ids and edge.second in ids], ids)
    lines += [f"FIX {ids[min(poses)]}" for poses in parts if poses]
    lines += [f"# {' '.join(line.split())}" for line in remarks]
    return "".join(f"{line}\n" for line in lines).encode("utf-8")


def time_stamps(scans: Sequence[ScanId], times: Mapping[ScanId, float | None]) -> bytes:
    """The scan and the time, seconds, of each id in the graph of these scans, as CSV; an unknown time stays empty."""
    rows = ["id,log,scan,time"]
    for scan, id in _ids(scans).items():
        time = times.get(scan)
        rows.append(f"{id},{scan.log},{scan.scan},{'' if time is None else f'{time:.6f}'}")
    return "".join(f"{row}\n" for row in rows).encode("utf-8")


def _ids(scans: Sequence[ScanId]) -> dict[ScanId, int]:
    ordered = sorted(scans)
    if len({scan.log for scan in ordered}) <= 1:
        return {scan: scan.scan for scan in ordered}
    return {scan: place for place, scan in enumerate(ordered)}


def _edges(edges: Sequence[Edge], ids: Mapping[ScanId, int]) -> list[str]:
    if not edges:
        return []
    upper = np.triu_indices(3)
    information = _information(edges)[:, upper[0], upper[1]]
    return [
        f"EDGE_SE2 {ids[edge.first]} {ids[edge.second]} {_numbers(edge.T_1_2)} {_numbers(row)}"
        for edge, row in zip(edges, information, strict=True)
    ]


def _information(edges: Sequence[Edge]) -> FloatArray:
    """(m, 3, 3), in the frames of the second scans."""
    back = turns(np.array([-edge.T_1_2.theta for edge in edges]))
    return np.linalg.inv(back @ np.array([edge.covariance for edge in edges]) @ back.transpose(0, 2, 1))


def _numbers(numbers: Pose2 | FloatArray) -> str:
    return " ".join(repr(float(number) + 0.0) for number in numbers)


G2O = ExportFormat(
    name="g2o",
    suffix=".g2o",
    media_type="text/plain",
    title="g2o",
    use="poses and accepted integrations for g2o, gtsam and other optimisers, time stamps beside it",
    holds="Pose graph",
    several=True,
    write=write_g2o,
)
