"""Merging whole sequences: which pairs, by which method, with which decisions; and one scan more."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

from segmap.errors import ParameterError
from segmap.integration import Match, chosen_heuristic
from segmap.merging.bridging import Between
from segmap.merging.calls import Call, Given, How, Maker, Pair
from segmap.merging.closing import Closure, closed
from segmap.merging.components import Component
from segmap.merging.methods import pivot, sequential, tree
from segmap.merging.nodes import MergeNode, outline
from segmap.parameters import Parameters
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["METHODS", "Merge", "calls_needed", "how_to", "merge", "merged", "neighbours"]

_METHODS = {"sequential": sequential, "tree": tree, "pivot": pivot}
METHODS = tuple(_METHODS)
"""how a sequence of maps is merged (IV-A, IV-B, IV-C)"""


@dataclass(frozen=True, eq=False)
class Merge:
    """What a merging method made of sequences of maps."""

    method: str
    components: tuple[Component, ...]
    """each with the tree of its integrations"""
    calls: tuple[Call, ...]
    """every call of INTEGRATE, in order"""
    closures: tuple[Closure, ...] = ()
    """what integrations beyond the sequences say"""

    @property
    def matches(self) -> Mapping[Pair, Match]:
        """What calls of INTEGRATE on two scans found."""
        return {call.pair: call.match for call in self.calls if len(call.first) == len(call.second) == 1}

    def outline(self) -> dict[str, Any]:
        """The integrations as plain data for JSON: see :func:`segmap.merging.nodes.outline`."""
        trees = [component.tree for component in self.components if component.tree is not None]
        return {
            "method": self.method,
            "calls": len(self.calls),
            "nodes": outline(trees),
            "closures": [closure.outline() for closure in self.closures],
        }


class _Progress:
    """Counts what is done of a planned number of calls."""

    def __init__(self, total: int, tell: Callable[[int, int], None] | None) -> None:
        self._total, self._tell, self._done = total, tell, 0

    def step(self) -> None:
        """One more."""
        if self._done < self._total:
            self._done += 1
            if self._tell is not None:
                self._tell(self._done, self._total)


def merge(
    maps: Mapping[ScanId, SegmentMap],
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    method: str = "pivot",
    *,
    map_heuristic: str | None = None,
    given: Given | None = None,
    closing: Iterable[Pair] = (),
    between: Mapping[ScanId, SegmentMap] | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    check: Callable[[], None] | None = None,
) -> Merge:
    """Merge the maps of each log, in the order given (Section IV).

    An integration counts when its verdict is accepted; what cannot be integrated begins a new component.

    ``given`` holds poses or decisions by pair of scans, in place of calls of INTEGRATE; ``closing`` are pairs beyond
    the sequence to integrate in the end, as the last scan with the first, and so is each given pair that the sequence
    does not hold: they join components, or tell how well a loop closes. ``between`` are scans left out of the
    sequence: where a pair fails it is bridged through them, unless the parameter ``bridging`` is off.
    ``map_heuristic`` is taken where a partial map takes part; by default the heuristic itself, or the paper's
    ``consecutive`` where that is ``all``, as the angles of a partial map are too many. ``progress`` is told how
    many of how many planned calls are done; ``workers`` pairs of scans are matched at a time.

    Raises:
        ParameterError: there is no such method, heuristic or mode.
        CancelledError: raised by ``check``.
    """
    if method not in METHODS:
        raise ParameterError(f"There is no merging method {method!r}. Methods are: {', '.join(METHODS)}.")
    how = how_to(parameters, heuristic, mode, map_heuristic)
    spare = (between or {}) if how.parameters.bridging else {}
    maker = Maker(ChainMap({}, maps, spare), how, given or {}, check)  # type: ignore[arg-type]
    told = _Progress(calls_needed([len(scans) for scans in _sequences(maps)], method), progress).step
    if method != "sequential":
        maker.prepare(neighbours(maps), workers, told)
    run = _METHODS[method]
    trees = [
        node
        for scans in _sequences(maps)
        for node in run(maker, scans, Between(scan for scan in spare if scan not in maps), told)
    ]
    return merged(method, maker, trees, [*closing, *_not_neighbours(given or {}, maps)])


def merged(method: str, maker: Maker, trees: Sequence[MergeNode], closing: Iterable[Pair] = ()) -> Merge:
    """The merge of some trees after the integrations beyond their sequences."""
    trees, closures = closed(maker, trees, closing)
    components = tuple(
        Component(f"component {number}", node.scans, node.poses, node.map, node)
        for number, node in enumerate(trees, start=1)
    )
    return Merge(method, components, tuple(maker.calls), closures)


def how_to(parameters: Parameters | None, heuristic: str | None, mode: str, map_heuristic: str | None = None) -> How:
    """How INTEGRATE is to be called, defaults filled in.

    Raises:
        ParameterError: there is no such heuristic or mode.
    """
    chosen = chosen_heuristic(mode, heuristic)
    for_maps = chosen_heuristic(mode, map_heuristic or ("consecutive" if chosen == "all" else chosen))
    return How(parameters or Parameters(), chosen, for_maps, mode)


def calls_needed(sizes: Iterable[int], method: str) -> int:
    """How many times INTEGRATE is called on sequences of so many scans where everything succeeds and none is skipped.

    >>> calls_needed([29], "pivot"), calls_needed([29], "tree")
    (28, 406)
    """
    return sum(n * (n - 1) // 2 if method == "tree" else n - 1 for n in sizes if n)


def neighbours(scans: Iterable[ScanId]) -> Iterator[Pair]:
    """Each scan with the next one of its log."""
    return ((a, b) for a, b in pairwise(scans) if a.log == b.log)


def _sequences(scans: Iterable[ScanId]) -> Iterator[list[ScanId]]:
    """The scans of each log, in the order given; a log that is come back to begins again."""
    return (list(group) for _, group in groupby(scans, key=lambda scan: scan.log))


def _not_neighbours(given: Given, maps: Iterable[ScanId]) -> Iterator[Pair]:
    """The pairs decided on that no sequence holds."""
    held = {frozenset(pair) for pair in neighbours(maps)}
    return (pair for pair in given if frozenset(pair) not in held)
