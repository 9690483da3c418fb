"""Bridges and cuts against trying everything."""

from __future__ import annotations

from itertools import combinations

import pytest
from graphs import COVARIANCE, ring, with_wrong
from hypothesis import given
from hypothesis import strategies as st

from segmap.graph import Edge, components, optimise, strength
from segmap.graph.cuts import bridges, smallest_cut
from segmap.pose import Pose2
from segmap.scans import ScanId

NODES = 7
LINKS = st.lists(st.sampled_from(list(combinations(range(NODES), 2))))
TREES = st.tuples(*(st.integers(0, node - 1) for node in range(1, NODES)))
"""a node before it for every node but the first"""


def parts(links: list[tuple[int, int]], count: int) -> int:
    """How many parts a graph has, by flooding."""
    left, found = set(range(count)), 0
    while left:
        found += 1
        waiting = [left.pop()]
        while waiting:
            here = waiting.pop()
            near = {b if a == here else a for a, b in links if here in (a, b)} & left
            left -= near
            waiting += near
    return found


def crossing(links: list[tuple[int, int]], side: set[int]) -> int:
    return sum((a in side) != (b in side) for a, b in links)


@given(LINKS)
def test_bridges_are_what_splits_a_part(links):
    """An edge is a bridge exactly if the graph has more parts without it."""
    whole = parts(links, NODES)
    expected = [i for i in range(len(links)) if parts(links[:i] + links[i + 1 :], NODES) > whole]
    assert bridges(links, NODES) == expected


@given(LINKS, TREES)
def test_the_smallest_cut_is_the_smallest_of_all(links, tree):
    """No way of dividing the nodes cuts fewer edges."""
    links = [*links, *((below, node) for node, below in enumerate(tree, start=1))]
    sides = [set(side) for size in range(1, NODES) for side in combinations(range(NODES), size)]
    found = smallest_cut(links, NODES)
    assert crossing(links, found) == min(crossing(links, side) for side in sides)
    assert 0 < len(found) <= NODES // 2


def test_cuts_of_hardly_any_graph():
    """A node alone has nothing to cut, two nodes have one side each; long chains do not exhaust the stack."""
    assert smallest_cut([], 1) == set()
    assert smallest_cut([(0, 1)], 2) == {0}
    chain = [(i, i + 1) for i in range(5000)]
    assert bridges(chain, 5001) == list(range(5000))
    assert len(smallest_cut(chain, 5001)) == 1


def test_strength_in_scans_and_edges():
    """Two rings held by one edge, and a scan that hangs on: bridge, hanging scan, cut and what it cuts off are told."""
    (_, left), (_, right) = ring(12), ring(10, log=1)
    bridge = Edge(ScanId(0, 11), ScanId(1, 3), Pose2(4.0, 0.0, 1.0), COVARIANCE)
    tail = Edge(ScanId(1, 9), ScanId(1, 10), Pose2(1.0, 0.0, 0.0), COVARIANCE)
    (told,) = strength(optimise([*left, *right, bridge, tail]))
    assert told.bridges == (bridge, tail)
    assert told.hanging == (ScanId(1, 10),)
    assert told.cut == (tail,)
    assert told.cut_off == (ScanId(1, 10),)
    assert told.edges == len(left) + len(right) + 2
    assert len(told.scans) == 23
    assert told.softest.log == 1
    assert told.deviation > 0.0


def test_silenced_edges_hold_nothing():
    """The strength of a graph with wrong closures is that of the clean one."""
    _, edges = ring(30)
    clean, mixed = (strength(optimise(those))[0] for those in (edges, with_wrong(edges, 0.3, "random")))
    assert (mixed.edges, mixed.cut, mixed.bridges) == (clean.edges, clean.cut, clean.bridges)
    assert mixed.deviation == pytest.approx(clean.deviation, rel=1e-3)


def test_every_component_is_told_of():
    """Components come in their order; no edges, no components."""
    edges = [*ring(6)[1], *ring(8, log=1)[1]]
    result = optimise(edges)
    assert [one.scans for one in strength(result)] == list(components(edges))
    assert strength(optimise([])) == ()
