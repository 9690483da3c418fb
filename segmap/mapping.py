"""Whole logs -> whole maps, without odometry: keyframes, links, loop closures, one consistent set of poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby, pairwise, product

import numpy as np

from segmap.consensus import LEAST_VOTES
from segmap.fusion import fuse_all
from segmap.graph import Optimised, optimise
from segmap.graph.edges import Parts
from segmap.holding import FIRM, loose_parts, weakly_held
from segmap.integration import Match
from segmap.keyframes import chained
from segmap.links import Link, Pace, alike
from segmap.loops import (
    AGREE,
    LEAST_AGREEMENT,
    Scene,
    across,
    agreement,
    borne_out,
    closure,
    in_pace,
    promising,
    proposals,
)
from segmap.merging import Component
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.second_looks import better_places
from segmap.segments import SegmentMap
from segmap.spreading import Crew, Keep, Matches, Pair, Told
from segmap.strays import beside, links_at, placed, strays

__all__ = ["WholeMap", "fused", "map_scans"]

ROUNDS = 3
"""searches for closures, each from the poses the one before gave"""
MOST_JOINING = 800
"""pairs that are matched between two components"""
LEAST_JOINING = 3
"""scans a component has that is looked for in others"""
BATCH = 48
"""pairs that are matched before it is looked whether enough agree"""


@dataclass(frozen=True, eq=False)
class WholeMap:
    """What was made of some logs: where every scan is, and by which links."""

    optimised: Optimised
    """poses of all scans that anything holds, by component"""
    links: tuple[Link, ...]
    """in the order of ``optimised.residuals``"""
    keys: tuple[ScanId, ...]
    """the keyframes"""
    matches: Matches
    """every pair INTEGRATE was called on"""
    scans: tuple[ScanId, ...]
    """all scans, also those that nothing holds"""

    @property
    def poses(self) -> Mapping[ScanId, Pose2]:
        """Of every placed scan, in the frame of the first scan of its component."""
        return self.optimised.poses

    @property
    def components(self) -> tuple[tuple[ScanId, ...], ...]:
        """The scans that hold together, the largest component first."""
        return tuple(sorted(self.optimised.components, key=lambda part: (-len(part), part)))

    def weakly_held(self) -> dict[ScanId, str]:
        """The scans whose place one doubtful step decides, and why: see :func:`segmap.holding.weakly_held`."""
        sound = [link for link, fate in zip(self.links, self.optimised.residuals, strict=True) if not fate.silenced]
        return weakly_held(sound, self.components)


def map_scans(
    maps: Mapping[ScanId, SegmentMap],
    parameters: Parameters,
    *,
    workers: int = 1,
    backend: str = "processes",
    known: Mapping[Pair, Match] | None = None,
    keep: Keep | None = None,
    progress: Told | None = None,
    check: Callable[[], None] | None = None,
) -> WholeMap:
    """Where the scans of one log or several are, each log in the order it was taken.

    Nothing but the scans is used. ``progress`` is told what is done, how much of it and of how much. ``keep``
    is given each match that is not ``known``, some at a time: with what was kept until it was stopped the work
    goes on where it was, to the same result as if it had never been.

    Raises:
        CancelledError: raised by ``check``.
        ParameterError: there is no such backend.
    """
    told: Told = progress or _nobody
    crew = Crew(maps, parameters, workers, backend, known or {}, keep, told, check)
    chains = [chained(crew, list(log)) for _, log in groupby(sorted(maps), key=lambda scan: scan.log)]
    task = _Task(crew, {chain.keys[0].log: chain.pace for chain in chains})
    keys = sorted(key for chain in chains for key in chain.keys)
    links = {pair: link for chain in chains for pair, link in chain.links.items()}
    matches = {pair: match for chain in chains for pair, match in chain.matches.items()}
    _close_loops(task, keys, links, matches)
    every = [*links.values(), *(replace(link, why="tracked") for chain in chains for link in chain.tracked.values())]
    final = optimise([link.edge for link in every], check=check)
    return WholeMap(final, tuple(every), tuple(keys), matches, tuple(sorted(maps)))


def _nobody(what: str, done: int, total: int) -> None:
    """Nobody listens."""


def fused(whole: WholeMap, maps: Mapping[ScanId, SegmentMap], parameters: Parameters) -> tuple[Component, ...]:
    """The components of a whole map, the largest first, each as one clean map in the frame of its first scan."""
    return tuple(
        Component(f"component {number}", part, poses, fuse_all(maps, poses, parameters))
        for number, part in enumerate(whole.components, start=1)
        for poses in [{scan: whole.poses[scan] for scan in part}]
    )


@dataclass(frozen=True, eq=False)
class _Task:
    crew: Crew
    paces: Mapping[int, Pace]


def _close_loops(task: _Task, keys: Sequence[ScanId], links: dict[Pair, Link], matches: Matches) -> None:
    """Search for closures within and between components until no more is found; ``links`` and ``matches`` grow."""
    scene = Scene(task.crew.maps, keys, task.crew.parameters)
    optimised = optimise([link.edge for link in links.values()], check=task.crew.check)
    for turn in range(ROUNDS):
        promises = promising(scene, optimised.poses, optimised.components, _sound(optimised, links), set(matches))
        found = task.crew.matches([promise.pair for promise in promises], f"closing loops, round {turn + 1}")
        matches.update(found)
        closures = [link for promise in promises if (link := closure(promise, found[promise.pair]))]
        links.update((link.pair, link) for link in closures)
        joined = _join(task, scene, optimised, matches)
        links.update((link.pair, link) for link in joined)
        if not closures and not joined:
            break
        optimised = optimise([link.edge for link in links.values()], check=task.crew.check)
    for _ in range(ROUNDS):
        if not (holding := _placed(task, scene, optimised, matches)):
            break
        links.update((link.pair, link) for link in holding)
        optimised = optimise([link.edge for link in links.values()], check=task.crew.check)
    _reconsider(task, optimised, links, matches)
    _look_again(task, scene, links, matches)


def _placed(task: _Task, scene: Scene, optimised: Optimised, matches: Matches) -> list[Link]:
    """Links that hold what stands alone beside a larger component in its log, the largest first."""
    links: list[Link] = []
    for stray in strays(scene.scans, optimised.components):
        links.extend(placed(stray, task.crew, optimised.poses, task.paces, matches))
    return links


def _reconsider(task: _Task, optimised: Optimised, links: dict[Pair, Link], matches: Matches) -> None:
    """Let all scans around vote again on what one doubtful step holds: what they agree on takes its place."""
    whole = {scan: part for part in optimised.components for scan in part}
    for part, _ in loose_parts(_sound(optimised, links), optimised.components):
        stray = beside(part, [scan for scan in whole[part[0]] if scan not in set(part)])
        found = placed(stray, task.crew, optimised.poses, task.paces, matches) if stray else []
        if found:
            own = set(part)
            for link in [link for link in links.values() if (link.first in own) != (link.second in own)]:
                if link.why not in FIRM:
                    del links[link.pair]
            links.update((link.pair, link) for link in found)


def _look_again(task: _Task, scene: Scene, links: dict[Pair, Link], matches: Matches) -> None:
    """Hold scans that all around them see clearly better elsewhere nearby by what says so, not by what denies it."""
    optimised = optimise([link.edge for link in links.values()], check=task.crew.check)
    for part in optimised.components:
        for scan, T, around in better_places(task.crew.maps, part, optimised.poses, matches, scene.parameters):
            poses = {**optimised.poses, scan: T}
            found = list(links_at(T, {other: poses[other] for other in around}, {scan: Pose2.identity()}, matches))
            if len(found) >= LEAST_VOTES:
                for link in [link for link in links.values() if scan in link.pair]:
                    if not alike(link.T_1_2, poses[link.first].inverse() @ poses[link.second]):
                        del links[link.pair]
                links.update((link.pair, link) for link in found)


def _sound(optimised: Optimised, links: Mapping[Pair, Link]) -> list[Link]:
    """The links the optimiser does not silence."""
    return [link for link, fate in zip(links.values(), optimised.residuals, strict=True) if not fate.silenced]


def _join(task: _Task, scene: Scene, optimised: Optimised, matches: Matches) -> list[Link]:
    """Closures between components, those next to each other in a log first; what is joined is not joined again."""
    parts = [part for part in optimised.components if len(part) >= LEAST_JOINING]
    whole = Parts(len(parts))
    links: list[Link] = []
    for i, j in sorted(combinations(range(len(parts)), 2), key=lambda ij: _apart(parts[ij[0]], parts[ij[1]])):
        if whole.of(i) != whole.of(j):
            found = _joined(task, scene, optimised.poses, parts[i], parts[j], matches)
            links.extend(found)
            if found:
                whole.join(i, j)
    return links


def _apart(part: Sequence[ScanId], other: Sequence[ScanId]) -> float:
    """The least number of scans between two components in a log; infinite where they share no log."""
    own = {**dict.fromkeys(part, False), **dict.fromkeys(other, True)}
    steps = [b.scan - a.scan for a, b in pairwise(sorted(own)) if a.log == b.log and own[a] != own[b]]
    return float(min(steps, default=np.inf))


def _joined(
    task: _Task,
    scene: Scene,
    poses: Mapping[ScanId, Pose2],
    part: Sequence[ScanId],
    other: Sequence[ScanId],
    matches: Matches,
) -> list[Link]:
    waiting = [pair for pair in _across(task.crew.maps, part, other) if pair not in matches]
    asked: list[Pose2] = []
    while True:
        for T_1_2 in proposals(poses, part, other, matches):
            if not any(T_1_2.distance(before)[0] < AGREE[0] for before in asked):
                asked.append(T_1_2)
                if not in_pace(poses, part, other, T_1_2, task.paces):
                    continue
                promises = across(scene, poses, part, other, T_1_2)
                new = [promise.pair for promise in promises if promise.pair not in matches]
                matches.update(task.crew.matches(new, "joining components"))
                links = borne_out(promises, matches)
                if links and agreement(scene, poses, part, other, T_1_2) >= LEAST_AGREEMENT:
                    return links
        if not waiting:
            return []
        matches.update(task.crew.matches(waiting[:BATCH], "joining components"))
        del waiting[:BATCH]


def _across(maps: Mapping[ScanId, SegmentMap], part: Sequence[ScanId], other: Sequence[ScanId]) -> list[Pair]:
    """Pairs of scans of two components, evenly taken, those that saw most first."""
    stride = max(1, int(np.ceil(np.sqrt(len(part) * len(other) / MOST_JOINING))))
    pairs = [(min(a, b), max(a, b)) for a, b in product(part[::stride], other[::stride])]
    return sorted(pairs, key=lambda pair: -min(_length(maps[pair[0]]), _length(maps[pair[1]])))


def _length(segment_map: SegmentMap) -> float:
    starts, ends = segment_map.coordinates[:, :2], segment_map.coordinates[:, 2:]
    return float(np.hypot(*(ends - starts).T).sum())
