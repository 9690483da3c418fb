"""One scan more on a map that is there, while the robot moves (Sections IV and V-B, Table 4)."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from segmap.merging.bridging import Between, path
from segmap.merging.calls import Given, Link, Maker
from segmap.merging.methods import grown, integrated, linked, pivoted
from segmap.merging.nodes import MergeNode
from segmap.merging.sequences import Merge, how_to, merged
from segmap.parameters import Parameters
from segmap.scans import ScanId
from segmap.segments import SegmentMap

__all__ = ["extend"]


def extend(
    merge: Merge,
    scan: ScanId,
    segment_map: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    map_heuristic: str | None = None,
    given: Given | None = None,
    between: Mapping[ScanId, SegmentMap] | None = None,
    check: Callable[[], None] | None = None,
) -> Merge:
    """Add the next scan of a log to a merge, by its method; the other arguments are those it was made with.

    Sequential and pivot call INTEGRATE once, the tree once for each level: n - 1 times for the n-th scan. Where the
    scan before this one was not placed, or no valid integration holds the new one, a component begins. ``calls`` of
    the result are those of this scan alone.

    Raises: as :func:`segmap.merging.merge`.
    """
    how = how_to(parameters, heuristic, mode, map_heuristic)
    spare = (between or {}) if how.parameters.bridging else {}
    trees = [component.tree for component in merge.components if component.tree is not None]
    last = _last(trees, scan)
    known = {scan: segment_map, **({last.scan: last.map} if last else {})}
    maker = Maker(ChainMap({}, known, spare), how, given or {}, check)  # type: ignore[arg-type]
    old = next((tree for tree in trees if last and last.scan in tree.poses), None)
    larger = _extended(merge.method, maker, old, last, scan, Between(spare)) if old and last else None
    trees = [larger if larger and tree is old else tree for tree in trees]
    made = merged(merge.method, maker, trees if larger else [*trees, maker.leaf(scan)])
    return replace(made, closures=merge.closures)


def _last(trees: list[MergeNode], scan: ScanId) -> MergeNode | None:
    """The latest scan of the same log before this one, by itself."""
    before = [held for tree in trees for held in tree.scans if held.log == scan.log and held < scan]
    return next((found for tree in trees if before and (found := tree.leaf(max(before)))), None)


def _extended(
    method: str, maker: Maker, old: MergeNode, last: MergeNode, scan: ScanId, between: Between
) -> MergeNode | None:
    if method == "sequential":
        return grown(maker, old, scan, between)
    links = path(maker, (last.scan, scan), between)
    for link in links or []:
        old = _along_the_edge(maker, old, link) if method == "tree" else pivoted(maker, old, link)
    return old if links else None


def _along_the_edge(maker: Maker, old: MergeNode, link: Link) -> MergeNode:
    """The tree with one scan more: of each level the last map is integrated with the new one below it (IV-B)."""
    levels = list(_last_of_each_level(old))[::-1]
    if levels[0].scan != link.pair[0]:
        return pivoted(maker, old, link)  # joined otherwise: the scan before is not at the edge
    node = maker.joined(linked(maker, levels[0], link))
    for level in levels[1:]:
        node = integrated(maker, level, node) or node
    return node


def _last_of_each_level(tree: MergeNode) -> Iterator[MergeNode]:
    """The tree, then its second map, and so on down to the last scan."""
    yield tree
    while tree.step is not None:
        tree = tree.step.second
        yield tree
