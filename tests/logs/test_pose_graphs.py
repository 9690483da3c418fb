"""Pose graphs of other programs."""

from __future__ import annotations

import gzip
import math
from dataclasses import replace

import numpy as np
import pytest
from graphs import far_apart

from segmap.errors import LogError
from segmap.graph import Edge, imported_edges, optimise
from segmap.logs import Limits, holds_pose_graph, read_log, read_pose_graph
from segmap.logs.pose_graphs import PoseGraphFile
from segmap.pose import Pose2
from segmap.scans import LaserLog, ScanId

G2O = """VERTEX_SE2 10 0 0 0
VERTEX_SE2 11 1 0 0.1
VERTEX_SE2 12 2 0.5 0.2
FIX 10
EDGE_SE2 10 11 1 0 0.1 100 1 2 200 3 500
EDGE_SE2 11 12 1 0.4 0.1 100 0 0 100 0 500
EDGE_SE2 10 12 2 0.5 0.2 100 0 0 100 0 500
"""
TORO = """VERTEX2 10 0 0 0
VERTEX2 11 1 0 0.1
EDGE2 10 11 1 0 0.1 100 1 200 500 2 3
"""
INFORMATION = [[100.0, 1.0, 2.0], [1.0, 200.0, 3.0], [2.0, 3.0, 500.0]]


def read(text: str, **options: object) -> PoseGraphFile:
    return read_pose_graph(text.encode(), "graph.g2o", **options)


def in_frame_2(covariance: object, theta: float) -> np.ndarray:
    turn = np.array([[math.cos(theta), math.sin(theta), 0], [-math.sin(theta), math.cos(theta), 0], [0, 0, 1]])
    return turn @ np.array(covariance) @ turn.T


@pytest.mark.parametrize("text", [G2O, TORO])
def test_the_order_of_information_entries(text):
    """g2o and TORO write the six entries in different orders; both give the same matrix, in the frame of scan 2."""
    edge = read(text).edges[0]
    assert (edge.first, edge.second, edge.T_1_2) == (10, 11, Pose2(1.0, 0.0, 0.1))
    assert np.linalg.inv(in_frame_2(edge.covariance, 0.1)) == pytest.approx(np.array(INFORMATION), rel=1e-9)


def test_vertices_and_what_is_a_loop():
    """Without marks an edge between neighbours in the file closes no loop, any other does."""
    graph = read(G2O)
    assert graph.format == "g2o"
    assert [(vertex.id, vertex.line) for vertex in graph.vertices] == [(10, 1), (11, 2), (12, 3)]
    assert graph.vertices[2].pose == Pose2(2.0, 0.5, 0.2)
    assert [edge.loop for edge in graph.edges] == [False, False, True]
    assert [edge.line for edge in graph.edges] == [5, 6, 7]
    assert graph.problems == ()


def test_marks_say_what_is_a_loop():
    """Where the file marks its edges the marks count, not the ids."""
    edge = "EDGE2 10 11 1 0 0.1 100 0 100 500 0 0"
    graph = read(f"{TORO}#LOOP EDGES\n{edge}\n#SEQUENTIAL EDGES\nEDGE2 10 12 1 0 0 9 0 9 9 0 0\n")
    assert graph.format == "TORO"
    assert [edge.loop for edge in graph.edges] == [False, True, False]


def test_compressed_and_told_by_content():
    """A gzipped graph is read, whatever its name; a laser log is none."""
    assert len(read_pose_graph(gzip.compress(G2O.encode()), "photo.jpg").edges) == 3
    assert holds_pose_graph(TORO.encode())
    assert not holds_pose_graph(b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n")


def test_vertices_that_only_edges_name():
    """A graph of edges alone has its vertices from them, without poses."""
    graph = read("EDGE_SE2 3 1 1 0 0.1 100 0 0 100 0 500\n")
    assert [(vertex.id, vertex.pose) for vertex in graph.vertices] == [(3, None), (1, None)]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("VERTEX_SE2 13 0 0", "ends before x, y and theta"),
        ("VERTEX_SE2 a 0 0 0", "the vertex is 'a', not a whole number"),
        ("VERTEX_SE2 11 0 0 0", "vertex 11 was there before, on line 2"),
        ("VERTEX_SE2 13 nan 0 0", "the x is 'nan'"),
        ("VERTEX_SE2 13 1e30 0 0", "no robot reaches"),
        ("EDGE_SE2 10", "ends before its vertices"),
        ("EDGE_SE2 10 10 0 0 0 1 0 0 1 0 1", "joins vertex 10 with itself"),
        ("EDGE_SE2 10 11 0 0 0 1 0 0 1 0", "ends before its six entries"),
        ("EDGE_SE2 10 11 0 0 0 1 0 0 1 0 x", "the information is 'x'"),
        ("EDGE_SE2 10 11 0 0 0 0 0 0 0 0 0", "not positive definite"),
        ("EDGE_SE2 10 11 0 0 0 1 2 0 1 0 1", "not positive definite"),
        ("EDGE_SE2 10 11 0 0 0 1e300 0 0 1e300 0 1e300", "beyond measure"),
        ("VERTEX_XY 4 1 2", "'VERTEX_XY' is nothing of a plane pose graph"),
    ],
)
def test_a_bad_line_costs_only_itself(line, said):
    """A line that cannot be read is told of with its number, and the rest is read."""
    graph = read(f"{G2O}{line}\n")
    assert (len(graph.vertices), len(graph.edges)) == (3, 3)
    (problem,) = graph.problems
    assert problem.line == 8
    assert said in problem.reason


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"hello\n", r"holds no pose graph .* VERTEX_SE2"),
        (b"", "holds no pose graph"),
        (b"VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n", "three dimensions"),
    ],
)
def test_no_pose_graph(content, said):
    """A file of another kind is refused in a sentence."""
    with pytest.raises(LogError, match=said):
        read_pose_graph(content, "notes.txt")


def test_too_much(monkeypatch):
    """More vertices or edges than anybody has are refused; a graph where a log is asked for is told to be one."""
    with pytest.raises(LogError, match="more than 2 vertices"):
        read(G2O, limits=Limits(scans=2))
    monkeypatch.setattr("segmap.logs.pose_graphs.MAX_EDGES", 2)
    with pytest.raises(LogError, match="more than 2 edges"):
        read(G2O)
    with pytest.raises(LogError, match="holds a pose graph without laser scans"):
        read_log(G2O.encode(), "graph.g2o")


def test_cut_off():
    """Of a file that is cut off what came before is kept, and said."""
    graph = read_pose_graph(gzip.compress(G2O.encode() * 50)[:-60], "graph.g2o.gz")
    assert graph.vertices
    assert "cut off" in graph.problems[-1].reason


# --- vertices and scans ---------------------------------------------------------------------------


def graph_log(robotlaser, mount: Pose2 | None = None) -> tuple[str, LaserLog]:
    """A graph log of two vertices with a laser each, at (1, 2, 0.5) in the world, and the log read from it."""
    T_world_laser = Pose2(1.0, 2.0, 0.5)
    vertex = T_world_laser @ (mount or Pose2.identity()).inverse()
    lines = []
    for i in range(2):
        lines += [
            f"VERTEX2 {i} {vertex.x} {vertex.y} {vertex.theta}",
            robotlaser(1.0, 2.0, 3.0).replace(" 12.5 ", f" {i}.5 "),
        ]
    text = "\n".join([*lines, "EDGE2 0 1 0.7 0.2 0.3 100 10 200 500 2 3"]) + "\n"
    return text, read_log(text.encode(), "graph.log")


def test_lasers_beside_vertices(robotlaser):
    """A laser record after a vertex gives it time, scan and the laser's pose."""
    text, log = graph_log(robotlaser)
    graph = read(text)
    assert [(vertex.time, vertex.scan_line) for vertex in graph.vertices] == [(0.5, 2), (1.5, 4)]
    assert graph.scans(log, 3) == {0: ScanId(3, 0), 1: ScanId(3, 1)}
    assert graph.mount == Pose2.identity()


def test_a_laser_mounted_away_from_the_vertex(robotlaser):
    """Edges between robots become edges between their lasers, which weigh the same."""
    mount = Pose2(-0.04, 0.1, 0.2)
    plain, held = read(graph_log(robotlaser)[0]).edges[0], read(graph_log(robotlaser, mount)[0])
    assert tuple(held.mount) == pytest.approx(tuple(mount), abs=1e-5)
    assert held.vertices[0].pose == Pose2(1.0, 2.0, 0.5)
    edge = held.edges[0]
    assert tuple(edge.T_1_2) == pytest.approx(tuple(mount.inverse() @ plain.T_1_2 @ mount), abs=1e-9)
    error = Pose2(0.01, -0.02, 0.003)
    squares = []
    for one, small in ((plain, error), (edge, mount.inverse() @ error @ mount)):
        left = np.array(tuple(small))
        squares.append(left @ np.linalg.solve(in_frame_2(one.covariance, one.T_1_2.theta), left))
    assert squares[1] == pytest.approx(squares[0], rel=1e-2)


def laser_log(times: list[float | None]) -> LaserLog:
    from segmap.scans import LaserScan

    scans = tuple(LaserScan(np.array([1.0]), 0.0, 0.1, time=time, line=100 + i) for i, time in enumerate(times))
    return LaserLog("run.log", scans)


def test_vertices_of_another_file_by_time(robotlaser):
    """Vertices with times stand for the scans of the same time, within 2 ms, in any order; others for none."""
    graph = read(graph_log(robotlaser)[0])
    assert graph.scans(laser_log([1.5015, 7.0, 0.5])) == {0: ScanId(0, 2), 1: ScanId(0, 0)}
    assert graph.scans(laser_log([0.503, 1.5])) == {1: ScanId(0, 1)}


def test_vertices_without_times():
    """By order where there are as many, else by id; where nothing tells, that is said."""
    graph = read(G2O)
    assert graph.scans(laser_log([None] * 3))[12] == ScanId(0, 2)
    assert graph.scans(laser_log([None] * 20))[12] == ScanId(0, 12)
    with pytest.raises(LogError, match=r"3 vertices and run\.log 11 scans"):
        graph.scans(laser_log([None] * 11))


def test_imported_edges():
    """Edges of vertices that stand for scans, loops or others or all; neighbours are trusted on request."""
    graph = read(G2O)
    scans = {10: ScanId(0, 0), 11: ScanId(0, 1), 12: ScanId(0, 2)}
    every = imported_edges(graph, scans, trust_neighbours=True)
    assert [edge.trusted for edge in every] == [True, True, False]
    assert {edge.source for edge in every} == {"imported"}
    assert [edge.name for edge in imported_edges(graph, scans, loops=True)] == ["0.0-0.2"]
    assert len(imported_edges(graph, scans, loops=False)) == 2
    assert len(imported_edges(graph, {10: ScanId(0, 0), 11: ScanId(0, 1)})) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "vertices", "edges", "loops"), [("intel", 2672, 3901, 1230), ("fr079", 1464, 2307, 844)]
)
def test_real_graph_logs(datasets, name, vertices, edges, loops):
    """The public graph logs: every vertex has its scan, and optimising leaves the poses near the log's own."""
    path = datasets / name / f"{name}-graph.log.gz"
    graph, log = read_pose_graph(path), read_log(path)
    assert (len(graph.vertices), len(graph.edges), sum(edge.loop for edge in graph.edges)) == (vertices, edges, loops)
    assert graph.problems == ()
    scans = graph.scans(log)
    assert list(scans.values()) == [ScanId(0, i) for i in range(len(log))]
    assert all(log[scans[v.id].scan].logged_pose == v.pose for v in graph.vertices)
    result = optimise(imported_edges(graph, scans))
    assert result.silenced == ()
    first = log[0].logged_pose.inverse()
    assert far_apart(result.poses, {scan: first @ log[scan.scan].logged_pose for scan in result.poses})[0] < 0.25


@pytest.mark.slow
def test_wrong_closures_in_a_real_graph(datasets):
    """A hundred wrong closures in a real graph, random and slid along: all are silenced, from no initial poses."""
    graph = read_pose_graph(datasets / "fr079" / "fr079-graph.log.gz")
    scans = {vertex.id: ScanId(0, place) for place, vertex in enumerate(graph.vertices)}
    factor = optimise(imported_edges(graph, scans)).variance_factor
    edges = imported_edges(graph, scans, scale=factor)
    loops = imported_edges(graph, scans, scale=factor, loops=True)
    rng, wrong = np.random.default_rng(0), []
    for _ in range(50):
        a, b = rng.choice(len(scans), 2, replace=False)
        T = Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-3.0, 3.0))
        wrong.append(Edge(ScanId(0, int(a)), ScanId(0, int(b)), T, loops[0].covariance))
        right = loops[rng.integers(len(loops))]
        slide = rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 3.0)
        wrong.append(replace(right, T_1_2=Pose2(right.T_1_2.x + slide, right.T_1_2.y, right.T_1_2.theta)))
    clean, mixed = optimise(edges), optimise([*edges, *wrong])
    assert all(residual.silenced for residual in mixed.residuals[len(edges) :])
    assert far_apart(mixed.poses, clean.poses)[0] < 0.01
