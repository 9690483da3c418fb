"""Walkthroughs that pages ask for: made once, kept while they are looked at."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from app.bodies import Name
from app.errors import RequestError, UnknownError
from app.posegraph import edges_of
from app.resources import samples_folder
from app.samples import Samples
from app.workspace import Workspace
from segmap.graph import Edge
from segmap.integration import DEFAULT_PRESET, MODES, chosen_heuristic, heuristics
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.project import ProjectState
from segmap.scans import LaserLog, LaserScan, ScanId
from segmap.segments import SegmentMap, extract
from segmap.walkthrough import (
    ALGORITHMS,
    MergeWalk,
    PairWalk,
    Stage,
    Walkthrough,
    walk_graph,
    walk_merge,
    walk_scans,
)

__all__ = [
    "MOST_MERGED",
    "STEPS",
    "Asked",
    "Made",
    "Subject",
    "Walks",
    "choices",
    "document",
    "stage_document",
    "subject_of",
]

KEPT = 6
"""walkthroughs held at a time; one of 20,000 candidates takes some megabytes"""
MOST_MERGED = 12
"""scans of a merge: the tree method takes 66 integrations of as many"""
STEPS = 64
"""most steps of one answer"""


class Asked(BaseModel):
    """Which walkthrough: the scans of a project or of a sample, and how they are integrated."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    project: Name = ""
    sample: Name = ""
    pair: Annotated[str, Field(max_length=64)] = ""
    """two scans, as in ``0.0-0.1``"""
    merge: Annotated[str, Field(max_length=64)] = ""
    """a row of scans of one log, first and last and every how manieth, as in ``0.0-0.12:2``; in place of a pair"""
    node: Annotated[str, Field(max_length=40)] = ""
    """an integration of a merge, by the name its step gives"""
    graph: bool = False
    """the pose graph over what is accepted in a project, in place of a pair"""
    mode: Name | None = None
    heuristic: Name | None = None
    set: Annotated[tuple[Name, ...], Field(max_length=40)] = ()
    """parameters, each ``name=value``"""


@dataclass(frozen=True, eq=False)
class GraphWalk:
    """A walkthrough of the pose graph of a project."""

    walk: Walkthrough


Made: TypeAlias = PairWalk | MergeWalk | GraphWalk


@dataclass(frozen=True, eq=False)
class Subject:
    """What is to be walked through: scans, and how they are integrated."""

    name: str
    scans: tuple[ScanId, ...]
    scan: Callable[[ScanId], LaserScan]
    parameters: Parameters
    heuristic: str
    mode: str
    merging: bool
    truths: Callable[[ScanId, ScanId], Pose2 | None]
    edges: tuple[Edge, ...] | None = None

    @property
    def title(self) -> str:
        """In words."""
        if self.edges is not None:
            return f"{self.name}: the pose graph"
        first, last = self.scans[0], self.scans[-1]
        return f"{self.name}: {'merging scans' if self.merging else 'scans'} {first} {_joint(self.merging)} {last}"

    @property
    def truth(self) -> Pose2 | None:
        """``T_1_2`` of a pair where it is known."""
        return None if self.merging or self.edges is not None else self.truths(*self.scans)

    def make(self) -> Made:
        """The walkthrough.

        Raises:
            SegmapError: the log has no such scan.
        """
        if self.edges is not None:
            return GraphWalk(walk_graph(self.edges, self._maps(), self.title))
        if self.merging:
            return walk_merge(self._maps(), self.parameters, self.heuristic, self.mode, self.title)
        one, other = (self.scan(scan) for scan in self.scans)
        names = str(self.scans[0]), str(self.scans[1])
        return walk_scans(one, other, self.parameters, self.heuristic, self.mode, self.title, self.truth, names)

    def pair_under(self, parameters: Parameters) -> tuple[SegmentMap, SegmentMap]:
        """The two maps of a pair under some parameters."""
        one, other = self.scans
        first, second = (extract(self.scan(scan), parameters, scan.log, scan.scan) for scan in (one, other))
        return first, second

    def _maps(self) -> dict[ScanId, SegmentMap]:
        return {scan: extract(self.scan(scan), self.parameters, scan.log, scan.scan) for scan in self.scans}


def _joint(merging: bool) -> str:
    return "to" if merging else "and"


class Walks:
    """Makes walkthroughs, and keeps the last few. Thread-safe."""

    def __init__(self) -> None:
        self._held: OrderedDict[Any, Made] = OrderedDict()
        self._lock, self._making = threading.Lock(), threading.Lock()

    def get(self, asked: Asked, workspace: Workspace) -> tuple[Subject, Made]:
        """What a page asks for.

        Raises:
            SegmapError: it cannot be made; the message says why.
        """
        subject = subject_of(asked, workspace)
        how = subject.mode, subject.heuristic, subject.parameters
        key = (asked.project, asked.sample, subject.scans, subject.merging, subject.edges, how)
        made = self._kept(key, subject.make)
        if not asked.node:
            return subject, made
        return subject, self._kept((*key, asked.node), lambda: _entered(made, asked.node))

    def _kept(self, key: Any, make: Callable[[], Made]) -> Made:
        found = self._known(key)
        if found is not None:
            return found
        with self._making:  # one at a time: it is the same one that several requests of a page ask for
            found = self._known(key)
            if found is None:
                found = make()
                self._keep(key, found)
        return found

    def _known(self, key: Any) -> Made | None:
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
            return self._held.get(key)

    def _keep(self, key: Any, made: Made) -> None:
        with self._lock:
            self._held[key] = made
            while len(self._held) > KEPT:
                self._held.popitem(last=False)


def _entered(made: Made, node: str) -> Made:
    found = made.enter(node) if isinstance(made, MergeWalk) else None
    if found is None:
        raise UnknownError(f"This walkthrough has no integration {node!r}.")
    return found


# --- who is asked for -------------------------------------------------------------------------------


def subject_of(asked: Asked, workspace: Workspace) -> Subject:
    """What a page asks for.

    Raises:
        SegmapError: it names no project and no sample, or scans, parameters or a heuristic that are not there.
    """
    if bool(asked.project) == bool(asked.sample):
        raise RequestError("A walkthrough is of a project or of a sample: name one of the two.")
    return _of_sample(asked, workspace.samples) if asked.sample else _of_project(asked, workspace)


def _of_project(asked: Asked, workspace: Workspace) -> Subject:
    session = workspace.session(asked.project)
    state, scans = session.state, session.scan_ids
    if len(scans) < 2:
        raise RequestError("A walkthrough takes two scans; this project has fewer.")
    mode = asked.mode or state.mode
    own = state.heuristic if mode == state.mode else None
    edges = _edges(state) if asked.graph else None
    chosen = tuple(sorted({s for e in edges for s in (e.first, e.second)})) if edges else _chosen(asked, scans[:2])
    how = _parameters(asked, state.parameters), chosen_heuristic(mode, asked.heuristic or own), mode
    return Subject(state.name, chosen, session.scan, *how, bool(asked.merge), lambda *_: None, edges)


def _edges(state: ProjectState) -> tuple[Edge, ...]:
    edges = edges_of(state)
    if len(edges) < 2:
        raise RequestError("A pose graph takes two accepted integrations; this project has fewer.")
    return edges


def _of_sample(asked: Asked, samples: Samples) -> Subject:
    sample = samples.get(asked.sample)
    if asked.graph:
        raise RequestError("Only a project has a pose graph of what was accepted.")
    mode = asked.mode or "paper"
    heuristic = chosen_heuristic(mode, asked.heuristic)

    def scan(wanted: ScanId) -> LaserScan:
        if wanted.log >= len(sample.files):
            raise UnknownError(f"The sample {sample.name!r} has no log {wanted.log}.")
        return _log(sample.files[wanted.log]).scan(wanted.scan)

    def truth(first: ScanId, second: ScanId) -> Pose2 | None:
        return _truth(sample.truth, first, second) if sample.truth else None

    chosen = _chosen(asked, (ScanId(0, 0), ScanId(0, 1)))
    parameters = _parameters(asked, preset(DEFAULT_PRESET[mode]))
    return Subject(sample.title, chosen, scan, parameters, heuristic, mode, bool(asked.merge), truth)


def _parameters(asked: Asked, parameters: Parameters) -> Parameters:
    changes = dict(_assignment(text) for text in asked.set)
    return parameters.with_text(changes) if changes else parameters


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise RequestError(f"A parameter is set as NAME=VALUE, not as {text[:80]!r}.")
    return name.strip(), value.strip()


def _chosen(asked: Asked, otherwise: Sequence[ScanId]) -> tuple[ScanId, ...]:
    return _row(asked.merge) if asked.merge else _pair(asked.pair) if asked.pair else tuple(otherwise)


def _pair(text: str) -> tuple[ScanId, ScanId]:
    first, dash, second = text.partition("-")
    if not dash:
        raise RequestError(f"Two scans are written as 0.0-0.1, not as {text!r}.")
    return ScanId.parse(first), ScanId.parse(second)


def _row(text: str) -> tuple[ScanId, ...]:
    """The scans of a row, as in ``0.0-0.12:2``."""
    ends, _, stride = text.partition(":")
    first, last = _pair(ends)
    step = int(stride) if stride.isdecimal() and 0 < int(stride) < 10_000 else 1
    scans = tuple(ScanId(first.log, scan) for scan in range(first.scan, last.scan + 1, step)[: MOST_MERGED + 1])
    if first.log != last.log or not 2 <= len(scans) <= MOST_MERGED:
        raise RequestError(f"A merge is shown of 2 to {MOST_MERGED} scans of one log, as in 0.0-0.7 or 0.0-0.20:4.")
    return scans


@cache
def _log(file: str) -> LaserLog:
    """A sample log; there are few, and they are small."""
    return read_log(samples_folder() / file)


def _truth(file: str, first: ScanId, second: ScanId) -> Pose2 | None:
    sessions = _poses(file)
    if max(first.log, second.log) >= len(sessions):
        return None
    one, other = sessions[first.log], sessions[second.log]
    if first.scan >= len(one) or second.scan >= len(other):
        return None
    return Pose2(*one[first.scan]).inverse() @ Pose2(*other[second.scan])


@cache
def _poses(file: str) -> list[list[tuple[float, float, float]]]:
    held = json.loads((samples_folder() / file).read_text("utf-8"))
    return [[(x, y, theta) for x, y, theta in session["poses"]] for session in held["sessions"]]


# --- as plain data ----------------------------------------------------------------------------------


def document(walk: Walkthrough, more: dict[str, Any] | None = None) -> dict[str, Any]:
    """A walkthrough without its steps."""
    used = {stage.algorithm for stage in walk.stages} | {"4"}
    algorithms = {
        key: {
            "title": algorithm.title,
            "lines": [{"number": one.number, "text": one.text, "indent": one.indent} for one in algorithm.lines],
        }
        for key, algorithm in ALGORITHMS.items()
        if key in used
    }
    stages = [stage_document(stage) for stage in walk.stages]
    return {"title": walk.title, "base": walk.base, "algorithms": algorithms, "stages": stages, **(more or {})}


def stage_document(stage: Stage) -> dict[str, Any]:
    """A stage without its steps."""
    return stage.to_json()


def choices(subject: Subject) -> dict[str, Any]:
    """How a subject is integrated, and how else it could be."""
    return {
        "pair": f"{subject.scans[0]}-{subject.scans[-1]}",
        "merging": subject.merging,
        "mode": subject.mode,
        "modes": list(MODES),
        "heuristic": subject.heuristic,
        "heuristics": list(heuristics(subject.mode)),
        "truth": subject.truth is not None,
    }
