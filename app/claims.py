"""Poses that were claimed for a pair, by a search or by another program: candidates beside our own match."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from segmap.evaluation import matching_values
from segmap.events import Proposal
from segmap.integration import Candidate, Match
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.refinement import uncertainties
from segmap.segments import SegmentMap
from segmap.verification import views
from segmap.visibility import evidence, look, score

__all__ = ["CLAIMED", "claimed_rank", "described", "judged_at", "with_claim"]

CLAIMED = -1
"""the ``index`` of a candidate that no search on this pair found"""
SAME = 1e-9
"""metres and radians; a claim that lies on a candidate is that candidate"""


def judged_at(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters, mode: str) -> Candidate:
    """Any pose as a candidate: its value, and in verified mode its evidence."""
    value = float(matching_values(map_1, map_2, T_1_2, parameters)[1].sum())
    plain = Candidate(T_1_2, value, (0, 0), (0, 0), CLAIMED)
    seen = views(map_1, map_2, parameters) if mode == "verified" else None
    if seen is None:
        return plain
    poses = np.array([tuple(T_1_2)])
    totals = look(seen.seen_1, seen.seen_2, poses, parameters)
    held = uncertainties(map_1, map_2, seen.seen_1, seen.seen_2, poses, parameters)[0]
    return replace(plain, score=float(score(totals, parameters)[0]), evidence=evidence(totals[0]), uncertainty=held)


def with_claim(
    match: Match, proposal: Proposal | None, maps: tuple[SegmentMap, SegmentMap], parameters: Parameters
) -> Match:
    """A match with the claimed pose as its last candidate, unless our search found that very pose."""
    if proposal is None or proposal.T_1_2 is None or claimed_rank(match, proposal) is not None:
        return match
    return replace(match, ranked=(*match.ranked, judged_at(*maps, proposal.T_1_2, parameters, match.mode)))


def claimed_rank(match: Match, proposal: Proposal) -> int | None:
    """The rank of the candidate that lies where a proposal says; None where none does."""
    if proposal.T_1_2 is None:
        return None
    near = (max(c.T_1_2.distance(proposal.T_1_2)) <= SAME for c in match.ranked)
    return next((rank for rank, same in enumerate(near) if same), None)


def described(match: Match | None, proposal: Proposal) -> str:
    """A proposal in words, and how far our own match is from it."""
    said = {
        "closure": "Found by the search for loop closures",
        "imported": f"Imported from {proposal.source or 'a pose graph'}",
        "manual": "Asked for by hand",
    }[proposal.kind]
    if proposal.T_1_2 is None or match is None:
        return f"{said}."
    own = next((c for c in match.ranked if c.index != CLAIMED), None)
    if own is None:
        return f"{said}; our own match finds nothing to compare it with."
    distance, turn = own.T_1_2.distance(proposal.T_1_2)
    if max(distance, turn) <= SAME:
        return f"{said}."
    return f"{said}; our own match is {distance:.2f} m and {math.degrees(turn):.1f} degrees from the pose it claims."
