"""Matches of the scans of a log -> links: candidates taken for true because several pairs say the same.

A verdict looks at one pair. A log has more to say, without any pose: scans that follow each other are near
each other (the log's own pace), three scans must close a triangle, and where single pairs are doubtful many of
them may still agree on one transformation.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from segmap.graph import Covariance, Edge
from segmap.integration import Candidate, Match, Verdict
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.spreading import Pair
from segmap.verdict import confidence, findings

__all__ = [
    "Link",
    "Near",
    "Pace",
    "agreed",
    "alike",
    "confidence_among",
    "links_by_scan",
    "pace_of",
    "placed_from",
    "steps_between",
]

FLOOR = 0.02, math.radians(0.4)
"""metres and radians: no pair is known better, whatever its geometry says"""
DOUBT = 2.0
"""by this factor the variances of a match are taken larger than its geometry says: returns are not independent"""
CLOSE = 0.3, math.radians(4.0)
"""metres and radians; ways through other scans that agree to this say the same"""
SIDE = 6
"""scans on each side of a gap that may vote"""
CANDIDATES = 8
"""candidates of a pair that may be right although they are not the best"""
LEAST_CONFIDENCE = 0.02
"""a candidate less likely than this is not saved by a triangle"""
PACED_CONFIDENCE = 0.9
"""a candidate that is the only one in pace needs this much"""
PACED_LEAD = 0.2
"""and this share of its score as its lead over the next one in pace"""
PACE_PERCENTILE, PACE_FACTOR, PACE_SLACK = 98.0, 1.5, (0.2, math.radians(5.0))


@dataclass(frozen=True)
class Link:
    """One candidate of a pair, taken for true."""

    first: ScanId
    second: ScanId
    T_1_2: Pose2
    covariance: Covariance
    """of x, y (metres) and theta (radians), as the pose graph takes it"""
    why: str
    """``accepted`` by its verdict; ``paced``, ``agreed``: see above; ``voted``: a consensus; ``closed``, ``joined``:
    a loop; ``tracked``: a scan between keyframes"""
    confidence: float
    rank: int = 0
    """of the candidate among those of its match"""

    @property
    def pair(self) -> Pair:
        """Its scans."""
        return self.first, self.second

    @property
    def edge(self) -> Edge:
        """This link in a pose graph."""
        return Edge(self.first, self.second, self.T_1_2, self.covariance)

    @classmethod
    def of(cls, pair: Pair, match: Match, rank: int, why: str) -> Link:
        """A candidate of a match as a link."""
        candidate = match.ranked[rank]
        return cls(*pair, candidate.T_1_2, covariance_of(candidate), why, match.confidence or 0.0, rank)


def covariance_of(candidate: Candidate) -> Covariance:
    """How well a verified candidate is known, as an edge of a pose graph."""
    found = candidate.uncertainty
    geometry = np.zeros((3, 3)) if found is None else np.array(found.covariance)
    floor = np.diag([FLOOR[0] ** 2, FLOOR[0] ** 2, FLOOR[1] ** 2])
    a, b, c = ((float(x), float(y), float(z)) for x, y, z in DOUBT * geometry + floor)
    return a, b, c


# --- the pace of a log ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Pace:
    """How far a robot goes between two scans of its log, at most."""

    distance: float
    """metres"""
    turn: float
    """radians"""

    def allows(self, T_1_2: Pose2, steps: int = 1) -> bool:
        """Whether so many steps can lead there."""
        return self.reaches(T_1_2, steps) and abs(T_1_2.theta) <= steps * self.turn

    def reaches(self, T_1_2: Pose2, steps: int = 1) -> bool:
        """The same, should the robot turn faster than it mostly does."""
        return math.hypot(T_1_2.x, T_1_2.y) <= steps * self.distance


def pace_of(matches: Mapping[Pair, Match]) -> Pace:
    """The pace of a log, from its accepted matches of scans that follow each other; unbounded where none is."""
    steps = [m.T_1_2 for pair, m in matches.items() if steps_between(pair) == 1 and _accepted(m) and m.T_1_2]
    if not steps:
        return Pace(math.inf, math.inf)
    far = np.percentile([math.hypot(T.x, T.y) for T in steps], PACE_PERCENTILE)
    turn = np.percentile([abs(T.theta) for T in steps], PACE_PERCENTILE)
    return Pace(float(PACE_FACTOR * far + PACE_SLACK[0]), float(PACE_FACTOR * turn + PACE_SLACK[1]))


def steps_between(pair: Pair) -> int:
    """How many scans on the second of two scans of a log was taken."""
    return abs(pair[1].scan - pair[0].scan)


def confidence_among(candidates: Sequence[Candidate]) -> float:
    """The confidence in the first of some candidates of a match, had there been no others."""
    judged = [(c.score, c.evidence) for c in candidates if c.score is not None and c.evidence is not None]
    if not judged or candidates[0].uncertainty is None:
        return 0.0
    return confidence(findings(judged, candidates[0].uncertainty.weakest))


def _accepted(match: Match) -> bool:
    return match.verdict is Verdict.ACCEPTED


# --- what a window of matches agrees on -----------------------------------------------------------


def agreed(sequence: Sequence[ScanId], matches: Mapping[Pair, Match], pace: Pace) -> dict[Pair, Link]:
    """The links of a sequence of scans of a log, from matches of scans that are near each other in it.

    What is accepted and in pace; consecutive scans of which one candidate alone is in pace; then whatever
    closes a triangle with two links; and without what most others contradict.
    """
    links = {
        pair: Link.of(pair, match, 0, "accepted")
        for pair, match in matches.items()
        if _accepted(match) and pace.allows(match.ranked[0].T_1_2, steps_between(pair))
    }
    links.update(
        (pair, link) for pair in pairwise(sequence) if pair not in links and (link := _paced(pair, matches, pace))
    )
    _close_triangles(links, matches)
    return _outvoted(sequence, links)


def _paced(pair: Pair, matches: Mapping[Pair, Match], pace: Pace) -> Link | None:
    """The link of two consecutive scans of which one candidate in pace is clearly ahead of all others in pace."""
    match = matches.get(pair)
    ranked, steps = match.ranked if match else (), steps_between(pair)
    within = [(rank, c) for rank, c in enumerate(ranked) if pace.allows(c.T_1_2, steps)]
    if match is None or not within or confidence_among([c for _, c in within]) < PACED_CONFIDENCE:
        return None
    scores = [c.score or 0.0 for _, c in within]
    if len(scores) > 1 and scores[0] - scores[1] < PACED_LEAD * scores[0]:
        return None
    return Link.of(pair, match, within[0][0], "paced")


def _close_triangles(links: dict[Pair, Link], matches: Mapping[Pair, Match]) -> None:
    """Take each candidate that two links already lead to, until no more is found."""
    near = links_by_scan(links.values())
    waiting = [pair for pair in matches if pair not in links]
    found = True
    while found:
        found = False
        for pair in list(waiting):
            if link := _closing(pair, matches[pair], near):
                links[pair] = link
                near.setdefault(pair[0], {})[pair[1]] = link.T_1_2
                near.setdefault(pair[1], {})[pair[0]] = link.T_1_2.inverse()
                waiting.remove(pair)
                found = True


Near = dict[ScanId, dict[ScanId, Pose2]]
"""``T_a_b`` of the scans b linked with each scan a"""


def links_by_scan(links: Iterable[Link]) -> Near:
    """For each scan, where the scans linked with it are in its frame."""
    near: Near = {}
    for link in links:
        near.setdefault(link.first, {})[link.second] = link.T_1_2
        near.setdefault(link.second, {})[link.first] = link.T_1_2.inverse()
    return near


def _closing(pair: Pair, match: Match, near: Near) -> Link | None:
    a, b = pair
    ways = [near[a][m] @ near[m][b] for m in near.get(a, {}) if b in near.get(m, {})]
    if not ways:
        return None
    for rank, candidate in enumerate(match.ranked[:CANDIDATES]):
        if any(alike(candidate.T_1_2, way) for way in ways) and confidence_among([candidate]) >= LEAST_CONFIDENCE:
            return Link.of(pair, match, rank, "agreed")
    return None


def alike(T: Pose2, other: Pose2, times: float = 1.0) -> bool:
    """Whether two transformations say the same; with ``times``, so many times as far apart."""
    distance, turn = T.distance(other)
    return distance <= times * CLOSE[0] and turn <= times * CLOSE[1]


# --- what most links across a step say ------------------------------------------------------------


def placed_from(start: ScanId, near: Near, among: Iterable[ScanId]) -> dict[ScanId, Pose2]:
    """Where scans are in the frame of one of them, by the fewest links that lead there within ``among``."""
    wanted = set(among)
    poses, waiting = {start: Pose2.identity()}, deque([start])
    while waiting:
        scan = waiting.popleft()
        for other, T in near.get(scan, {}).items():
            if other in wanted and other not in poses:
                poses[other] = poses[scan] @ T
                waiting.append(other)
    return poses


def _outvoted(sequence: Sequence[ScanId], links: dict[Pair, Link]) -> dict[Pair, Link]:
    """The links without those that the others across the same steps contradict, the most contradicted first."""
    place = {scan: i for i, scan in enumerate(sequence)}
    kept = dict(links)
    while against := _contradicted(sequence, place, kept):
        touched: list[int] = []
        for pair in sorted(against, key=lambda pair: (-against[pair], pair)):
            if all(abs(place[pair[0]] - other) > 2 * SIDE for other in touched):
                touched.append(place[pair[0]])
                del kept[pair]
    return kept


def _contradicted(
    sequence: Sequence[ScanId], place: Mapping[ScanId, int], links: Mapping[Pair, Link]
) -> dict[Pair, float]:
    """How much more speaks against each link than for it, on the average of the steps it goes across."""
    across: dict[int, list[Link]] = {}
    for link in links.values():
        for step in range(place[link.first], place[link.second]):
            across.setdefault(step, []).append(link)
    against: dict[Pair, float] = {}
    for step, those in sorted(across.items()):
        for link, margin in _minority(sequence, step, those, links):
            share = margin / (place[link.second] - place[link.first])
            against[link.pair] = against.get(link.pair, 0.0) + share
    return against


def _minority(
    sequence: Sequence[ScanId], step: int, those: Sequence[Link], links: Mapping[Pair, Link]
) -> Iterator[tuple[Link, float]]:
    """Of the links across a step those that disagree with what more of them say, and how much more."""
    own = {link.pair for link in those}
    around = {*sequence[max(0, step - SIDE) : step + 1 + SIDE]}
    near = links_by_scan(link for pair, link in links.items() if pair not in own and pair[0] in around)
    before = placed_from(sequence[step], near, sequence[max(0, step - SIDE) : step + 1])
    after = placed_from(sequence[step + 1], near, sequence[step + 1 : step + 1 + SIDE])
    said = [
        (link, before[link.first] @ link.T_1_2 @ after[link.second].inverse(), _weight(link))
        for link in those
        if link.first in before and link.second in after
    ]
    support = [sum(w for _, other, w in said if alike(T, other, 2.0)) for _, T, _ in said]
    winner = max(range(len(said)), key=lambda k: support[k], default=0)
    for k, (link, T, _) in enumerate(said):
        if not alike(T, said[winner][1], 2.0) and support[k] < support[winner]:
            yield link, support[winner] - support[k]


def _weight(link: Link) -> float:
    return 1.0 if link.why == "accepted" else 0.3
