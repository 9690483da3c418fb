"""Scans that nothing holds -> placed where their neighbours in the log are, by all the scans placed there.

The first scan of a log, or one with people before it, may match none of the few scans before and after it well
enough. But the robot was near its neighbours, so only few places are left, and every scan that was taken there,
at whatever time, has a vote.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from segmap.consensus import LEAST_VOTES, sightings, voted
from segmap.integration import match_maps
from segmap.links import (
    CANDIDATES,
    LEAST_CONFIDENCE,
    PACED_LEAD,
    SIDE,
    Link,
    Pace,
    alike,
    confidence_among,
    steps_between,
)
from segmap.loops import Gate, Promise, closure
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Crew, Matches, Pair

__all__ = ["Stray", "beside", "links_at", "placed", "strays"]

REACH = 6.0
"""metres, and radians times metres, from the neighbours of a stray to the scans that vote on it"""
VOTERS = 16
"""scans that vote, the nearest ones"""
WITNESSES = 12
"""of them, whose view together judges a scan that pairs cannot place"""


@dataclass(frozen=True)
class Stray:
    """Some scans of a log, one at least, that hang together but on nothing else."""

    scans: tuple[ScanId, ...]
    home: tuple[ScanId, ...]
    """the larger component that their neighbours in the log belong to"""
    before: ScanId | None
    """the last scan of it before them in the log; None where there is none"""
    after: ScanId | None
    """the first one after them"""

    @property
    def ends(self) -> tuple[tuple[ScanId, ScanId], ...]:
        """Each neighbour at home with the scan of the stray next to it."""
        both = (self.before, self.scans[0]), (self.after, self.scans[-1])
        return tuple((neighbour, own) for neighbour, own in both if neighbour is not None)


def strays(keys: Sequence[ScanId], parts: Sequence[Sequence[ScanId]]) -> list[Stray]:
    """The components ``parts``, and the keyframes in none, that stand beside a larger component in one log."""
    held = set(chain.from_iterable(parts))
    whole = [tuple(part) for part in parts] + [(key,) for key in keys if key not in held]
    owner = {scan: part for part in whole for scan in part}
    found = [stray for part in whole if (stray := _stray(part, owner))]
    return sorted(found, key=lambda stray: (-len(stray.scans), stray.scans))


def _stray(part: tuple[ScanId, ...], owner: Mapping[ScanId, tuple[ScanId, ...]]) -> Stray | None:
    larger = [scan for scan in owner if len(owner[scan]) > len(part)]
    ends = [end for end in _ends(part, larger) if end is not None]
    return beside(part, max((owner[end] for end in ends), key=len)) if ends else None


def beside(part: Sequence[ScanId], home: Sequence[ScanId]) -> Stray | None:
    """Some scans of one log as a stray beside a component; None where it holds none before or after them."""
    before, after = _ends(part, home)
    return None if before is None and after is None else Stray(tuple(part), tuple(home), before, after)


def _ends(part: Sequence[ScanId], others: Iterable[ScanId]) -> tuple[ScanId | None, ScanId | None]:
    """The last one before and the first one after some scans of one log; none of scans of several."""
    first, last = part[0], part[-1]
    log = [scan for scan in others if scan.log == first.log == last.log]
    return max((scan for scan in log if scan < first), default=None), min(
        (scan for scan in log if scan > last), default=None
    )


def placed(
    stray: Stray, crew: Crew, poses: Mapping[ScanId, Pose2], paces: Mapping[int, Pace], matches: Matches
) -> list[Link]:
    """The links that hold a stray at home, none where nothing is clear; ``matches`` grow.

    ``poses`` are of all scans, by component; ``paces`` of the logs. All pairs with the scans around vote. A single
    scan between two placed neighbours is else judged by what all around it see together, who see through the same
    passer-by only once.
    """
    own = _own(stray, poses)
    around = {scan: poses[scan] for scan in _around(stray, poses)}
    ends = [(poses[end], end, own[scan], scan) for end, scan in stray.ends]

    def allowed(T_home_stray: Pose2) -> bool:
        steps = ((a, T_a.inverse() @ T_home_stray @ T_b, steps_between((a, b))) for T_a, a, T_b, b in ends)
        return all(paces[end.log].allows(T_1_2, count) for end, T_1_2, count in steps)

    seen = sightings(crew.maps, (*around, *own))
    own, around = ({scan: pose for scan, pose in some.items() if scan in seen} for some in (own, around))
    pairs = [_pair(a, b) for a in around for b in own]
    matches.update(crew.matches([pair for pair in pairs if pair not in matches], "placing what is left over"))
    found = voted(around, own, matches, seen, crew.parameters, allowed)
    T_home_stray = found.T_1_2 if found is not None and found.clear else None
    if T_home_stray is None and len(stray.scans) == 1 and len(stray.ends) == 2 and around:
        T_home_stray = _seen_together(stray.scans[0], around, crew, allowed)
    links = [] if T_home_stray is None else [*links_at(T_home_stray, around, own, matches)]
    return links if len(links) >= LEAST_VOTES else []


def _pair(a: ScanId, b: ScanId) -> Pair:
    return (a, b) if a < b else (b, a)


def _own(stray: Stray, poses: Mapping[ScanId, Pose2]) -> dict[ScanId, Pose2]:
    """Where some scans of a stray are in the frame of its first, those near its ends."""
    back = poses.get(stray.scans[0], Pose2.identity()).inverse()
    some = sorted({*stray.scans[:SIDE], *stray.scans[-SIDE:]})
    return {scan: back @ poses.get(scan, Pose2.identity()) for scan in some}


def _around(stray: Stray, poses: Mapping[ScanId, Pose2]) -> list[ScanId]:
    """The scans at home nearest to where the stray's neighbours stood, and looked."""
    near = sorted((min(sum(poses[end].distance(poses[scan])) for end, _ in stray.ends), scan) for scan in stray.home)
    return [scan for far, scan in near[:VOTERS] if far <= REACH]


def _seen_together(
    scan: ScanId, around: Mapping[ScanId, Pose2], crew: Crew, allowed: Callable[[Pose2], bool]
) -> Pose2 | None:
    """Where a scan lies in the view of all around it, if one place of those allowed is clearly ahead."""
    first, *_ = witnesses = list(around)[:WITNESSES]
    view = SegmentMap.joined(crew.maps[one].moved(around[first].inverse() @ around[one]) for one in witnesses)
    match = match_maps(view, crew.maps[scan], crew.parameters, mode="verified", check=crew.check)
    within = [candidate for candidate in match.ranked if allowed(around[first] @ candidate.T_1_2)]
    scores = [candidate.score or 0.0 for candidate in within]
    if not within or confidence_among(within) < LEAST_CONFIDENCE:
        return None
    ahead = len(scores) == 1 or scores[0] - scores[1] >= PACED_LEAD * abs(scores[0])
    return around[first] @ within[0].T_1_2 if ahead else None


def links_at(
    T_home_stray: Pose2, around: Mapping[ScanId, Pose2], own: Mapping[ScanId, Pose2], matches: Matches
) -> Iterator[Link]:
    """The links of all pairs that have a candidate there; those that close a loop by themselves bear it out."""
    for a, T_home_a in around.items():
        for b, T_stray_b in own.items():
            pair, T_a_b = _pair(a, b), T_home_a.inverse() @ T_home_stray @ T_stray_b
            T_1_2 = T_a_b if a < b else T_a_b.inverse()
            match = matches.get(pair)
            if match is None:
                continue
            closed = closure(Promise(pair, 1.0, Gate(T_1_2, 0.0)), match)
            rank = next((k for k, c in enumerate(match.ranked[:CANDIDATES]) if alike(c.T_1_2, T_1_2)), None)
            if closed is not None:
                yield closed
            elif rank is not None:
                yield Link.of(pair, match, rank, "voted")
