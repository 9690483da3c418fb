"""Many pairs of maps -> their matches, spread over processes of this machine or over a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from itertools import islice
from typing import TypeAlias

from joblib import Parallel, delayed, parallel_config

from segmap.errors import ParameterError
from segmap.integration import Match, match_maps
from segmap.parameters import Parameters
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["BACKENDS", "Matches", "Pair", "spread"]

Pair: TypeAlias = tuple[ScanId, ScanId]
"""the two scans of an integration, the earlier one first"""
Matches: TypeAlias = dict[Pair, Match]
BACKENDS = ("processes", "dask")
"""processes of this machine, or the Dask cluster that a client in this process is connected to"""
BATCH = 24
"""pairs sent to a process at a time"""


def spread(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Iterable[Pair],
    parameters: Parameters,
    *,
    heuristic: str | None = None,
    mode: str = "verified",
    workers: int = 1,
    backend: str = "processes",
    progress: Callable[[int, int], None] | None = None,
    check: Callable[[], None] | None = None,
) -> Iterator[tuple[Pair, Match]]:
    """The match of each pair of maps, in the order of the pairs; the same whatever the number of workers.

    ``progress`` is told how many of how many pairs are done; ``check`` is called between pairs (with several
    workers: between batches) and raises to stop. What was given out by then is done: to go on later, leave
    it out.

    Raises:
        ParameterError: there is no such backend, heuristic or mode.
    """
    wanted = list(pairs)
    if backend not in BACKENDS:
        raise ParameterError(f"There is no backend {backend!r}. Backends are: {', '.join(BACKENDS)}.")
    if backend == "processes" and (workers <= 1 or len(wanted) <= BATCH):
        results = _here(maps, wanted, parameters, heuristic, mode, check)
    else:
        results = _spread(maps, wanted, parameters, heuristic, mode, workers, backend, check)
    for done, (pair, match) in enumerate(results, start=1):
        if progress is not None:
            progress(done, len(wanted))
        yield pair, match


def _here(
    maps: Mapping[ScanId, SegmentMap],
    pairs: Sequence[Pair],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
    check: Callable[[], None] | None,
) -> Iterator[tuple[Pair, Match]]:
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
) -> Iterator[tuple[Pair, Match]]:
    batches = list(_batches(pairs, BATCH))
    tasks = (delayed(_matched)(*_needed(maps, batch), parameters, heuristic, mode) for batch in batches)
    cluster: AbstractContextManager[object] = parallel_config("dask") if backend == "dask" else nullcontext()
    with cluster:
        parallel = Parallel(n_jobs=None if backend == "dask" else workers, return_as="generator", batch_size=1)
        results = parallel(tasks)
        try:
            for batch, matches in zip(batches, results, strict=True):
                if check is not None:
                    check()
                yield from zip(batch, matches, strict=True)
        finally:
            results.close()


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
