"""A log -> its keyframes and how they hang together, without odometry.

Keyframes are as far apart as integration stays sure: every scan is matched with the last keyframe until that
fails, and half-way between two such failures another keyframe is put, so that each sees the next three.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from joblib import delayed

from segmap.consensus import Consensus, sightings, voted
from segmap.integration import Match, Verdict, match_maps
from segmap.links import (
    SIDE,
    Link,
    Pace,
    agreed,
    links_by_scan,
    pace_of,
    placed_from,
    steps_between,
)
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap
from segmap.spreading import Crew, Matches, Pair

__all__ = ["Chain", "chained", "keyframes", "windows"]

STRETCH = 120
"""scans that are tracked in one go; stretches are independent of each other"""
WINDOW = 3
"""keyframes before it that each keyframe is matched with"""
HALVED = 3
"""scans between two keyframes from which on one is put half-way"""
FASTER_TURN = 0.5
"""share of the score of a faster turn below which what is in pace is given up for it"""
FEW = 3
"""accepted matches across a step that bear it out where the two scans beside it were not matched"""
SPARSE = 1.0 / 3.0
"""where more than this share of the scans would be keyframes, all are"""


@dataclass(frozen=True, eq=False)
class Chain:
    """The keyframes of a log, and what holds them together in order."""

    keys: tuple[ScanId, ...]
    links: dict[Pair, Link]
    """between keyframes"""
    tracked: dict[ScanId, Link]
    """every other scan, in the frame of the keyframe it was tracked from"""
    matches: Matches
    """every pair INTEGRATE was called on"""
    pace: Pace
    """of the log"""


def chained(crew: Crew, sequence: Sequence[ScanId]) -> Chain:
    """The chain of a log: keyframes, their links, and the other scans tracked from them."""
    firm, tracked, matches = _tracked(crew, sequence)
    keys = keyframes(sequence, firm)
    tracked = {scan: link for scan, link in tracked.items() if scan not in set(keys)}
    pairs = [pair for pair in windows(keys) if pair not in matches]
    matches.update(crew.matches(pairs, "matching keyframes"))
    among = {pair: matches[pair] for pair in windows(keys)}
    pace = pace_of(matches)
    links = agreed(keys, among, pace)
    _bridge(crew, keys, links, matches, pace)
    return Chain(tuple(keys), links, tracked, matches, pace)


def windows(keys: Sequence[ScanId], width: int = WINDOW) -> Iterator[Pair]:
    """Each keyframe with the few after it."""
    return ((keys[i], keys[i + step]) for step in range(1, width + 1) for i in range(len(keys) - step))


# --- tracking -------------------------------------------------------------------------------------


def keyframes(sequence: Sequence[ScanId], firm: Sequence[ScanId]) -> list[ScanId]:
    """The scans that others were tracked from, the last scan, and one half-way between those far apart.

    Where these are many, all scans: their log is no denser than it has to be.
    """
    place = {scan: i for i, scan in enumerate(sequence)}
    places = sorted({*(place[scan] for scan in firm), len(sequence) - 1}) if sequence else []
    half = [a + (b - a) // 2 for a, b in pairwise(places) if b - a >= HALVED]
    kept = sorted({*places, *half})
    return list(sequence) if len(kept) > SPARSE * len(sequence) else [sequence[i] for i in kept]


def _tracked(crew: Crew, sequence: Sequence[ScanId]) -> tuple[list[ScanId], dict[ScanId, Link], Matches]:
    """The scans others are tracked from, and every other one from the last of them."""
    stretches = [sequence[i : i + STRETCH] for i in range(0, len(sequence), STRETCH)]
    firm: list[ScanId] = []
    tracked: dict[ScanId, Link] = {}
    matches: Matches = {}
    known = _by_stretch(crew.known, sequence)
    tasks = (
        delayed(_track)({scan: crew.maps[scan] for scan in part}, part, crew.parameters, known.get(number, {}))
        for number, part in enumerate(stretches)
    )
    for done, (keys, links, found) in enumerate(crew.tasks(tasks), start=1):
        firm.extend(keys)
        tracked.update(links)
        matches.update(found)
        crew.new(found)
        crew.told("tracking", min(done * STRETCH, len(sequence)), len(sequence))
    return firm, tracked, matches


def _by_stretch(known: Mapping[Pair, Match], sequence: Sequence[ScanId]) -> dict[int, Matches]:
    """What is known of the pairs within each stretch."""
    number = {scan: place // STRETCH for place, scan in enumerate(sequence)}
    found: dict[int, Matches] = {}
    for pair in known:
        a, b = (number.get(scan) for scan in pair)
        if a is not None and a == b:
            found.setdefault(a, {})[pair] = known[pair]
    return found


def _track(
    maps: Mapping[ScanId, SegmentMap], part: Sequence[ScanId], parameters: Parameters, known: Mapping[Pair, Match]
) -> tuple[list[ScanId], dict[ScanId, Link], Matches]:
    links: dict[ScanId, Link] = {}
    matches: Matches = {}
    keys, key = [part[0]], 0
    for i in range(1, len(part)):
        found = _sure(maps, (part[key], part[i]), parameters, known, matches)
        if found is None and i - 1 > key:
            key = i - 1
            keys.append(part[key])
            found = _sure(maps, (part[key], part[i]), parameters, known, matches)
        if found is None:
            key = i
            keys.append(part[key])
        else:
            links[part[i]] = found
    return keys, links, matches


def _sure(
    maps: Mapping[ScanId, SegmentMap], pair: Pair, parameters: Parameters, known: Mapping[Pair, Match], matches: Matches
) -> Link | None:
    match = known.get(pair) or match_maps(maps[pair[0]], maps[pair[1]], parameters, mode="verified")
    matches[pair] = match
    return Link.of(pair, match, 0, "accepted") if match.verdict is Verdict.ACCEPTED else None


# --- gaps -----------------------------------------------------------------------------------------


def _bridge(crew: Crew, keys: Sequence[ScanId], links: dict[Pair, Link], matches: Matches, pace: Pace) -> None:
    """Let the scans on both sides of each gap, and of each step that hangs on little, vote on the step."""
    place = {key: i for i, key in enumerate(keys)}
    for i in range(1, len(keys)):
        across = [link for link in links.values() if place[link.first] < i <= place[link.second]]
        near = links_by_scan(link for link in links.values() if link not in across)
        if across and not _hangs_on_little(across, keys[i - 1 : i + 1]):
            continue
        before = placed_from(keys[i - 1], near, keys[max(0, i - SIDE) : i])
        after = placed_from(keys[i], near, keys[i : i + SIDE])
        pairs = [(a, b) for a in before for b in after if (a, b) not in matches]
        matches.update(crew.matches(pairs, "bridging gaps"))
        consensus = _across(crew.maps, keys[i - 1 : i + 1], before, after, matches, pace, crew.parameters)
        for link in across:
            del links[link.pair]
        for vote in consensus.votes if consensus else ():
            links[vote.pair] = Link.of(vote.pair, matches[vote.pair], vote.rank, "voted")


def _hangs_on_little(across: Sequence[Link], ends: Sequence[ScanId]) -> bool:
    """Whether a step between two keyframes is borne out neither by a match of the two nor by several others."""
    if any(link.pair == tuple(ends) for link in across):
        return False
    return sum(link.why == "accepted" for link in across) < FEW


def _across(
    maps: Mapping[ScanId, SegmentMap],
    ends: Sequence[ScanId],
    before: Mapping[ScanId, Pose2],
    after: Mapping[ScanId, Pose2],
    matches: Matches,
    pace: Pace,
    parameters: Parameters,
) -> Consensus | None:
    """What the scans on both sides of a gap clearly agree on, at the pace the robot mostly turns.

    A faster turn is believed where nothing in pace fits half as well.
    """
    seen, steps = sightings(maps, (*before, *after)), steps_between((ends[0], ends[1]))
    paced = voted(before, after, matches, seen, parameters, lambda T: pace.allows(T, steps))
    anyhow = voted(before, after, matches, seen, parameters, lambda T: pace.reaches(T, steps))
    fits = 0.0 if paced is None else paced.score
    if anyhow is not None and anyhow.clear and fits < FASTER_TURN * anyhow.score:
        return anyhow
    return paced if paced is not None and paced.clear else None
