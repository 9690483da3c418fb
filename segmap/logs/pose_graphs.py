"""Pose graphs of other programs: g2o, TORO, and the graph logs that hold laser records too.

::

    VERTEX_SE2 id x y theta      EDGE_SE2 id id x y theta I11 I12 I13 I22 I23 I33       g2o
    VERTEX2    id x y theta      EDGE2    id id x y theta I11 I12 I22 I33 I13 I23       TORO
    ROBOTLASER1 ... time host time      after a vertex: its laser's pose and its time
    #SEQUENTIAL EDGES, #LOOP EDGES      what the edges below are

The information matrix is that of the error in the frame of the edge's second vertex, as g2o and gtsam have it.
Where laser records stand beside vertices, the laser may be mounted away from the vertex: edges and poses are
given for the lasers then, as everything here is about scans.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from segmap.errors import LogError
from segmap.logs.carmen import PARSERS
from segmap.logs.records import Problems
from segmap.logs.source import Limits, LogFile, LogSource
from segmap.logs.stamps import nearest_stamps
from segmap.logs.text import MalformedError, first_words, number, shown
from segmap.pose import FloatArray, Pose2
from segmap.scans import LaserLog, LogProblem, ScanId

__all__ = ["GraphEdge", "GraphVertex", "PoseGraphFile", "holds_pose_graph", "is_pose_graph", "read_pose_graph"]

MAX_EDGES = 500_000
PLACES = {
    b"EDGE_SE2": (0, 1, 2, 1, 3, 4, 2, 4, 5),
    b"EDGE2": (0, 1, 4, 1, 2, 5, 4, 5, 3),
}
"""where each entry of the information matrix, row by row, stands among the six that are written"""
VERTICES = (b"VERTEX_SE2", b"VERTEX2")
FORMATS = {b"VERTEX_SE2": "g2o", b"EDGE_SE2": "g2o", b"VERTEX2": "TORO", b"EDGE2": "TORO"}
PASSED = re.compile(rb"#.*|FIX|PARAM\w*|ODOM|SYNC|TRUEPOS|[RF]LASER|(ROBOT|RAW)LASER[0-9]")
"""first words of lines that belong in such files and hold nothing of the graph"""
UNKNOWN_WORDS = 1000
MOUNT_DIGITS = 5
"""of metres and radians; graph logs do not hold more"""
FARTHEST = 1e7
"""metres"""
MOST_TURNS = 1e6
"""radians"""
LEAST_INFORMATION, MOST_INFORMATION = 1e-9, 1e12
"""per square metre or square radian: standard deviations from a micrometre to the far side of the hills"""

Covariance = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class GraphVertex:
    """A pose of the graph."""

    id: int
    """as the file has it"""
    pose: Pose2 | None
    """where the file's own optimiser left it, of the laser where one is there; None where only edges name the vertex"""
    line: int
    """line of the file, from 1"""
    time: float | None = None
    """seconds, of the laser record after it"""
    scan_line: int | None = None
    """line of that record"""


@dataclass(frozen=True, slots=True)
class GraphEdge:
    """A relative pose of the graph."""

    first: int
    """id of a vertex"""
    second: int
    """id of a vertex"""
    T_1_2: Pose2
    """of the lasers where they are there, else of the vertices"""
    covariance: Covariance
    """of x, y (metres, axes of frame 1) and theta (radians) of ``T_1_2``"""
    loop: bool
    """marked as a loop closure; in files without marks: its vertices are not neighbours in the file"""
    line: int
    """line of the file, from 1"""


@dataclass(frozen=True, eq=False)
class PoseGraphFile:
    """A pose graph as read."""

    name: str
    format: str
    """``g2o`` or ``TORO``"""
    vertices: tuple[GraphVertex, ...]
    """in file order; those that only edges name after the others"""
    edges: tuple[GraphEdge, ...]
    """in file order"""
    mount: Pose2 = field(default_factory=Pose2.identity)
    """of the laser in the frame of the vertex, where there are lasers"""
    problems: tuple[LogProblem, ...] = field(default=())
    """lines that were left out, and why"""

    def scans(self, log: LaserLog, number: int = 0) -> dict[int, ScanId]:
        """The scan of a log that each vertex stands for, by the vertex's id; ``number`` is that of the log.

        Vertices with laser records after them in the file stand for the scans of those lines, where the log
        is that file, or of the same time, within 2 ms; vertices without, for the scans in the same order,
        where there are as many, or for those their ids count.

        Raises:
            LogError: nothing tells which scans the vertices stand for.
        """
        for places in (self._by_line(log), self._by_time(log), self._by_order(log), self._by_id(log)):
            if places:
                return {id: ScanId(number, place) for id, place in places.items()}
        raise LogError(
            f"{self.name} has {len(self.vertices)} vertices and {log.name} {len(log)} scans, and neither times nor"
            " ids tell which belong together: give the log the graph was made from."
        )

    def _by_line(self, log: LaserLog) -> dict[int, int]:
        lines = {scan.line: place for place, scan in enumerate(log) if scan.line is not None}
        places = {v.id: lines[v.scan_line] for v in self.vertices if v.scan_line in lines and v.scan_line is not None}
        times = {v.id: v.time for v in self.vertices}
        return places if places and all(log[place].time == times[id] for id, place in places.items()) else {}

    def _by_time(self, log: LaserLog) -> dict[int, int]:
        stamped = sorted((scan.time, place) for place, scan in enumerate(log) if scan.time is not None)
        timed = [(v.id, v.time) for v in self.vertices if v.time is not None]
        found = nearest_stamps(np.array([time for time, _ in stamped]), np.array([time for _, time in timed]))
        return {id: stamped[place][1] for (id, _), place in zip(timed, found, strict=True) if place >= 0}

    def _by_order(self, log: LaserLog) -> dict[int, int]:
        if len(self.vertices) != len(log) or any(vertex.time is not None for vertex in self.vertices):
            return {}
        return {vertex.id: place for place, vertex in enumerate(self.vertices)}

    def _by_id(self, log: LaserLog) -> dict[int, int]:
        if any(vertex.time is not None or not 0 <= vertex.id < len(log) for vertex in self.vertices):
            return {}
        return {vertex.id: vertex.id for vertex in self.vertices}


def is_pose_graph(head: bytes) -> bool:
    """Whether the first bytes of a file, decompressed, are those of a pose graph."""
    return any(words[0] in FORMATS and len(words) > 1 and _is_id(words[1]) for words in first_words(head))


def holds_pose_graph(source: LogSource) -> bool:
    """Whether a file, which is not a stream, holds a pose graph, by its first bytes.

    Raises:
        LogError: it cannot be opened.
    """
    with LogFile(source) as file:
        return is_pose_graph(file.head())


def read_pose_graph(source: LogSource, name: str | None = None, limits: Limits | None = None) -> PoseGraphFile:
    """Read a pose graph from a path, bytes or a binary stream, plain or gzipped.

    A line that cannot be read is left out and told of in ``problems``, and never costs the others.

    Raises:
        LogError: the file cannot be opened, holds no pose graph, or grows beyond ``limits``.
    """
    problems = Problems()
    with LogFile(source, name, limits) as file:
        head = file.head()
        if not is_pose_graph(head):
            raise LogError(_unknown(head, file.name))
        reader = _Reader(file, problems)
        reader.read()
        if file.damage:
            problems.add(reader.line, f"the compressed data are {file.damage} after this line: fetch the file again")
    return reader.graph()


def _unknown(head: bytes, name: str) -> str:
    three = next((words[0] for words in first_words(head) if words[0].startswith((b"VERTEX_SE3", b"EDGE_SE3"))), None)
    if three:
        return f"{name} holds a pose graph in three dimensions ({shown(three)}); segmap works in the plane."
    return (
        f"{name} holds no pose graph that segmap reads: expected g2o (lines that start with VERTEX_SE2 or EDGE_SE2)"
        " or TORO (VERTEX2 or EDGE2), plain or gzipped."
    )


class _Reader:
    """What was read so far."""

    def __init__(self, file: LogFile, problems: Problems) -> None:
        self._file, self._problems = file, problems
        self._vertices: dict[int, GraphVertex] = {}
        self._edges: list[GraphEdge] = []
        self._mounts: list[Pose2] = []
        self._latest: int | None = None
        self._section: bool | None = None
        self._format, self._unknown = "", set[bytes]()
        self.line = 1

    def read(self) -> None:
        for line, text in self._file.lines(self._problems.add):
            self.line = line
            if words := text.split():
                try:
                    self._take(words)
                except MalformedError as error:
                    self._problems.add(line, f"{error}; the line was left out")

    def _take(self, words: Sequence[bytes]) -> None:
        word = words[0]
        self._format = self._format or FORMATS.get(word, "")
        if word in VERTICES:
            self._vertex(words)
        elif word in PLACES:
            self._edge(words)
        elif word in PARSERS and self._latest is not None:
            self._laser(words)
        elif word.startswith(b"#"):
            self._mark(b" ".join(words).upper())
        elif not PASSED.fullmatch(word) and word not in self._unknown and len(self._unknown) < UNKNOWN_WORDS:
            self._unknown.add(word)
            self._problems.add(self.line, f"{shown(word)} is nothing of a plane pose graph; such lines were left out")

    def _mark(self, text: bytes) -> None:
        if b"LOOP" in text:
            self._section = True
        elif b"SEQUENTIAL" in text or b"ODOMETRY" in text:
            self._section = False

    def _vertex(self, words: Sequence[bytes]) -> None:
        self._latest = None
        id, pose = _id(words, 1), _pose_of(words, 2)
        if id in self._vertices:
            raise MalformedError(f"vertex {id} was there before, on line {self._vertices[id].line}")
        if len(self._vertices) >= self._file.limits.scans:
            raise LogError(f"{self._file.name} holds more than {self._file.limits.scans} vertices: split it.")
        self._vertices[id] = GraphVertex(id, pose, self.line)
        self._latest = id

    def _laser(self, words: Sequence[bytes]) -> None:
        latest, self._latest = self._latest, None
        record = PARSERS[words[0]](words, self.line)
        if record is None or latest is None:
            return
        vertex = self._vertices[latest]
        if record.pose is not None and vertex.pose is not None:
            self._mounts.append(vertex.pose.inverse() @ record.pose)
        pose = record.pose or vertex.pose
        self._vertices[latest] = replace(vertex, pose=pose, time=record.time, scan_line=self.line)

    def _edge(self, words: Sequence[bytes]) -> None:
        first, second = _id(words, 1), _id(words, 2)
        if first == second:
            raise MalformedError(f"the edge joins vertex {first} with itself")
        T_1_2 = _pose_of(words, 3)
        if len(words) < 12:
            raise MalformedError(f"{shown(words[0])} ends before its six entries of information")
        written = [number(word, "information") for word in words[6:12]]
        information = np.array([written[place] for place in PLACES[words[0]]]).reshape(3, 3)
        covariance = _inverted(information)
        if len(self._edges) >= MAX_EDGES:
            raise LogError(f"{self._file.name} holds more than {MAX_EDGES} edges: split it.")
        self._edges.append(GraphEdge(first, second, T_1_2, covariance, bool(self._section), self.line))

    def graph(self) -> PoseGraphFile:
        """All of it."""
        for edge in self._edges:
            for id in (edge.first, edge.second):
                self._vertices.setdefault(id, GraphVertex(id, None, edge.line))
        vertices, mount = tuple(self._vertices.values()), self._mount()
        edges = [_between_lasers(edge, mount) for edge in self._edges]
        if self._section is None:
            ranks = {vertex.id: rank for rank, vertex in enumerate(vertices)}
            edges = [replace(e, loop=abs(ranks[e.first] - ranks[e.second]) != 1) for e in edges]
        return PoseGraphFile(self._file.name, self._format, vertices, tuple(edges), mount, self._problems.all())

    def _mount(self) -> Pose2:
        """The median: single vertices are rounded, or beside another's laser."""
        if not self._mounts:
            return Pose2.identity()
        x, y, theta = np.median([tuple(mount) for mount in self._mounts], axis=0).round(MOUNT_DIGITS).tolist()
        return Pose2(x, y, theta)


def _is_id(word: bytes) -> bool:
    return re.fullmatch(rb"[+-]?[0-9]{1,18}", word) is not None


def _id(words: Sequence[bytes], place: int) -> int:
    if place >= len(words):
        raise MalformedError(f"{shown(words[0])} ends before its vertices")
    if not _is_id(words[place]):
        raise MalformedError(f"the vertex is {shown(words[place])}, not a whole number")
    return int(words[place])


def _pose_of(words: Sequence[bytes], place: int) -> Pose2:
    if len(words) < place + 3:
        raise MalformedError(f"{shown(words[0])} ends before x, y and theta")
    x, y, theta = (number(word, what) for word, what in zip(words[place:], ("x", "y", "theta"), strict=False))
    if max(abs(x), abs(y)) > FARTHEST or abs(theta) > MOST_TURNS:
        raise MalformedError(f"{shown(words[0])} has a pose that no robot reaches")
    return Pose2(x, y, theta)


def _inverted(information: FloatArray) -> Covariance:
    strengths = np.linalg.eigvalsh(information)
    least = max(LEAST_INFORMATION, strengths[2] / MOST_INFORMATION)
    if not least <= strengths[0] <= strengths[2] <= MOST_INFORMATION:
        raise MalformedError("the information matrix is not positive definite, or beyond measure")
    return _symmetric(np.linalg.inv(information).astype(np.float64))


def _symmetric(matrix: FloatArray) -> Covariance:
    a, b, c = ((float(row[0]), float(row[1]), float(row[2])) for row in (matrix + matrix.T) / 2.0)
    return a, b, c


def _between_lasers(edge: GraphEdge, mount: Pose2) -> GraphEdge:
    """The edge between the lasers of its vertices, its covariance brought from frame 2 into the axes of frame 1."""
    back = mount.inverse()
    T_1_2 = back @ edge.T_1_2 @ mount
    cosine, sine = math.cos(T_1_2.theta), math.sin(T_1_2.theta)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    cosine, sine = math.cos(back.theta), math.sin(back.theta)
    arm = np.array([[cosine, -sine, back.y], [sine, cosine, -back.x], [0.0, 0.0, 1.0]])
    slope = turn @ arm
    return replace(edge, T_1_2=T_1_2, covariance=_symmetric(slope @ np.array(edge.covariance) @ slope.T))
