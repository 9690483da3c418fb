"""Pose -> matching chains (Section III-C; Algorithm 4, lines 24 to 30)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from segmap import tracing
from segmap.evaluation import matching_values
from segmap.parameters import Parameters
from segmap.pose import IntArray, Pose2
from segmap.segments import SegmentMap

__all__ = ["MatchingChain", "components", "matching_chains"]


@dataclass(frozen=True)
class MatchingChain:
    """Pairs of matching segments, closed under "shares a segment with"."""

    pairs: tuple[tuple[int, int, float], ...]
    """segment of map 1, segment of map 2, matching value in metres; in index order"""

    @property
    def first(self) -> tuple[int, ...]:
        """The segments of map 1 in the chain, ascending."""
        return tuple(sorted({i for i, _, _ in self.pairs}))

    @property
    def second(self) -> tuple[int, ...]:
        """The segments of map 2 in the chain, ascending."""
        return tuple(sorted({j for _, j, _ in self.pairs}))

    @property
    def value(self) -> float:
        """What the chain adds to the value of the transformation, metres."""
        return sum(value for _, _, value in self.pairs)


def matching_chains(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters
) -> tuple[MatchingChain, ...]:
    """The matching chains of two maps under ``T_1_2``, by their lowest segment of map 1."""
    pairs, values = matching_values(map_1, map_2, T_1_2, parameters)
    chains: dict[int, list[tuple[int, int, float]]] = {}
    labels = components(pairs, len(map_1), len(map_2))
    tracing.tell("chains", T_1_2=T_1_2, pairs=pairs, values=values, labels=labels)
    for label, (i, j), value in zip(labels, pairs, values, strict=True):
        chains.setdefault(int(label), []).append((int(i), int(j), float(value)))
    return tuple(MatchingChain(tuple(chain)) for chain in chains.values())


def components(pairs: IntArray, n_1: int, n_2: int) -> IntArray:
    """The connected component of each pair, in the graph with the segments of both maps as nodes (union-find)."""
    parents = list(range(n_1 + n_2))

    def root(node: int) -> int:
        while parents[node] != node:
            parents[node] = node = parents[parents[node]]
        return node

    for i, j in pairs.tolist():
        parents[root(n_1 + j)] = root(i)
    return np.array([root(i) for i in pairs[:, 0].tolist()], dtype=np.int64)
