"""Many doubtful pairs -> the one transformation between two groups of scans that they agree on.

Each pair votes with its candidates; what has most votes is judged by the lines of sight of all pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from segmap.integration import Match
from segmap.links import CANDIDATES, alike
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.refinement import refined
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Pair
from segmap.visibility import Sighting, look, sighting, thinned

__all__ = ["JOINT_GATES", "LEAST_VOTES", "RETURNS", "Consensus", "sightings", "voted"]

LEAST_VOTES, LEAST_SCORE, LEAST_LEAD = 2, 6.0, 0.1
"""pairs that must agree, the metres all must score together, and the share of it they must be ahead of any rival"""
RIVAL = 2.0
"""times as far apart as ways that say the same: from here on it is a rival; of those nearer by, votes choose"""
MOST_CENTRES = 60
"""votes that are tried as the middle of a cluster"""
MOST_JUDGED = 10
"""clusters that are judged by lines of sight"""
SEVERITIES = np.array([2.0, 4.0])
"""what a metre against takes from the metres supported: mildly and severely judged, the best must be the best"""
RETURNS = 90
"""returns of each scan that judge what is voted for"""
JOINT_STEPS, JOINT_GATES = 4, (0.3, 0.1)
"""steps of refinement of each pair, and the gates in metres it begins and ends with"""


@dataclass(frozen=True)
class Vote:
    """What one candidate says of the transformation between two groups of scans."""

    weight: float
    T_1_2: Pose2
    pair: Pair
    rank: int


@dataclass(frozen=True)
class Consensus:
    """The transformation between two groups of scans that their pairs agree on best."""

    T_1_2: Pose2
    votes: tuple[Vote, ...]
    """one of each pair that agrees"""
    needed: int
    """pairs that must agree: fewer where a group is a single scan"""
    score: float
    """metres: what the lines of sight of all pairs say of it, support less conflict"""
    lead: float
    """share of the score by which it is ahead of every distinct other, however severely conflict is judged"""

    @property
    def clear(self) -> bool:
        """Whether enough speaks for it, and for nothing else."""
        return len(self.votes) >= self.needed and self.score >= LEAST_SCORE and self.lead >= LEAST_LEAD


def sightings(maps: Mapping[ScanId, SegmentMap], scans: Iterable[ScanId]) -> dict[ScanId, Sighting]:
    """What scans saw, some returns of each; those that saw something."""
    return {scan: thinned(seen, RETURNS) for scan in scans if (seen := sighting(maps[scan])) is not None}


def voted(
    group_1: Mapping[ScanId, Pose2],
    group_2: Mapping[ScanId, Pose2],
    matches: Mapping[Pair, Match],
    seen: Mapping[ScanId, Sighting],
    parameters: Parameters,
    allowed: Callable[[Pose2], bool] = lambda _: True,
) -> Consensus | None:
    """The transformation between two groups of scans that most of their pairs agree on; None where there is none.

    Groups are given by the poses of their scans in a frame of each. Each pair votes for what each of its
    candidates implies, where that is ``allowed``; what has most votes is judged by them and by the lines of sight
    of all pairs, also those that voted for something else. How far it leads, lines of sight alone say: votes of
    many pairs along one corridor err together.
    """
    cast = sorted(_votes(group_1, group_2, matches, allowed), key=lambda vote: -vote.weight)
    clusters: list[tuple[float, Pose2, tuple[Vote, ...]]] = []
    for vote in cast[:MOST_CENTRES]:
        if not any(alike(vote.T_1_2, centre) for _, centre, _ in clusters):
            agreeing = _one_each(other for other in cast if alike(other.T_1_2, vote.T_1_2))
            clusters.append((sum(other.weight for other in agreeing), vote.T_1_2, agreeing))
    clusters.sort(key=lambda cluster: -cluster[0])
    judged = clusters[:MOST_JUDGED]
    if not judged:
        return None
    totals = np.array([_joint(group_1, group_2, T_1_2, seen, parameters) for _, T_1_2, _ in judged])
    votes_for = np.array([weight for weight, _, _ in judged])
    scores = totals[:, :1] - totals[:, 1:] * SEVERITIES
    best = int(np.argmax(votes_for + scores.mean(axis=1)))
    apart = [k for k, (_, T_1_2, _) in enumerate(judged) if not alike(T_1_2, judged[best][1], RIVAL)]
    rivals = scores[apart].max(axis=0, initial=0.0)
    leads = np.where(scores[best] > 0.0, 1.0 - rivals / np.maximum(scores[best], LEAST_SCORE), 0.0)
    needed = min(LEAST_VOTES, len(group_1), len(group_2))
    return Consensus(judged[best][1], judged[best][2], needed, float(scores[best].mean()), float(leads.min()))


def _joint(
    group_1: Mapping[ScanId, Pose2],
    group_2: Mapping[ScanId, Pose2],
    T_1_2: Pose2,
    seen: Mapping[ScanId, Sighting],
    parameters: Parameters,
) -> tuple[float, float]:
    """How many metres all pairs together support of a transformation between their groups, and speak against."""
    totals = np.zeros(4)
    for a, T_1_a in group_1.items():
        for b, T_2_b in group_2.items():
            pose = np.array([tuple(T_1_a.inverse() @ T_1_2 @ T_2_b)])
            pose = refined(seen[a], seen[b], pose, JOINT_STEPS, *JOINT_GATES)
            totals += look(seen[a], seen[b], pose, parameters)[0]
    return float(totals[0]), float(totals[1] + totals[2])


def _votes(
    group_1: Mapping[ScanId, Pose2],
    group_2: Mapping[ScanId, Pose2],
    matches: Mapping[Pair, Match],
    allowed: Callable[[Pose2], bool],
) -> Iterator[Vote]:
    for a, T_1_a in group_1.items():
        for b, T_2_b in group_2.items():
            pair = (a, b) if a < b else (b, a)
            match = matches.get(pair)
            for rank, candidate in enumerate(match.ranked[:CANDIDATES] if match else ()):
                T_a_b = candidate.T_1_2 if a < b else candidate.T_1_2.inverse()
                T_1_2 = T_1_a @ T_a_b @ T_2_b.inverse()
                if allowed(T_1_2):
                    yield Vote(max(0.0, candidate.score or 0.0), T_1_2, pair, rank)


def _one_each(votes: Iterable[Vote]) -> tuple[Vote, ...]:
    """The strongest vote of each pair."""
    kept: dict[Pair, Vote] = {}
    for vote in votes:
        kept.setdefault(vote.pair, vote)
    return tuple(kept.values())
