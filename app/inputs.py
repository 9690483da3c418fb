"""The logs of a project, read when first needed, and the segments of their scans."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from app.errors import UnknownError
from app.kept import ResultStore
from segmap.errors import SegmapError
from segmap.logs import Limits, read_log
from segmap.parameters import Parameters
from segmap.project import LogInfo
from segmap.scans import LaserLog, LaserScan, ScanId
from segmap.segments import SegmentMap, extract

__all__ = ["EXTRACTION", "Facts", "Inputs", "facts_of", "remember"]

EXPANDS = 16
"""bytes of a log for each byte of its file, at the most; compressed laser logs have 3 to 10"""
EXTRACTION = ("max_range", "cluster_distance", "split_tolerance", "min_segment_length")
"""the parameters a scan's segments depend on"""


@dataclass(frozen=True)
class Facts:
    """What was found out about a log when it was read."""

    no_return: float | None
    """metres"""
    problems: tuple[str, ...]


def facts_of(log: LaserLog) -> Facts:
    """The facts of a log that was just read."""
    return Facts(log.no_return, tuple(str(problem) for problem in log.problems))


def remember(results: ResultStore, info: LogInfo, facts: Facts) -> None:
    """Keep the facts of a log in its project, so that showing them takes no reading."""
    with suppress(SegmapError):  # on a full disk they are found again when asked for
        results.put_result(_key(info), json.dumps([facts.no_return, facts.problems]))


def _scan_ids(logs: Sequence[LogInfo]) -> tuple[ScanId, ...]:
    return tuple(ScanId(info.index, i) for info in logs for i in range(info.scans))


def _key(info: LogInfo) -> str:
    return f"log/{info.sha256}{info.topic}"


class Inputs:
    """Scans and segment maps by ScanId; each log is read once, each map extracted once for its parameters."""

    def __init__(
        self,
        results: ResultStore,
        logs: Sequence[LogInfo],
        log_bytes: Callable[[int], bytes],
        known: Mapping[int, LaserLog] | None = None,
    ) -> None:
        self._results, self._infos, self._bytes = results, tuple(logs), log_bytes
        self._scan_ids = _scan_ids(self._infos)
        self._logs: dict[int, LaserLog] = dict(known or {})
        self._reading = threading.Lock()
        self._lock = threading.Lock()
        self._maps: dict[ScanId, SegmentMap] = {}
        self._extraction: tuple[Any, ...] = ()

    @property
    def scan_ids(self) -> tuple[ScanId, ...]:
        """All scans of all logs, in order."""
        return self._scan_ids

    def add(self, logs: Sequence[LogInfo], known: Mapping[int, LaserLog]) -> None:
        """Take in logs that were added to the project; ``logs`` are all it has now."""
        with self._reading:
            self._logs.update(known)
            self._infos, self._scan_ids = tuple(logs), _scan_ids(logs)

    def log(self, index: int) -> LaserLog:
        """A log of the project.

        Raises:
            UnknownError: the project has no such log.
        """
        if not 0 <= index < len(self._infos):
            raise UnknownError(f"This project has no log {index}: it has {len(self._infos)}.")
        with self._reading:
            if index not in self._logs:
                info = self._infos[index]
                limits = Limits(size=max(Limits().size, EXPANDS * info.size))  # it was read before, whatever its size
                log = read_log(self._bytes(index), info.name, limits, info.topic or None)
                self._logs[index] = replace(log, name=info.name)
                remember(self._results, info, facts_of(log))
            return self._logs[index]

    def facts(self, index: int) -> Facts:
        """What is known of a log; it is read only if nobody has ever read it in this project."""
        held = self._results.get_result(_key(self._infos[index]))
        if held is None:
            return facts_of(self.log(index))
        no_return, problems = json.loads(held)
        return Facts(no_return, tuple(problems))

    def scan(self, scan_id: ScanId) -> LaserScan:
        """A scan of the project.

        Raises:
            UnknownError: there is no such log.
            ScanError: the log has no such scan.
        """
        return self.log(scan_id.log).scan(scan_id.scan)

    def segment_map(self, scan_id: ScanId, parameters: Parameters) -> SegmentMap:
        """The segments of a scan under these parameters."""
        extraction = tuple(getattr(parameters, name) for name in EXTRACTION)
        with self._lock:
            if extraction == self._extraction and scan_id in self._maps:
                return self._maps[scan_id]
        found = extract(self.scan(scan_id), parameters, scan_id.log, scan_id.scan)
        with self._lock:
            if extraction != self._extraction:
                self._maps.clear()
                self._extraction = extraction
            self._maps[scan_id] = found
        return found
