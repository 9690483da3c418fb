"""Where a graph comes apart: bridges, and the fewest edges that hold two parts together."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from typing import TypeAlias

from segmap.graph.edges import Parts

__all__ = ["bridges", "smallest_cut"]

Links: TypeAlias = Sequence[tuple[int, int]]
"""the two nodes of each edge; nodes are numbered from 0, and two edges may join the same nodes"""


def bridges(links: Links, count: int) -> list[int]:
    """The edges whose loss splits the part of the graph they are in, ascending.

    >>> bridges([(0, 1), (1, 2), (2, 0), (2, 3), (3, 4), (3, 4)], 5)
    [3]
    """
    neighbours = _neighbours(links, count)
    met, low = [-1] * count, [0] * count
    found: list[int] = []
    for root in range(count):
        if met[root] < 0:
            _walk(root, neighbours, met, low, found)
    return sorted(found)


def _walk(root: int, neighbours: list[list[tuple[int, int]]], met: list[int], low: list[int], found: list[int]) -> None:
    """Depth first; ``low`` is the earliest node reached from below without the edge one came by."""
    met[root] = low[root] = max(met) + 1
    clock, path = met[root], [(root, -1, iter(neighbours[root]))]
    while path:
        here, came_by, rest = path[-1]
        for there, edge in rest:
            if met[there] < 0:
                clock += 1
                met[there] = low[there] = clock
                path.append((there, edge, iter(neighbours[there])))
                break
            if edge != came_by:
                low[here] = min(low[here], met[there])
        else:
            path.pop()
            if path:
                above = path[-1][0]
                low[above] = min(low[above], low[here])
                if low[here] > met[above]:
                    found.append(came_by)


def _neighbours(links: Links, count: int) -> list[list[tuple[int, int]]]:
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for edge, (a, b) in enumerate(links):
        neighbours[a].append((b, edge))
        neighbours[b].append((a, edge))
    return neighbours


def smallest_cut(links: Links, count: int) -> set[int]:
    """The smaller side of a cut of as few edges as possible, of a graph that hangs together; of one node: empty.

    Nagamochi and Ibaraki, "Computing edge-connectivity in multigraphs and capacitated graphs" (1992): each
    sweep finds pairs of nodes that no smaller cut than the best so far can separate, and they become one.

    >>> smallest_cut([(0, 1), (0, 1), (0, 1), (1, 2), (1, 2), (2, 3), (2, 3), (2, 3)], 4)
    {0, 1}
    """
    graph = _Contracted(links, count)
    fewest, side = len(links) + 1, set[int]()
    while len(graph.weights) > 1:
        node = min(graph.weights, key=lambda node: (graph.degree(node), node))
        if graph.degree(node) < fewest:
            fewest, side = graph.degree(node), set(graph.members[node])
        for a, b in graph.inseparable(fewest):
            graph.merge(a, b)
    return min(side, set(range(count)) - side, key=lambda part: (len(part), sorted(part))) if side else side


class _Contracted:
    """A graph in which some nodes have become one, named by the lowest of them."""

    def __init__(self, links: Links, count: int) -> None:
        self.weights: dict[int, dict[int, int]] = {node: {} for node in range(count)}
        self.members = {node: [node] for node in range(count)}
        self._parts = Parts(count)
        for a, b in links:
            self._link(a, b, 1)

    def _link(self, a: int, b: int, weight: int) -> None:
        self.weights[a][b] = self.weights[b][a] = self.weights[a].get(b, 0) + weight

    def degree(self, node: int) -> int:
        return sum(self.weights[node].values())

    def inseparable(self, fewest: int) -> list[tuple[int, int]]:
        """Pairs that at least ``fewest`` ways without a common edge join: a sweep, most links to what was met first."""
        held, done, waiting = {0: 0}, set[int](), [(0, 0)]
        pairs = []
        while waiting:
            _, here = heapq.heappop(waiting)
            if here in done:
                continue
            done.add(here)
            for there, weight in self.weights[here].items():
                if there not in done:
                    held[there] = held.get(there, 0) + weight
                    heapq.heappush(waiting, (-held[there], there))
                    if held[there] >= fewest:
                        pairs.append((here, there))
        return pairs

    def merge(self, a: int, b: int) -> None:
        """Make one node of those that hold a and b."""
        a, b = sorted((self._parts.of(a), self._parts.of(b)))
        if not self._parts.join(a, b):
            return
        self.members[a] += self.members.pop(b)
        for there, weight in self.weights.pop(b).items():
            del self.weights[there][b]
            if there != a:
                self._link(a, there, weight)
