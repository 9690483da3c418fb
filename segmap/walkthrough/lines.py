"""The algorithms as numbered lines, in our own words; the numbers of 2 to 6 are those of the paper."""

from __future__ import annotations

from dataclasses import dataclass

from segmap.walkthrough.steps import Line

__all__ = ["ALGORITHMS", "Algorithm"]


@dataclass(frozen=True)
class Algorithm:
    """A title, and the lines."""

    title: str
    lines: tuple[Line, ...]


def _lines(text: str) -> tuple[Line, ...]:
    """Lines of ``number | words``; two blanks before the words for each level of indentation."""
    rows = (row.partition("|") for row in text.strip().splitlines())
    return tuple(
        Line(number.strip(), words.strip(), (len(words) - len(words.lstrip()) - 1) // 2) for number, _, words in rows
    )


ALGORITHMS = {
    "points": Algorithm(
        "From points to segments (Section III-D)",
        _lines(
            """
1 | take the points of the scan in the order of the beams
2 | begin a new cluster wherever two neighbours lie farther apart than cluster_distance
3 | for each cluster: join its first and its last point by one line
4 |   look for the point that lies farthest from the line that stands for it
5 |   farther than split_tolerance? bend the line there, and look again
6 |   otherwise each straight piece is a segment
"""
        ),
    ),
    "2": Algorithm(
        "Find candidates (Algorithm 2)",
        _lines(
            """
1 | start with an empty list of angles of map 1
2 | for each pair of segments of map 1 that the heuristic lets through
3 |   keep the angle between the two
4 | (next pair)
5 | start with an empty list of angles of map 2
6 | for each pair of segments of map 2 that the heuristic lets through
7 |   keep the angle between the two
8 | (next pair)
9 | start with an empty list of candidates
10 | for each angle of map 1 with each angle of map 2
11 |   are the two angles equal, within angle_difference_tolerance?
12 |   then the motion that lays the one on the other is a candidate
13 |   (otherwise: nothing)
14 | (next two angles)
"""
        ),
    ),
    "3": Algorithm(
        "Find candidates by drawing lots (Algorithm 3)",
        _lines(
            """
1 | start with an empty list of candidates
2 | for each round k: let shorter segments take part than in the round before
3 |   20 times 2 to the power k, in round k
4 |     draw two segments of map 1 from those that take part
5 |     take the angle between them
6 |     draw two segments of map 2 from those that take part
7 |     take the angle between them
8 |     are the two angles equal?
9 |     then the motion that lays the one on the other is a candidate
10 |     (otherwise: the draw was in vain)
11 |   (next draw)
12 | (next round)
"""
        ),
    ),
    "laid": Algorithm(
        "Find candidates from single segments (beyond the paper)",
        _lines(
            """
1 | first round: for each segment of map 1 with each segment of map 2
2 |   turn map 2 until both segments have one heading
3 |   lay start on start, end on end, middle on middle: three candidates
4 | second round, if it is not clear yet which is right: lay equal angles on each other as well
"""
        ),
    ),
    "4": Algorithm(
        "Evaluate the candidates (Algorithm 4)",
        _lines(
            """
1 | the best value so far is 0
2 | for each candidate
3 |   move map 2 as the candidate says
4 |   the value of this candidate is 0 to begin with
5 |   for each pair of a segment of map 1 and a segment of map 2
6 |     do they cross, both longer than segment_length_refuse, at more than refuse_angle?
7 |     then discard this candidate: go on with the next one
8 |     (otherwise: go on with this pair)
9 |     is their distance larger than segment_distance_threshold (5 by default) tolerances?
10 |     then this pair adds nothing: go on with the next pair
11 |     (otherwise: they may be the same wall)
12 |     project each segment on the line of the other
13 |     measure how much of each the other covers: l1 and l2
14 |     matching value: the mean of l1 and l2
15 |     do the two not touch?
16 |     then multiply it by distance_penalty (0.95 by default) to the power of distance / tolerance
17 |     (otherwise: it counts in full)
18 |     add the matching value to the value of the candidate
19 |   (next pair)
20 |   is the value higher than the best so far?
21 |   then this candidate is the best so far
22 |   (otherwise: it is not)
23 | (next candidate)
24 | under the best candidate, for each pair of segments that match
25 |   does one of the two belong to a chain already?
26 |   then the pair joins that chain; a pair that links two chains makes them one
27 |   otherwise
28 |   the pair begins a new chain
29 |   (done with this pair)
30 | (next pair)
"""
        ),
    ),
    "5": Algorithm(
        "Fuse the two maps (Algorithm 5)",
        _lines(
            """
1 | begin with an empty map
2 | put in every segment that matches nothing, as it is
3 | for each chain
4 |   P0: one line between the two ends of the chain that are farthest apart
5 |   find the segment that lies farthest from its closest edge of the polyline (greedy: of those not used yet)
6 |   n = 0
7 |   while that distance is larger than fusion_tolerance (greedy: and not every segment is used)
8 |     n = n + 1
9 |     Pn: replace that edge by a detour through the segment, which is now used
10 |     find the segment that now lies farthest from its closest edge (greedy: of those not used yet)
11 |   (look again)
12 |   put the polyline in, in place of the segments of the chain
13 | (next chain)
"""
        ),
    ),
    "6": Algorithm(
        "Merge a sequence of scans by pivots (Algorithm 6)",
        _lines(
            """
1 | integrate scans 1 and 2, and remember how 2 lies on 1
2 | for each further scan i
3 |   integrate it with the scan before it, and remember how it lies there
4 |   compose the motions: how scan i lies on scan 1
5 |   move scan i there
6 |   fuse it with the map so far
7 | (next scan)
"""
        ),
    ),
    "sequential": Algorithm(
        "Merge a sequence of scans one by one (Section IV-A)",
        _lines(
            """
1 | begin with the map of the first scan
2 | for each further scan
3 |   integrate it with the whole map so far
4 |   the fused map is the map so far
"""
        ),
    ),
    "tree": Algorithm(
        "Merge a sequence of scans by a tree (Section IV-B)",
        _lines(
            """
1 | integrate each scan with the next one: the first level
2 | while more than one map is left
3 |   integrate each map with the next one: they have all but two scans in common
4 |   the fused maps are the next level
"""
        ),
    ),
    "methods": Algorithm(
        "Merge a sequence of scans: the three methods (Section IV)",
        _lines(
            """
A | sequential: integrate each new scan with the whole map so far; n - 1 integrations
B | tree: integrate neighbours, then the results with their neighbours, and so on; n (n - 1) / 2 integrations
C | pivot: integrate neighbours, compose the motions, fuse each scan once; n - 1 integrations
"""
        ),
    ),
    "verified": Algorithm(
        "Verify by lines of sight (beyond the paper)",
        _lines(
            """
1 | under each candidate, ask for each point of one scan what the other sensor saw of that place
2 |   it saw a surface there: supported
3 |   in front of a surface, in space its beam passed through: contradicted
4 |   close behind a surface (less than shadow_depth): shadowed
5 |   where it could not look: unseen
6 | score = supported - conflict_weight x contradicted - shadow_weight x shadowed - unseen_weight x unseen (metres)
7 | of candidates close to each other keep the best; move each so that the points fit better
8 | score again; the best is judged, and how close its rivals come
"""
        ),
    ),
    "graph": Algorithm(
        "Make all integrations fit together (the pose graph, beyond the paper)",
        _lines(
            """
1 | every integration says where one scan lies from another: an edge
2 | place the scans along the surest edges
3 | move all scans a little, so that the squares of what is left over become less
4 |   an edge that contradicts the others counts less from round to round
5 | until nothing moves and each edge counts fully or not at all
"""
        ),
    ),
    "result": Algorithm(
        "Integrate two maps (Algorithm 1)",
        _lines(
            """
1 | find the candidates
2 | evaluate them; the best is the transformation
3 | move map 2 by it, and fuse the two maps
"""
        ),
    ),
}
"""by key"""
