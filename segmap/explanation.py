"""Why a candidate has its value and its score: what every pair of segments, chain, crossing and return adds or takes.

The terms sum to the totals they explain: pairs, and chains, to the value (III-B); returns, segments and
kinds of evidence to the score of verified mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import TypeAdapter

from segmap._kernels import TOUCH, nearest_segments
from segmap._sight_kernels import UNSEEN
from segmap.chains import components
from segmap.evaluation import LEAST_MATCH, evaluate, matching_values
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap
from segmap.visibility import CLASS_NAMES, Evidence, Sighting, classes, evidence, look, score, sighting

__all__ = [
    "ChainTerm",
    "Crossing",
    "Explanation",
    "MapSight",
    "PairTerm",
    "ReturnTerm",
    "SegmentTerm",
    "explain",
    "measured",
]


@dataclass(frozen=True)
class PairTerm:
    """What two segments add to the value: the mean of their common lengths, times the penalty for their distance."""

    first: int
    """segment of map 1"""
    second: int
    """segment of map 2"""
    value: float
    """metres; the mean of the common lengths times the factor"""
    distance: float
    """metres, the paper's min-max distance to the supporting lines"""
    factor: float
    """penalty for the distance, in 0..1; 1 where the segments intersect"""
    common_1: float
    """metres of the first segment that the second covers"""
    common_2: float
    """metres of the second segment that the first covers"""
    chain: int | None
    """the matching chain, by its place in ``chains``; None for a value too small to match"""


@dataclass(frozen=True)
class ChainTerm:
    """What a matching chain adds to the value."""

    first: tuple[int, ...]
    """its segments of map 1, ascending"""
    second: tuple[int, ...]
    """those of map 2"""
    value: float
    """metres"""


@dataclass(frozen=True)
class Crossing:
    """Two long segments that cross: paper mode discards the candidate for it (Algorithm 4, line 6)."""

    first: int
    second: int
    x: float
    """metres, where they cross, in frame 1"""
    y: float
    angle: float
    """radians between the lines, acute"""


@dataclass(frozen=True)
class ReturnTerm:
    """One return of a map, and what the other map's lines of sight make of it."""

    x: float
    """metres, in the return's own map"""
    y: float
    seen: str
    """supported, contradicted, shadowed or unseen"""
    width: float
    """metres of wall it stands for; what several scans of a map saw is shared among them"""
    score: float
    """metres it adds to the score, or takes"""
    segment: int | None
    """the segment of its own map it lies on, if any"""


@dataclass(frozen=True)
class SegmentTerm:
    """What the returns on one segment make of a candidate together."""

    segment: int | None
    """None: the returns that lie on no segment"""
    evidence: Evidence
    score: float
    """metres"""


@dataclass(frozen=True)
class MapSight:
    """One map as the other's lines of sight see it."""

    returns: tuple[ReturnTerm, ...]
    segments: tuple[SegmentTerm, ...]
    """those with returns, ascending; last what lies on none"""


@dataclass(frozen=True)
class Explanation:
    """What makes up the value of a candidate, and the score where lines of sight are known."""

    T_1_2: Pose2
    value: float
    """metres: the sum over ``pairs`` in their order, to the last bit, and over ``chains``"""
    discarded: bool
    """whether paper mode discards it, because of ``crossings``"""
    pairs: tuple[PairTerm, ...]
    """in index order"""
    chains: tuple[ChainTerm, ...]
    crossings: tuple[Crossing, ...]
    score: float | None = None
    """metres: the sum of ``terms``; None where lines of sight are unknown or off"""
    terms: dict[str, float] | None = None
    """metres that each kind of evidence adds to the score or takes"""
    evidence: Evidence | None = None
    sights: tuple[MapSight, MapSight] | None = None
    """map 1 as map 2 sees it, and map 2 as map 1 sees it"""

    def to_json(self) -> str:
        """This explanation as one JSON document."""
        return _ADAPTER.dump_json(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Explanation:
        """The explanation that :meth:`to_json` wrote."""
        return _ADAPTER.validate_json(text)


_ADAPTER = TypeAdapter(Explanation)


def explain(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters, *, sights: bool = True
) -> Explanation:
    """Everything that adds to the value and the score of ``T_1_2``, any pose at all, or takes from them.

    ``sights``: whether to ask the lines of sight, where both maps know of scans.
    """
    pairs, chains = _paired(map_1, map_2, T_1_2, parameters)
    crossings = _crossings(map_1, map_2, T_1_2, parameters)
    value = sum(pair.value for pair in pairs)
    told = Explanation(T_1_2, float(value), bool(crossings), pairs, chains, crossings)
    seen_1, seen_2 = (sighting(some, parameters.max_range) if sights else None for some in (map_1, map_2))
    return told if seen_1 is None or seen_2 is None else _seen(told, (map_1, map_2), (seen_1, seen_2), parameters)


# --- the value ------------------------------------------------------------------------------------


def _paired(
    map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters
) -> tuple[tuple[PairTerm, ...], tuple[ChainTerm, ...]]:
    """All pairs with a matching value, and the chains they form."""
    rows, values = matching_values(map_1, map_2, T_1_2, parameters, least=0.0)
    matches = values > LEAST_MATCH
    places = np.full(len(rows), -1)
    labels = components(rows[matches], len(map_1), len(map_2))
    order = {int(label): place for place, label in enumerate(dict.fromkeys(labels))}
    places[matches] = [order[int(label)] for label in labels]
    columns = measured(map_1.coordinates[rows[:, 0]], map_2.moved(T_1_2).coordinates[rows[:, 1]], parameters)
    pairs = tuple(
        PairTerm(i, j, value, distance, factor, common_1, common_2, None if place < 0 else place)
        for (i, j), value, (distance, factor, common_1, common_2), place in zip(
            rows.tolist(), values.tolist(), columns.tolist(), places.tolist(), strict=True
        )
    )
    return pairs, tuple(_chain(pairs, place) for place in range(len(order)))


def _chain(pairs: Sequence[PairTerm], place: int) -> ChainTerm:
    held = [pair for pair in pairs if pair.chain == place]
    first, second = {pair.first for pair in held}, {pair.second for pair in held}
    return ChainTerm(tuple(sorted(first)), tuple(sorted(second)), sum(pair.value for pair in held))


def measured(one: FloatArray, other: FloatArray, parameters: Parameters) -> FloatArray:
    """What the matching value is made of (Algorithm 4, lines 9 to 17), for pairs of segments (m, 4) each, in one frame.

    Returns (m, 4): distance in metres, the factor of the penalty, and the common lengths l1 and l2 in metres.
    """
    to_one, along_one, length_one = _against(one, other)
    to_other, along_other, length_other = _against(other, one)
    distance = np.minimum(np.abs(to_one).max(axis=1), np.abs(to_other).max(axis=1))
    meet = (np.column_stack((to_one.min(axis=1), to_other.min(axis=1))) <= TOUCH).all(axis=1)
    meet &= (np.column_stack((to_one.max(axis=1), to_other.max(axis=1))) >= -TOUCH).all(axis=1)
    factor = np.where(meet, 1.0, parameters.distance_penalty ** (distance / parameters.point_distance_tolerance))
    commons = (_common(along_one, length_one), _common(along_other, length_other))
    return np.column_stack((distance, factor, *commons))


def _against(lines: FloatArray, segments: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The extremes of segments from lines: signed distances (m, 2) and places along (m, 2); the lines' lengths."""
    along = lines[:, 2:] - lines[:, :2]
    lengths = np.hypot(*along.T)
    unit = (along / lengths[:, None])[:, None]
    extremes = segments.reshape(-1, 2, 2) - lines[:, None, :2]
    across = unit[..., 0] * extremes[..., 1] - unit[..., 1] * extremes[..., 0]
    return across, (unit * extremes).sum(axis=-1), lengths


def _common(along: FloatArray, lengths: FloatArray) -> FloatArray:
    """Metres of [0, length] that the stretch between two places covers."""
    return np.maximum(0.0, np.minimum(along.max(axis=1), lengths) - np.maximum(along.min(axis=1), 0.0))


def _crossings(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters) -> tuple[Crossing, ...]:
    """The pairs that discard the candidate, found by evaluating ever smaller parts of the maps."""
    pose = np.array([tuple(T_1_2)])

    def discards(part_1: SegmentMap, part_2: SegmentMap) -> bool:
        return bool(np.isnan(evaluate(part_1, part_2, pose, parameters)[0]))

    if not discards(map_1, map_2):
        return ()
    parts_1, parts_2 = ([some.take([i]) for i in range(len(some))] for some in (map_1, map_2))
    rows = [i for i, part in enumerate(parts_1) if discards(part, map_2)]
    moved = map_2.moved(T_1_2)
    return tuple(
        _crossing(i, j, map_1.coordinates[i], moved.coordinates[j])
        for i in rows
        for j, part in enumerate(parts_2)
        if discards(parts_1[i], part)
    )


def _crossing(i: int, j: int, one: FloatArray, other: FloatArray) -> Crossing:
    along, across = one[2:] - one[:2], other[2:] - other[:2]
    cross = along[0] * across[1] - along[1] * across[0]
    between = other[:2] - one[:2]
    x, y = one[:2] + (between[0] * across[1] - between[1] * across[0]) / cross * along
    return Crossing(i, j, float(x), float(y), float(np.arctan2(abs(cross), abs(along @ across))))


# --- the score ------------------------------------------------------------------------------------


def _seen(
    told: Explanation, maps: tuple[SegmentMap, SegmentMap], seen: tuple[Sighting, Sighting], parameters: Parameters
) -> Explanation:
    """The explanation, with what lines of sight add."""
    found = classes(*seen, told.T_1_2, parameters)
    widths = tuple(_counted(*side) for side in zip(seen, found, strict=True))
    totals = look(*seen, np.array([tuple(told.T_1_2)]), parameters)
    sides = [_side(*side, parameters) for side in zip(maps, seen, found, widths, strict=True)]
    terms = dict(zip(CLASS_NAMES, map(float, score(np.diag(totals[0]), parameters)), strict=True))
    return replace(
        told,
        score=float(score(totals, parameters)[0]),
        terms=terms,
        evidence=evidence(totals[0]),
        sights=(sides[0], sides[1]),
    )


def _counted(seen: Sighting, found: IntArray) -> FloatArray:
    """The metres each return counts for: its width; of a map of several scans no more is unseen than of one."""
    widths = seen.points[:, 2].copy()
    unseen = found == UNSEEN
    if len(seen.sensors) > 1 and unseen.any():
        counted = max(0.0, seen.mean - widths[~unseen].sum())
        widths[unseen] *= min(1.0, counted / widths[unseen].sum())
    return widths


def _side(
    segment_map: SegmentMap, seen: Sighting, found: IntArray, widths: FloatArray, parameters: Parameters
) -> MapSight:
    """One map's returns, one by one and by segment."""
    weights = score(np.eye(len(CLASS_NAMES)), parameters)
    owners = _owners(segment_map, seen.points, parameters)
    columns = zip(seen.points[:, :2].tolist(), found.tolist(), widths.tolist(), owners.tolist(), strict=True)
    returns = tuple(
        ReturnTerm(x, y, CLASS_NAMES[kind], width, float(weights[kind]) * width, _or_none(owner))
        for (x, y), kind, width, owner in columns
    )
    segments = []
    for owner in [*np.unique(owners[owners >= 0]), -1]:
        own = owners == owner
        totals = np.bincount(found[own], widths[own], len(CLASS_NAMES)).astype(np.float64)
        segments.append(SegmentTerm(_or_none(owner), evidence(totals), float(totals @ weights)))
    return MapSight(returns, tuple(segments))


def _or_none(owner: int) -> int | None:
    return None if owner < 0 else int(owner)


def _owners(segment_map: SegmentMap, points: FloatArray, parameters: Parameters) -> IntArray:
    """The segment each return lies on: the nearest, within what extraction and fusion may have moved it; -1: none."""
    if not len(segment_map):
        return np.full(len(points), -1)
    nearest, distances = nearest_segments(np.ascontiguousarray(points[:, :2]), segment_map.coordinates)
    near: IntArray = np.where(distances <= parameters.split_tolerance + parameters.fusion_tolerance, nearest, -1)
    return near
