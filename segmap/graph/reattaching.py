"""Parts that silencing would cut off are put where most of the silenced edges across the cut agree.

Of the edges across a cut one costs nothing, as nothing else holds the part; the truncated loss is smaller
with it than without any.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from segmap.graph.arrays import EdgeArrays, composed, inverted
from segmap.pose import FloatArray, IntArray

__all__ = ["reattached"]

WITNESSES = 64
"""edges across one cut that are asked where the part belongs"""
FEW = 6
"""parts; while there are more, nobody is asked"""


def reattached(edges: EdgeArrays, poses: FloatArray, weights: FloatArray, gate: float) -> FloatArray:
    """Poses (n, 3) with cut off parts put back; the edge that holds each counts again in ``weights`` (m,)."""
    labels = _parts(edges, weights, len(poses))
    while (across := np.flatnonzero(labels[edges.first] != labels[edges.second])).size:
        place, motion = _best(edges, poses, labels, across, gate)
        weights[place] = 1.0
        kept, gone = labels[edges.first[place]], labels[edges.second[place]]
        if gone == labels[0]:
            kept, gone, motion = gone, kept, inverted(motion)
        poses = np.where((labels == gone)[:, None], composed(motion, poses), poses)
        labels[labels == gone] = kept
    return poses


def _parts(edges: EdgeArrays, weights: FloatArray, count: int) -> IntArray:
    alive = weights > 0.0
    links = coo_array((np.ones(alive.sum()), (edges.first[alive], edges.second[alive])), shape=(count, count))
    return connected_components(links, directed=False)[1].astype(np.int64)


def _best(
    edges: EdgeArrays, poses: FloatArray, labels: IntArray, across: IntArray, gate: float
) -> tuple[int, FloatArray]:
    """The edge across a cut that most others of the same cut agree with, and the motion (3,) of its second part.

    Where much is in pieces, that is the edge least far off: the pieces will be looked at again.
    """
    if len(np.unique(labels)) > FEW:
        place = int(across[np.argmin(edges.squares(poses)[across])])
        return place, _motions(edges, poses, np.array([place]))[0]
    low, high = (pick(labels[edges.first[across]], labels[edges.second[across]]) for pick in (np.minimum, np.maximum))
    cuts = low * len(poses) + high
    votes = [vote for cut in np.unique(cuts) for vote in _votes(edges, poses, labels, across[cuts == cut], gate)]
    _, _, place = min(votes)
    return place, _motions(edges, poses, np.array([place]))[0]


def _votes(
    edges: EdgeArrays, poses: FloatArray, labels: IntArray, across: IntArray, gate: float
) -> list[tuple[int, float, int]]:
    """Of the edges across one cut: minus how many agree with each, how far off it is now, and its number."""
    squared = edges.squares(poses)[across]
    asked = np.argsort(squared, kind="stable")[:WITNESSES]
    those = edges.subset(across)
    second = labels == labels[those.second[0]]
    motions = _motions(edges, poses, across[asked])
    votes = []
    for i, motion, forward in zip(asked, motions, second[those.second[asked]], strict=True):
        moved = np.where((second if forward else ~second)[:, None], composed(motion, poses), poses)
        agreed = int((those.squares(moved) <= gate**2).sum())
        votes.append((-agreed, float(squared[i]), int(across[i])))
    return votes


def _motions(edges: EdgeArrays, poses: FloatArray, chosen: IntArray) -> FloatArray:
    """The motions (k, 3) of the world that put the second scans of edges exactly where these say."""
    wanted = composed(poses[edges.first[chosen]], edges.measured[chosen])
    return composed(wanted, inverted(poses[edges.second[chosen]]))
