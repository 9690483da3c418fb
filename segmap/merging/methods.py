"""The sequential, the tree and the pivot method (Section IV), each for one sequence of scans.

``told`` is called when one of the planned calls of INTEGRATE is done. A sequence splits where no valid integration
joins what follows to what came before: each method yields the trees of its parts, in order. Nothing is ever placed
without evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from segmap.merging.bridging import Between, path
from segmap.merging.calls import Link, Maker, valid_pose
from segmap.merging.nodes import Flag, MergeNode, MergeStep
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId

__all__ = ["grown", "integrated", "linked", "pivot", "pivoted", "sequential", "tree"]

Told = Callable[[], None]


# --- sequential (IV-A) ----------------------------------------------------------------------------


def sequential(maker: Maker, scans: Sequence[ScanId], between: Between, told: Told) -> Iterator[MergeNode]:
    """S_1 with S_2, S_1,2 with S_3, and so on: n - 1 calls."""
    node = maker.leaf(scans[0])
    for scan in scans[1:]:
        larger = grown(maker, node, scan, between)
        told()
        if larger is None:
            yield node
        node = larger or maker.leaf(scan)
    yield node


def grown(maker: Maker, node: MergeNode, scan: ScanId, between: Between) -> MergeNode | None:
    """A map with one more scan, or through scans in between with some more; None where nothing valid holds it."""
    step = _grown_step(maker, node, scan)
    if step is not None:
        return maker.joined(step)
    last = node.scans[-1]
    middle = None if maker.decided(last, scan) else between.half_way(last, scan)
    half = grown(maker, node, middle, between) if middle else None
    whole = grown(maker, _flagged(half, Flag.BRIDGED), scan, between) if half else None
    return _flagged(whole, Flag.BRIDGED) if whole else None


def _grown_step(maker: Maker, node: MergeNode, scan: ScanId) -> MergeStep | None:
    last = node.scans[-1]
    if maker.decided(last, scan) or len(node.scans) == 1:
        link = maker.link(last, scan)
        return linked(maker, node, link) if link else None
    match = maker.match(node, maker.leaf(scan))
    T_1_2 = valid_pose(match)
    return MergeStep(node, maker.leaf(scan), T_1_2, (node.scan, scan), match) if T_1_2 else None


def linked(maker: Maker, node: MergeNode, link: Link) -> MergeStep:
    """A scan joined to a map by the pose it has in the frame of one of the map's scans."""
    a, b = link.pair
    return MergeStep(node, maker.leaf(b), node.poses[a] @ link.T_a_b, link.pair, link.match, link.flags)


def _flagged(node: MergeNode, flag: Flag) -> MergeNode:
    """The same node, its integration with one more flag."""
    step = node.step
    if step is None:
        return node
    marked = MergeStep(step.first, step.second, step.T_1_2, step.pair, step.match, step.flags | {flag}, step.remarks)
    return MergeNode(node.scans, node.poses, node.map, marked)


# --- what pivot and tree begin with: neighbours, pair by pair -------------------------------------


def _parts(
    maker: Maker, scans: Sequence[ScanId], between: Between, told: Told
) -> Iterator[tuple[MergeNode, list[Link]]]:
    """The first scan of each part a sequence splits into, and the links that follow from it."""
    first, links = scans[0], list[Link]()
    for a, b in pairwise(scans):
        found = path(maker, (a, b), between)
        told()
        if found is None:
            yield maker.leaf(first), links
            first, links = b, []
        else:
            links += found
    yield maker.leaf(first), links


# --- pivot (IV-C, Algorithm 6) --------------------------------------------------------------------


def pivot(maker: Maker, scans: Sequence[ScanId], between: Between, told: Told) -> Iterator[MergeNode]:
    """Neighbours are integrated, their poses composed, each scan fused once: n - 1 calls."""
    for node, links in _parts(maker, scans, between, told):
        for link in links:
            node = pivoted(maker, node, link)
        yield node


def pivoted(maker: Maker, node: MergeNode, link: Link) -> MergeNode:
    """S_1,2,...,i of S_1,2,...,i-1 and the integration of S_i-1 with S_i (lines 4 to 6)."""
    if maker.parameters.pivot_form == "scan" or len(node.scans) == 1:
        return maker.joined(linked(maker, node, link))
    a, _ = link.pair
    pair = maker.joined(linked(maker, maker.leaf(a), link))
    return maker.joined(MergeStep(node, pair, node.poses[a], (a, a), None, frozenset({Flag.PIVOT})))


# --- tree (IV-B) ----------------------------------------------------------------------------------


def tree(maker: Maker, scans: Sequence[ScanId], between: Between, told: Told) -> Iterator[MergeNode]:
    """Neighbours are integrated, their maps again, and so on to the one map: n (n - 1) / 2 calls."""
    for first, links in _parts(maker, scans, between, told):
        nodes = [maker.joined(linked(maker, maker.leaf(link.pair[0]), link)) for link in links] or [first]
        level = 1
        while len(nodes) > 1:
            nodes = list(_next_level(maker, nodes, level, told))
            level += 1
        yield nodes[0]


def _next_level(maker: Maker, nodes: list[MergeNode], level: int, told: Told) -> Iterator[MergeNode]:
    """S_i with S_i+1 for each i; where the skip heuristic applies S_i with S_i+2 in place of two, if that is valid."""
    skip = maker.parameters.tree_skip and level >= maker.parameters.tree_skip_level
    i = 0
    while i + 1 < len(nodes):
        over = integrated(maker, nodes[i], nodes[i + 2], or_shared=False) if skip and i + 2 < len(nodes) else None
        yield _flagged(over, Flag.SKIPPED) if over else _certain(maker, nodes[i], nodes[i + 1])
        told()
        i += 2 if over else 1


def _certain(maker: Maker, first: MergeNode, second: MergeNode) -> MergeNode:
    """Neighbours of a level, which hold a scan in common and so are always joined."""
    node = integrated(maker, first, second)
    assert node is not None, "neighbours of a level share a scan"
    return node


def integrated(maker: Maker, first: MergeNode, second: MergeNode, *, or_shared: bool = True) -> MergeNode | None:
    """Two maps of scans in common as one; the pose of such a scan is there to compare with, and to fall back on.

    Where INTEGRATE finds another pose that of the scan is taken: it is the same scan in both maps. That, and falling
    back on it, is for review.
    """
    match = maker.match(first, second)
    found, shared = valid_pose(match), _shared_pose(first, second)
    sure = found is not None and (shared is None or _same(found, shared, maker.parameters))
    T_1_2 = found if sure else shared
    if T_1_2 is None or not (sure or or_shared):
        return None
    flags, remarks = ((), ()) if sure else _doubt(found, T_1_2)
    pair = (first.scan, second.scan)
    return maker.joined(MergeStep(first, second, T_1_2, pair, match, frozenset(flags), remarks))


def _doubt(found: Pose2 | None, shared: Pose2) -> tuple[tuple[Flag, ...], tuple[str, ...]]:
    if found is None:
        return (Flag.SHARED,), ("INTEGRATE found no valid pose; the scan in both maps places them.",)
    metres, radians = found.distance(shared)
    remark = f"The scan in both maps places them {metres:.2f} m and {radians:.2f} rad from what INTEGRATE found."
    return (Flag.SHARED, Flag.DISAGREES), (remark,)


def _same(T: Pose2, other: Pose2, parameters: Parameters) -> bool:
    """Whether two poses are one, as rivals are told apart."""
    metres, radians = T.distance(other)
    return metres < parameters.rival_distance and radians < parameters.rival_angle


def _shared_pose(first: MergeNode, second: MergeNode) -> Pose2 | None:
    """Pose of the second map in the first by the middle one of the scans that both hold; None where there is none."""
    shared = [scan for scan in first.scans if scan in second.poses]
    if not shared:
        return None
    scan = shared[len(shared) // 2]
    return first.poses[scan] @ second.poses[scan].inverse()
