"""Many pairs of maps -> their matches, spread over processes of this machine or over a cluster."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, TypeAlias

from joblib import Parallel, delayed, parallel_config

from segmap.errors import ParameterError
from segmap.integration import Match, match_maps
from segmap.parameters import Parameters
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["BACKENDS", "Crew", "Keep", "Matches", "Pair", "Told", "spread", "spread_tasks"]

Pair: TypeAlias = tuple[ScanId, ScanId]
"""the two scans of an integration, the earlier one first"""
Matches: TypeAlias = dict[Pair, Match]
Keep: TypeAlias = Callable[[Matches], None]
"""hears of new matches, some at a time, also of those found before the work was stopped"""
Told: TypeAlias = Callable[[str, int, int], None]
"""hears what is done, how much of it, and of how much"""
BACKENDS = ("processes", "dask")
"""processes of this machine, or the Dask cluster that a client in this process is connected to"""
BATCH = 24
"""pairs sent to a process at a time, and matches given out at a time to be kept"""


def spread(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Iterable[Pair],
    parameters: Parameters,
    *,
    heuristic: str | None = None,
    mode: str = "verified",
    workers: int = 1,
    backend: str = "processes",
    known: Mapping[Pair, Match] | None = None,
    keep: Keep | None = None,
    progress: Callable[[int, int], None] | None = None,
    check: Callable[[], None] | None = None,
) -> Iterator[tuple[Pair, Match]]:
    """The match of each pair of maps, in the order of the pairs; the same whatever the number of workers.

    What is ``known`` is not matched again; ``keep`` is given the others. Keep them, and a search that was
    stopped goes on where it was. ``progress`` is told how many of how many pairs are done; ``check`` is called
    between pairs (with several workers: between batches) and raises to stop.

    Raises:
        ParameterError: there is no such backend, heuristic or mode.
    """
    if backend not in BACKENDS:
        raise ParameterError(f"There is no backend {backend!r}. Backends are: {', '.join(BACKENDS)}.")
    wanted = list(pairs)
    held = {pair: known[pair] for pair in wanted if pair in known} if known else {}
    missing = [pair for pair in wanted if pair not in held]
    if backend == "processes" and (workers <= 1 or len(missing) <= BATCH):
        results = _here(maps, missing, parameters, heuristic, mode, check)
    else:
        results = _spread(maps, missing, parameters, heuristic, mode, workers, backend, check)
    with closing(results if keep is None else _kept(results, keep)) as found:
        for done, pair in enumerate(wanted, start=1):
            match = held[pair] if pair in held else next(found)[1]
            if progress is not None:
                progress(done, len(wanted))
            yield pair, match


_Results: TypeAlias = Generator[tuple[Pair, Match], None, None]


def _kept(results: _Results, keep: Keep) -> _Results:
    """The same matches, each given out to be kept: by the batch, and what is left over when the work ends or stops."""
    waiting: Matches = {}
    try:
        with closing(results):
            for pair, match in results:
                waiting[pair] = match
                if len(waiting) >= BATCH:
                    keep(waiting)
                    waiting = {}
                yield pair, match
    finally:
        if waiting:
            keep(waiting)


def _here(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Sequence[Pair],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
    check: Callable[[], None] | None,
) -> _Results:
    for a, b in pairs:
        yield (a, b), match_maps(maps[a], maps[b], parameters, heuristic, mode, check=check)


def _spread(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Sequence[Pair],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
    workers: int,
    backend: str,
    check: Callable[[], None] | None,
) -> _Results:
    batches = list(_batches(pairs, BATCH))
    tasks = (delayed(_matched)(*_needed(maps, batch), parameters, heuristic, mode) for batch in batches)
    with closing(spread_tasks(tasks, workers, backend)) as results:
        for batch, matches in zip(batches, results, strict=True):
            if check is not None:
                check()
            yield from zip(batch, matches, strict=True)


def spread_tasks(tasks: Iterable[Any], workers: int, backend: str = "processes") -> Generator[Any, None, None]:
    """The results of joblib's delayed calls, in their order, from processes of this machine or from a cluster."""
    cluster: AbstractContextManager[object] = parallel_config("dask") if backend == "dask" else nullcontext()
    with cluster:
        parallel = Parallel(n_jobs=None if backend == "dask" else workers, return_as="generator", batch_size=1)
        with closing(parallel(tasks)) as results:
            yield from results


def _batches(pairs: Sequence[Pair], size: int) -> Iterator[list[Pair]]:
    rest = iter(pairs)
    while batch := list(islice(rest, size)):
        yield batch


def _needed(maps: Mapping[ScanId, SegmentMap], batch: Sequence[Pair]) -> tuple[dict[ScanId, SegmentMap], list[Pair]]:
    return {scan: maps[scan] for pair in batch for scan in pair}, list(batch)


def _matched(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Sequence[Pair],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
) -> list[Match]:
    return [match for _, match in _here(maps, pairs, parameters, heuristic, mode, None)]


def _nobody(what: str, done: int, total: int) -> None:
    """Nobody listens."""


@dataclass(frozen=True, eq=False)
class Crew:
    """Who matches the scans of some logs in verified mode, what is known beforehand, and who hears of it."""

    maps: Mapping[ScanId, SegmentMap]
    parameters: Parameters
    workers: int = 1
    backend: str = "processes"
    known: Mapping[Pair, Match] = field(default_factory=dict)
    """matches under these parameters, found before: they are not looked for again"""
    keep: Keep | None = None
    told: Told = _nobody
    check: Callable[[], None] | None = None
    """raises to stop"""

    def matches(self, pairs: Sequence[Pair], what: str) -> Matches:
        """The matches of some pairs; ``what`` says in words what is done."""
        return dict(
            spread(
                self.maps,
                pairs,
                self.parameters,
                workers=self.workers,
                backend=self.backend,
                known=self.known,
                keep=self.keep,
                progress=lambda done, total: self.told(what, done, total),
                check=self.check,
            )
        )

    def tasks(self, tasks: Iterable[Any]) -> Iterator[Any]:
        """The results of joblib's delayed calls, in their order; it is looked before each whether to go on."""
        with closing(spread_tasks(tasks, self.workers, self.backend)) as results:
            for result in results:
                if self.check is not None:
                    self.check()
                yield result

    def new(self, found: Matches) -> None:
        """Give matches that were found otherwise to whoever keeps them, those that are not known."""
        fresh = {pair: match for pair, match in found.items() if pair not in self.known}
        if self.keep is not None and fresh:
            self.keep(fresh)
