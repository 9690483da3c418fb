"""Pose graphs as g2o, opened by gtsam and by our own reader."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from graphs import far_apart, ring, with_wrong

from segmap.export.components import Content
from segmap.export.g2o import pose_graph, time_stamps, write_g2o
from segmap.graph import Edge, imported_edges, optimise
from segmap.logs import read_pose_graph
from segmap.merging import Component
from segmap.scans import ScanId
from segmap.segments import SegmentMap


@pytest.fixture(scope="module")
def curated():
    """A graph whose wrong edges were found, with covariances that couple everything."""
    _, edges = ring(30)
    rng = np.random.default_rng(7)
    roots = [0.01 * (rng.normal(size=(3, 3)) + 3.0 * np.eye(3)) for _ in edges]
    skewed = [Edge(e.first, e.second, e.T_1_2, root @ root.T) for e, root in zip(edges, roots, strict=True)]
    return optimise(with_wrong(skewed, 0.1, "random"))


def test_gtsam_sees_the_same_errors(curated, tmp_path):
    """gtsam reads poses and edges, and finds the same residual error of every edge."""
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'segmap[graph]'")
    path = tmp_path / "graph.g2o"
    path.write_bytes(pose_graph([curated.poses], [residual.edge for residual in curated.residuals], ["a remark"]))
    graph, values = gtsam.readG2o(str(path), False)
    for scan, pose in curated.poses.items():
        theirs = values.atPose2(scan.scan)
        assert (theirs.x(), theirs.y(), theirs.theta()) == pytest.approx(tuple(pose), abs=1e-9)
    assert graph.size() == len(curated.residuals)
    theirs = sorted(2.0 * graph.at(i).error(values) for i in range(graph.size()))
    ours = sorted(residual.chi**2 for residual in curated.residuals)
    assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-9)


def test_read_back(curated):
    """Our own reader gives back poses, edges and what closes a loop; optimising again changes nothing."""
    kept = [residual.edge for residual in curated.residuals if not residual.silenced]
    graph = read_pose_graph(pose_graph([curated.poses], kept), "graph.g2o")
    scans = {vertex.id: ScanId(0, vertex.id) for vertex in graph.vertices}
    assert far_apart({scans[v.id]: v.pose for v in graph.vertices}, curated.poses) == pytest.approx((0, 0), abs=1e-9)
    back = imported_edges(graph, scans)
    assert sorted(edge.name for edge in back) == sorted(edge.name for edge in kept)
    loops = {edge.name for edge in imported_edges(graph, scans, loops=True)}
    assert loops == {edge.name for edge in kept if edge.second.scan - edge.first.scan != 1}
    by_name = {(edge.name, round(edge.T_1_2.x, 6)): edge for edge in kept}
    for edge in back:
        known = by_name[edge.name, round(edge.T_1_2.x, 6)]
        assert np.array(edge.covariance) == pytest.approx(np.array(known.covariance), rel=1e-6, abs=1e-12)
    assert far_apart(optimise(back).poses, curated.poses) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_several_logs_are_numbered_through(curated):
    """With several logs ids are numbered through, and the table of time stamps says whose they are."""
    other = optimise(ring(5, log=1)[1])
    parts = [curated.poses, other.poses]
    text = pose_graph(parts, [residual.edge for residual in other.residuals]).decode()
    assert text.count("VERTEX_SE2") == 35
    assert [line for line in text.splitlines() if line.startswith("FIX")] == ["FIX 0", "FIX 30"]
    assert "EDGE_SE2 30 31 " in text
    scans = [scan for part in parts for scan in part]
    rows = list(csv.DictReader(io.StringIO(time_stamps(scans, {ScanId(1, 2): 12.5}).decode())))
    assert rows[32] == {"id": "32", "log": "1", "scan": "2", "time": "12.500000"}
    assert rows[0]["time"] == ""


def test_a_map_as_g2o_and_time_stamps(curated):
    """A merged map gives both files; edges at scans without a pose are left out, metadata are remarks."""
    empty = SegmentMap(np.empty((0, 4)))
    part = Component("hall", tuple(curated.poses)[:3], {s: curated.poses[s] for s in list(curated.poses)[:3]}, empty)
    edges = [residual.edge for residual in curated.residuals]
    files = write_g2o(Content([part], {"title": "two\nlines"}, edges=edges, stem="hall"))
    assert list(files) == ["hall.g2o", "hall.times.csv"]
    lines = files["hall.g2o"].decode().splitlines()
    assert lines[-1] == "# title: two lines"
    joined = [edge for edge in edges if {edge.first, edge.second} <= set(part.scans)]
    assert sum(line.startswith("EDGE_SE2") for line in lines) == len(joined) >= 3
    assert write_g2o(Content([]))["map.g2o"] == b""
