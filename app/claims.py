"""Poses no search on the pair found: claimed by a search on maps or by another program, or laid by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from segmap.events import Proposal
from segmap.integration import Candidate, Match
from segmap.parameters import Parameters
from segmap.placing import judged_at
from segmap.pose import Pose2
from segmap.segments import SegmentMap

__all__ = ["CLAIMED", "NUDGED", "claimed_rank", "described", "nudged_rank", "origin", "suggested_rank", "with_claim"]

CLAIMED = -1
"""the ``index`` of a candidate that no search on this pair found"""
NUDGED = -2
"""the ``index`` of a candidate that a person laid by hand"""
SAME = 1e-9
"""metres and radians; a claim that lies on a candidate is that candidate"""


def origin(candidate: Candidate) -> str:
    """Where a candidate comes from: ``found``, ``claimed`` or ``nudged``."""
    return {CLAIMED: "claimed", NUDGED: "nudged"}.get(candidate.index, "found")


def with_claim(
    match: Match, proposal: Proposal | None, maps: tuple[SegmentMap, SegmentMap], parameters: Parameters
) -> Match:
    """A match with the poses claimed, or laid by hand, as its last candidates, unless our search found the same."""
    if proposal is None:
        return match
    laid = None if proposal.nudge is None else proposal.nudge.T_1_2
    for T_1_2, index in ((proposal.T_1_2, CLAIMED), (laid, NUDGED)):
        if T_1_2 is not None and _rank_at(match, T_1_2) is None:
            match = replace(match, ranked=(*match.ranked, judged_at(*maps, T_1_2, parameters, match.mode, index)))
    return match


def claimed_rank(match: Match, proposal: Proposal) -> int | None:
    """The rank of the candidate that lies where a proposal says; None where none does."""
    return None if proposal.T_1_2 is None else _rank_at(match, proposal.T_1_2)


def nudged_rank(match: Match, proposal: Proposal) -> int | None:
    """The rank of the candidate that lies where a person laid it; None where nobody did."""
    return None if proposal.nudge is None else _rank_at(match, proposal.nudge.T_1_2)


def _rank_at(match: Match, T_1_2: Pose2) -> int | None:
    near = (max(c.T_1_2.distance(T_1_2)) <= SAME for c in match.ranked)
    return next((rank for rank, same in enumerate(near) if same), None)


def suggested_rank(proposal: Proposal | None, match: Callable[[], Match | None]) -> int:
    """The rank of the candidate to begin with: where our own search says that the scans lie, else the best."""
    if proposal is None or proposal.kind != "closure":
        return 0
    found = match()
    return 0 if found is None else claimed_rank(found, proposal) or 0


def described(match: Match | None, proposal: Proposal) -> str:
    """A proposal in words, and how far our own match is from it."""
    said = {
        "closure": f"Found by the {proposal.source or 'search for loop closures'}",
        "imported": f"Imported from {proposal.source or 'a pose graph'}",
        "manual": "Laid by hand" if proposal.nudge else "Asked for by hand",
    }[proposal.kind]
    if proposal.T_1_2 is None or match is None:
        return f"{said}."
    own = next((c for c in match.ranked if c.index >= 0), None)
    if own is None:
        return f"{said}; our own match finds nothing to compare it with."
    distance, turn = own.T_1_2.distance(proposal.T_1_2)
    if max(distance, turn) <= SAME:
        return f"{said}."
    return f"{said}; our own match is {distance:.2f} m and {math.degrees(turn):.1f} degrees from the pose it claims."
