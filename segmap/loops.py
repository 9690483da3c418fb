"""Loop closures: which pairs of scans are worth matching, and which of their matches close a loop.

Where accepted integrations already say roughly how two scans lie, a closure must lie there too: the farther it
is around the loop, the wider the gate. Where nothing is known, as between components, only several closures
that agree are believed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from segmap.integration import Match, Verdict
from segmap.links import FLOOR, PACED_LEAD, Link, Pace, confidence_among, steps_between
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.refinement import refined
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Pair
from segmap.visibility import evidence, look, sighting, thinned

__all__ = [
    "LEAST_AGREEMENT",
    "Gate",
    "Promise",
    "Scene",
    "across",
    "agreement",
    "borne_out",
    "closure",
    "in_pace",
    "promising",
    "proposals",
]

REACH = 6.0
"""metres between sensors; scans farther apart share too little to refine a map"""
LEAST_OVERLAP = 0.35
"""share of what two scans see that both should see, for the pair to be worth matching"""
MOST_PER_SCAN = 8
"""closures that are looked for at each scan"""
RETURNS = 60
"""returns of each scan that say how much two scans should share"""
DRIFT = 0.03, math.radians(0.2)
"""metres and radians that a chain of integrations may be off for each metre around the loop"""
SLACK = 0.5, math.radians(5.0)
"""metres and radians that are allowed from the start"""
SURE = 0.9
"""a candidate that a person would have to decide on counts where it lies in the gate, with this confidence there"""
AGREE = 0.5, math.radians(6.0)
"""metres and radians; closures between two components that agree to this say the same"""
LEAST_SHARED = 0.5
"""share of what two scans of different components should both see, for the pair to be asked"""
MOST_ASKED = 16
"""pairs that are asked whether two components lie as proposed"""
JUDGED_REACH, MOST_JUDGED = 8.0, 300
"""metres between scans that judge how two components lie, and at most how many pairs do"""
LEAST_AGREEMENT = 0.65
"""of what they judge so much must be supported: right joins of five logs have 0.70 or more, a wrong one 0.57"""
SETTLING_STEPS, SETTLING_GATES = 4, (0.4, 0.1)
"""steps of refinement of each such pair, and the gates in metres it begins and ends with"""
JOINING_WAY = 15.0
"""metres; such pairs may be off as at the end of a way so long"""
LEAST_AGREEING, LEAST_SHARE = 3, 0.5
"""closures that must agree for two components to be joined, and the share of the pairs asked that must give one"""


@dataclass(frozen=True)
class Gate:
    """Where a closure may lie: around a pose, as far as the way around the loop is long."""

    T_1_2: Pose2
    around: float
    """metres"""

    def allows(self, T_1_2: Pose2) -> bool:
        """Whether a candidate lies in the gate."""
        distance, turn = self.T_1_2.distance(T_1_2)
        return distance <= SLACK[0] + DRIFT[0] * self.around and turn <= SLACK[1] + DRIFT[1] * self.around


@dataclass(frozen=True)
class Promise:
    """A pair that should see the same place."""

    pair: Pair
    overlap: float
    """share of what they see that both should see"""
    gate: Gate


class Scene:
    """Scans where a graph puts them, with what each saw."""

    def __init__(self, maps: Mapping[ScanId, SegmentMap], scans: Sequence[ScanId], parameters: Parameters) -> None:
        self.parameters = parameters
        self.scans = tuple(scans)
        self._seen = {scan: thinned(seen, RETURNS) for scan in scans if (seen := sighting(maps[scan])) is not None}

    def overlap(self, pair: Pair, T_1_2: Pose2) -> float:
        """The share of what two scans see that both should see at a pose; 0 where one saw nothing."""
        seen_1, seen_2 = (self._seen.get(scan) for scan in pair)
        if seen_1 is None or seen_2 is None:
            return 0.0
        return evidence(look(seen_1, seen_2, np.array([tuple(T_1_2)]), self.parameters)[0]).overlap

    def settled(self, first: ScanId, second: ScanId, T_1_2: Pose2) -> FloatArray:
        """Metres supported, contradicted, shadowed and unseen once two scans have been drawn together, (4,)."""
        seen_1, seen_2 = self._seen.get(first), self._seen.get(second)
        if seen_1 is None or seen_2 is None:
            return np.zeros(4)
        pose = refined(seen_1, seen_2, np.array([tuple(T_1_2)]), SETTLING_STEPS, *SETTLING_GATES)
        totals: FloatArray = look(seen_1, seen_2, pose, self.parameters)[0]
        return totals


def promising(
    scene: Scene,
    poses: Mapping[ScanId, Pose2],
    parts: Sequence[Sequence[ScanId]],
    links: Iterable[Link],
    tried: set[Pair],
) -> list[Promise]:
    """The pairs of scans worth matching, most promising first: those that should see the same place.

    Of pairs next to each other one is taken, and of each scan not more than a few. ``parts`` are the components
    the poses belong to; what was ``tried`` is left out.
    """
    around = _ways(scene.scans, links)
    place = {scan: i for i, scan in enumerate(scene.scans)}
    found: list[Promise] = []
    for part in parts:
        members = [scan for scan in part if scan in place]
        for a, b in _near(members, poses):
            pair = (a, b) if a < b else (b, a)
            T_1_2 = poses[pair[0]].inverse() @ poses[pair[1]]
            if pair not in tried and (overlap := scene.overlap(pair, T_1_2)) >= LEAST_OVERLAP:
                found.append(Promise(pair, overlap, Gate(T_1_2, float(around[place[pair[0]], place[pair[1]]]))))
    found.sort(key=lambda promise: (-promise.overlap, promise.pair))
    return list(_spaced(found, place))


def _ways(scans: Sequence[ScanId], links: Iterable[Link]) -> FloatArray:
    """The shortest way between scans along links, metres, (n, n)."""
    place = {scan: i for i, scan in enumerate(scans)}
    those = [link for link in links if link.first in place and link.second in place]
    rows = [place[link.first] for link in those]
    columns = [place[link.second] for link in those]
    lengths = [math.hypot(link.T_1_2.x, link.T_1_2.y) + FLOOR[0] for link in those]
    graph = csr_matrix((lengths, (rows, columns)), shape=(len(scans), len(scans)))
    ways: FloatArray = dijkstra(graph, directed=False)
    return ways


def _near(members: Sequence[ScanId], poses: Mapping[ScanId, Pose2]) -> Iterator[Pair]:
    """Pairs of scans within reach of each other."""
    places = np.array([(poses[scan].x, poses[scan].y) for scan in members]).reshape(-1, 2)
    for i in range(len(members)):
        near = np.hypot(*(places[i + 1 :] - places[i]).T) <= REACH
        yield from ((members[i], members[i + 1 + int(j)]) for j in np.flatnonzero(near))


def _spaced(promises: Iterable[Promise], place: Mapping[ScanId, int]) -> Iterator[Promise]:
    """Those not beside one that was taken, and not too many of a scan."""
    taken: set[tuple[int, int]] = set()
    count: dict[ScanId, int] = {}
    for promise in promises:
        a, b = promise.pair
        i, j = place[a], place[b]
        if any((i + di, j + dj) in taken for di in (-1, 0, 1) for dj in (-1, 0, 1)):
            continue
        if max(count.get(a, 0), count.get(b, 0)) < MOST_PER_SCAN:
            taken.add((i, j))
            count[a], count[b] = count.get(a, 0) + 1, count.get(b, 0) + 1
            yield promise


def closure(promise: Promise, match: Match) -> Link | None:
    """The closure a match gives, if it lies in the gate: accepted, or the only one there that is likely."""
    within = [(rank, c) for rank, c in enumerate(match.ranked) if promise.gate.allows(c.T_1_2)]
    if not within:
        return None
    rank = within[0][0]
    if match.verdict is Verdict.ACCEPTED:
        return Link.of(promise.pair, match, 0, "closed") if rank == 0 else None
    scores = [c.score or 0.0 for _, c in within]
    ahead = len(scores) == 1 or scores[0] - scores[1] >= PACED_LEAD * scores[0]
    if ahead and confidence_among([c for _, c in within]) >= SURE:
        return Link.of(promise.pair, match, rank, "closed")
    return None


# --- components -----------------------------------------------------------------------------------


def proposals(
    poses: Mapping[ScanId, Pose2], part: Sequence[ScanId], other: Sequence[ScanId], matches: Mapping[Pair, Match]
) -> list[Pose2]:
    """How two components may lie, as accepted matches between them say, what most say first: ``T_part_other``."""
    mine, theirs = set(part), set(other)
    said: list[Pose2] = []
    for (a, b), match in sorted(matches.items()):
        if match.verdict is not Verdict.ACCEPTED or match.T_1_2 is None:
            continue
        if a in mine and b in theirs:
            said.append(poses[a] @ match.T_1_2 @ poses[b].inverse())
        elif a in theirs and b in mine:
            said.append(poses[b] @ match.T_1_2.inverse() @ poses[a].inverse())
    groups: list[tuple[int, Pose2]] = []
    for T in said:
        if not any(_agree(T, centre) for _, centre in groups):
            groups.append((sum(_agree(T, one) for one in said), T))
    return [T for _, T in sorted(groups, key=lambda group: -group[0])]


def in_pace(
    poses: Mapping[ScanId, Pose2],
    part: Sequence[ScanId],
    other: Sequence[ScanId],
    T_1_2: Pose2,
    paces: Mapping[int, Pace],
) -> bool:
    """Whether the robot of each log could have gone from one component to the other, if these lie as proposed."""
    owner = {**dict.fromkeys(part, False), **dict.fromkeys(other, True)}
    for a, b in pairwise(sorted(owner)):
        if a.log == b.log and owner[a] != owner[b] and a.log in paces:
            T_a, T_b = (T_1_2 @ poses[scan] if owner[scan] else poses[scan] for scan in (a, b))
            if not paces[a.log].reaches(T_a.inverse() @ T_b, steps_between((a, b))):
                return False
    return True


def across(
    scene: Scene, poses: Mapping[ScanId, Pose2], part: Sequence[ScanId], other: Sequence[ScanId], T_1_2: Pose2
) -> list[Promise]:
    """Pairs across two components that should see the same place if these lie as proposed, evenly spread."""
    theirs = {scan: T_1_2 @ poses[scan] for scan in other}
    found: list[Promise] = []
    for a in part:
        best = max((promise for promise in _shared(scene, poses[a], a, theirs)), key=lambda p: p.overlap, default=None)
        if best is not None:
            found.append(best)
    stride = max(1, -(-len(found) // MOST_ASKED))
    return found[::stride]


def _shared(scene: Scene, T_a: Pose2, a: ScanId, theirs: Mapping[ScanId, Pose2]) -> Iterator[Promise]:
    for b, T_b in theirs.items():
        T_a_b = T_a.inverse() @ T_b
        if math.hypot(T_a_b.x, T_a_b.y) <= REACH and (overlap := scene.overlap((a, b), T_a_b)) >= LEAST_SHARED:
            gate = Gate(T_a_b if a < b else T_a_b.inverse(), JOINING_WAY)
            yield Promise((min(a, b), max(a, b)), overlap, gate)


def agreement(
    scene: Scene, poses: Mapping[ScanId, Pose2], part: Sequence[ScanId], other: Sequence[ScanId], T_1_2: Pose2
) -> float:
    """Share of what scans across two components can judge of each other that is supported, if these lie so.

    Also where nobody looked for a match: a corridor turned round fits itself, but not the rooms beside it.
    """
    theirs = [(b, T_1_2 @ poses[b]) for b in other]
    ways = [(a, b, poses[a].inverse() @ T_b) for a in part for b, T_b in theirs]
    near = [(a, b, T_a_b) for a, b, T_a_b in ways if math.hypot(T_a_b.x, T_a_b.y) <= JUDGED_REACH]
    totals = np.zeros(4)
    for a, b, T_a_b in near[:: max(1, len(near) // MOST_JUDGED)]:
        totals += scene.settled(a, b, T_a_b)
    judged = float(totals[:3].sum())
    return float(totals[0]) / judged if judged > 0.0 else 0.0


def borne_out(promises: Sequence[Promise], matches: Mapping[Pair, Match]) -> list[Link]:
    """The closures that bear a proposal out; none where too few of the pairs asked give one."""
    links = [link for promise in promises if (link := closure(promise, matches[promise.pair]))]
    if len(links) < max(LEAST_AGREEING, LEAST_SHARE * len(promises)):
        return []
    return [replace(link, why="joined") for link in links]


def _agree(T: Pose2, other: Pose2) -> bool:
    distance, turn = T.distance(other)
    return distance <= AGREE[0] and turn <= AGREE[1]
