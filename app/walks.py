"""Walkthroughs that pages ask for: made once, kept while they are looked at."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from app.bodies import Name
from app.errors import RequestError, UnknownError
from app.resources import samples_folder
from app.samples import Samples
from app.workspace import Workspace
from segmap.integration import DEFAULT_PRESET, MODES, chosen_heuristic, heuristics
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import LaserLog, LaserScan, ScanId
from segmap.walkthrough import ALGORITHMS, PairWalk, Stage, Walkthrough, walk_scans

__all__ = ["Asked", "Subject", "Walks", "document", "stage_document"]

KEPT = 6
"""walkthroughs held at a time; one of 20,000 candidates takes some megabytes"""
STEPS = 64
"""most steps of one answer"""


class Asked(BaseModel):
    """Which walkthrough: the scans of a project or of a sample, and how they are integrated."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    project: Name = ""
    sample: Name = ""
    pair: Annotated[str, Field(max_length=64)] = ""
    """two scans, as in ``0.0-0.1``"""
    mode: Name | None = None
    heuristic: Name | None = None
    set: Annotated[tuple[Name, ...], Field(max_length=40)] = ()
    """parameters, each ``name=value``"""


@dataclass(frozen=True, eq=False)
class Subject:
    """What is to be walked through: two scans, and how they are integrated."""

    title: str
    first: ScanId
    second: ScanId
    scan: Callable[[ScanId], LaserScan]
    parameters: Parameters
    heuristic: str
    mode: str
    truth: Pose2 | None
    """``T_1_2`` where it is known"""

    @property
    def scans(self) -> tuple[LaserScan, LaserScan]:
        """The two scans.

        Raises:
            SegmapError: the log has no such scan.
        """
        return self.scan(self.first), self.scan(self.second)


class Walks:
    """Makes walkthroughs, and keeps the last few. Thread-safe."""

    def __init__(self) -> None:
        self._held: OrderedDict[Any, PairWalk] = OrderedDict()
        self._lock, self._making = threading.Lock(), threading.Lock()

    def walk(self, subject: Subject, key: Any) -> PairWalk:
        """The walkthrough of a subject; ``key`` tells subjects apart."""
        found = self._known(key)
        if found is not None:
            return found
        with self._making:  # one at a time: it is the same one that several requests of a page ask for
            found = self._known(key)
            if found is None:
                found = walk_scans(
                    *subject.scans, subject.parameters, subject.heuristic, subject.mode, title=subject.title
                )
                self._keep(key, found)
        return found

    def _known(self, key: Any) -> PairWalk | None:
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
            return self._held.get(key)

    def _keep(self, key: Any, made: PairWalk) -> None:
        with self._lock:
            self._held[key] = made
            while len(self._held) > KEPT:
                self._held.popitem(last=False)


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
    state = session.state
    scans = session.scan_ids
    if len(scans) < 2:
        raise RequestError("A walkthrough takes two scans; this project has fewer.")
    first, second = _pair(asked.pair, (scans[0], scans[1]))
    mode = asked.mode or state.mode
    own = state.heuristic if mode == state.mode else None
    title = f"{state.name}: scans {first} and {second}"
    return _subject(asked, title, (first, second), session.scan, state.parameters, own, mode, None)


def _of_sample(asked: Asked, samples: Samples) -> Subject:
    sample = samples.get(asked.sample)
    first, second = _pair(asked.pair, (ScanId(0, 0), ScanId(0, 1)))
    mode = asked.mode or "paper"
    title = f"{sample.title}: scans {first} and {second}"

    def scan(wanted: ScanId) -> LaserScan:
        if wanted.log >= len(sample.files):
            raise UnknownError(f"The sample {sample.name!r} has no log {wanted.log}.")
        return _log(sample.files[wanted.log]).scan(wanted.scan)

    truth = _truth(sample.truth, first, second) if sample.truth else None
    chosen_heuristic(mode)
    return _subject(asked, title, (first, second), scan, preset(DEFAULT_PRESET[mode]), None, mode, truth)


def _subject(
    asked: Asked,
    title: str,
    pair: tuple[ScanId, ScanId],
    scan: Callable[[ScanId], LaserScan],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
    truth: Pose2 | None,
) -> Subject:
    changes = dict(_assignment(text) for text in asked.set)
    chosen = chosen_heuristic(mode, asked.heuristic or heuristic)
    return Subject(title, *pair, scan, parameters.with_text(changes) if changes else parameters, chosen, mode, truth)


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise RequestError(f"A parameter is set as NAME=VALUE, not as {text[:80]!r}.")
    return name.strip(), value.strip()


def _pair(text: str, otherwise: tuple[ScanId, ScanId]) -> tuple[ScanId, ScanId]:
    if not text:
        return otherwise
    first, dash, second = text.partition("-")
    if not dash:
        raise RequestError(f"Two scans are written as 0.0-0.1, not as {text!r}.")
    return ScanId.parse(first), ScanId.parse(second)


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
        "pair": f"{subject.first}-{subject.second}",
        "mode": subject.mode,
        "modes": list(MODES),
        "heuristic": subject.heuristic,
        "heuristics": list(heuristics(subject.mode)),
        "truth": subject.truth is not None,
    }
