"""Two maps -> candidate transformations, lazily, by heuristic (Section III-A, Algorithms 2 and 3).

The angle of two directed segments is their heading difference; its vertex is where their supporting
lines meet. A heuristic chooses which pairs of segments of a map form an angle; every pair of equal
angles of two maps gives one candidate, which takes vertex to vertex and averages the two heading
differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from segmap import _kernels, tracing
from segmap.errors import ParameterError
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, wrap
from segmap.segments import Order, SegmentMap

__all__ = ["HEURISTICS", "PAPER_HEURISTICS", "Angles", "Candidates", "angles", "candidates", "segment_pairs"]

POSE_RESOLUTION = 1e-9
"""metres and radians; poses that agree to this are one pose"""
BLOCK = 1 << 22
"""most pairs of angles compared at a time"""
MOST_LAID = 6_600
"""pairs of segments of partial maps that are laid on each other; with more, the longest of either map"""
DRAWS = 20
"""N_k = 20 * 2^k draws in round k (Algorithm 3, line 3)"""


@dataclass(frozen=True, eq=False)
class Angles:
    """Angles between directed segments of one map, as columns."""

    segments: IntArray
    """shape (n, 2): the two segments, in order"""
    headings: FloatArray
    """shape (n, 2), radians: their headings"""
    vertices: FloatArray
    """shape (n, 2), metres: where their supporting lines meet"""

    @property
    def sizes(self) -> FloatArray:
        """The angles, shape (n,), radians, not wrapped: from the first heading to the second."""
        return self.headings[:, 1] - self.headings[:, 0]

    def __len__(self) -> int:
        return len(self.segments)

    def take(self, rows: IntArray | slice) -> Angles:
        """Some of the angles."""
        return Angles(self.segments[rows], self.headings[rows], self.vertices[rows])


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate transformations, as columns."""

    poses: FloatArray
    """shape (k, 3): x, y in metres, theta in radians, of each ``T_1_2``"""
    angles_1: IntArray
    """shape (k, 2): the two segments of map 1 whose angle is superimposed"""
    angles_2: IntArray
    """shape (k, 2): those of map 2"""
    draws: int = 0
    """draws made for them (Algorithm 3)"""

    def __len__(self) -> int:
        return len(self.poses)

    def take(self, rows: IntArray) -> Candidates:
        """Some of the candidates; all of them as they are."""
        if len(rows) == len(self) and np.array_equal(rows, np.arange(len(self))):
            return self
        poses = self.poses.take(rows, axis=0)
        return Candidates(poses, self.angles_1.take(rows, axis=0), self.angles_2.take(rows, axis=0), self.draws)

    @classmethod
    def joined(cls, blocks: Sequence[Candidates]) -> Candidates:
        """Blocks of candidates in a row."""
        if len(blocks) == 1:
            return blocks[0]
        return cls(
            np.concatenate([np.empty((0, 3)), *(block.poses for block in blocks)]),
            np.concatenate([np.empty((0, 2), np.int64), *(block.angles_1 for block in blocks)]),
            np.concatenate([np.empty((0, 2), np.int64), *(block.angles_2 for block in blocks)]),
            sum(block.draws for block in blocks),
        )


# --- which segments form an angle -----------------------------------------------------------------


def _all(segment_map: SegmentMap, parameters: Parameters) -> IntArray:  # noqa: ARG001 (one signature for all)
    """Every pair of segments (Algorithm 2, lines 2 to 4)."""
    return np.stack(np.triu_indices(len(segment_map), k=1), axis=-1)


def _consecutive(segment_map: SegmentMap, parameters: Parameters) -> IntArray:
    """Neighbours in beam order, or segments that share an extreme (III-A1)."""
    lengths = segment_map.lengths
    long_enough = lengths >= parameters.segment_length_percentage / 100.0 * lengths.max(initial=0.0)
    if parameters.consecutive_strict or segment_map.order is Order.NONE:
        pairs = _touching(segment_map, parameters.point_distance_tolerance)
    else:
        kept = np.flatnonzero(long_enough) if parameters.consecutive_over_short else np.arange(len(lengths))
        pairs = _neighbours(kept, segment_map.order is Order.RING)
    tracing.tell("consecutive", map=segment_map, long_enough=long_enough, pairs=pairs)
    return pairs[long_enough[pairs].all(axis=1)]


def _neighbours(indices: IntArray, ring: bool) -> IntArray:
    following = np.roll(indices, -1)
    pairs = np.stack((indices, following), axis=-1)
    return pairs if ring and len(indices) > 2 else pairs[:-1]


def _touching(segment_map: SegmentMap, tolerance: float) -> IntArray:
    """Pairs with two extremes closer than the tolerance: "an extreme point in common"."""
    pairs = np.stack(np.triu_indices(len(segment_map), k=1), axis=-1)
    extremes = segment_map.coordinates.reshape(-1, 2, 2)
    between = extremes[pairs[:, 0], :, None] - extremes[pairs[:, 1], None, :]
    return pairs[(np.hypot(between[..., 0], between[..., 1]) < tolerance).any(axis=(1, 2))]


def _histogram(segment_map: SegmentMap, parameters: Parameters) -> IntArray:
    """A segment in the principal direction with one in the normal direction (III-A3)."""
    slots = parameters.histogram_slots
    bucket = np.floor(np.mod(segment_map.headings, math.pi) * slots / math.pi).astype(np.int64) % slots
    totals = np.bincount(bucket, weights=segment_map.lengths, minlength=slots)
    principal = int(np.argmax(totals))
    normal = (principal + slots // 2) % slots
    tracing.tell("histogram", map=segment_map, buckets=bucket, totals=totals, principal=principal, normal=normal)
    pairs = np.stack(np.triu_indices(len(segment_map), k=1), axis=-1)
    first, second = bucket[pairs].T
    return pairs[((first == principal) & (second == normal)) | ((first == normal) & (second == principal))]


_SELECTIONS: dict[str, Callable[[SegmentMap, Parameters], IntArray]] = {
    "all": _all,
    "consecutive": _consecutive,
    "histogram": _histogram,
}
PAPER_HEURISTICS = ("all", "consecutive", "random", "histogram")
"""The paper's heuristics, by name; ``random`` draws pairs of angles and so chooses for both maps at once."""
HEURISTICS = (*PAPER_HEURISTICS, "extremes")
"""and ``extremes``, beyond the paper: a single segment laid on a single segment, no angle needed."""


def segment_pairs(segment_map: SegmentMap, heuristic: str, parameters: Parameters) -> IntArray:
    """The pairs of segments of a map that form an angle by a heuristic, shape (n, 2), lower index first.

    Raises:
        ParameterError: no such heuristic, or one that does not choose by map.
    """
    try:
        return _SELECTIONS[heuristic](segment_map, parameters)
    except KeyError:
        raise ParameterError(f"There is no heuristic {heuristic!r}. Heuristics are: {', '.join(HEURISTICS)}.") from None


# --- angles ---------------------------------------------------------------------------------------


def angles(segment_map: SegmentMap, pairs: IntArray, parameters: Parameters, both_orders: bool = False) -> Angles:
    """The angles of pairs of segments, shape (n, 2); lines too near to parallel give none.

    An undirected segment enters in both directions; ``both_orders`` takes each pair in both orders.
    """
    if both_orders:
        pairs = np.concatenate((pairs, pairs[:, ::-1]))
    pairs, headings = _with_headings(segment_map, pairs)
    usable = _meet(headings, parameters.min_vertex_angle)
    tracing.tell("chosen", map=segment_map, pairs=pairs, headings=headings, usable=usable)
    pairs, headings = pairs[usable], headings[usable]
    found = Angles(pairs, headings, _vertices(segment_map, pairs, headings))
    tracing.tell("angles", map=segment_map, angles=found)
    return found


def _with_headings(segment_map: SegmentMap, pairs: IntArray) -> tuple[IntArray, FloatArray]:
    """Headings of the pairs' segments, with the reversed ones for undirected segments."""
    headings = segment_map.headings[pairs]
    for side in (0, 1):
        undirected = ~segment_map.directed[pairs[:, side]]
        if undirected.any():
            turned = headings[undirected]
            turned[:, side] += math.pi
            pairs = np.concatenate((pairs, pairs[undirected]))
            headings = np.concatenate((headings, turned))
    return pairs, headings


def _meet(headings: FloatArray, min_vertex_angle: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether the acute angle between two lines is above the least one."""
    return np.abs(np.sin(headings[:, 1] - headings[:, 0])) > math.sin(min_vertex_angle)


def _vertices(segment_map: SegmentMap, pairs: IntArray, headings: FloatArray) -> FloatArray:
    """Where the supporting lines of each pair meet."""
    start_1, start_2 = segment_map.coordinates[pairs, :2].transpose(1, 0, 2)
    along_1, along_2 = np.stack((np.cos(headings), np.sin(headings)), axis=-1).transpose(1, 0, 2)
    between = start_2 - start_1
    distance = _cross(between, along_2) / _cross(along_1, along_2)
    return start_1 + distance[:, None] * along_1


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


# --- candidates -----------------------------------------------------------------------------------


def candidates(map_1: SegmentMap, map_2: SegmentMap, heuristic: str, parameters: Parameters) -> Iterator[Candidates]:
    """The candidate transformations of a heuristic, block by block; no pose comes twice.

    Where a map has no beam order, the pairs of map 2 are taken in both orders.

    Raises:
        ParameterError: there is no such heuristic.
    """
    if heuristic == "random":
        blocks = _random_candidates(map_1, map_2, parameters)
    elif heuristic == "extremes":
        blocks = _extreme_candidates(map_1, map_2)
    else:
        blocks = _paired_candidates(map_1, map_2, heuristic, parameters)
    tracing.tell("heuristic", name=heuristic, map_1=map_1, map_2=map_2)
    seen = _Seen()
    for block in blocks:
        rows = seen.new(block.poses)
        tracing.tell("candidates", block=block, new=rows)
        yield block.take(rows)


def _paired_candidates(
    map_1: SegmentMap, map_2: SegmentMap, heuristic: str, parameters: Parameters
) -> Iterator[Candidates]:
    """Algorithm 2 with lines 3 and 7 restricted by a heuristic."""
    both_orders = not (map_1.order is Order.BEAMS and map_2.order is Order.BEAMS)
    angles_1 = angles(map_1, segment_pairs(map_1, heuristic, parameters), parameters)
    angles_2 = angles(map_2, segment_pairs(map_2, heuristic, parameters), parameters, both_orders)
    rows = max(1, BLOCK // max(1, len(angles_2)))
    for start in range(0, len(angles_1), rows):
        yield _superimposed(angles_1.take(slice(start, start + rows)), angles_2, parameters)


def _superimposed(angles_1: Angles, angles_2: Angles, parameters: Parameters) -> Candidates:
    """One candidate for each pair of equal angles (Algorithm 2, lines 10 to 14)."""
    poses, rows_1, rows_2 = _kernels.equal_angles(
        angles_1.sizes,
        angles_1.headings,
        angles_1.vertices,
        angles_2.sizes,
        angles_2.headings,
        angles_2.vertices,
        parameters.angle_difference_tolerance,
    )
    tracing.tell("equal", angles_1=angles_1, angles_2=angles_2, rows_1=rows_1, rows_2=rows_2)
    return Candidates(poses, angles_1.segments.take(rows_1, axis=0), angles_2.segments.take(rows_2, axis=0))


def _random_candidates(map_1: SegmentMap, map_2: SegmentMap, parameters: Parameters) -> Iterator[Candidates]:
    """Algorithm 3, one block for each round k."""
    generator = np.random.Generator(np.random.PCG64(parameters.seed))
    for k in range(1, parameters.random_rounds + 1):
        longest = parameters.segment_division_factor**k
        choices = [np.flatnonzero(m.lengths > longest * m.lengths.max(initial=0.0)) for m in (map_1, map_2)]
        tracing.tell("round", k=k, share=longest, choices=choices)
        if min(len(choice) for choice in choices) < 2:
            continue
        draws = DRAWS * 2**k
        drawn_1, drawn_2 = (
            _drawn_angles(generator, m, _pick(generator, choice, draws))
            for m, choice in zip((map_1, map_2), choices, strict=True)
        )
        yield _equal_drawn(map_1, drawn_1, map_2, drawn_2, parameters)


def _pick(generator: np.random.Generator, choice: IntArray, draws: int) -> IntArray:
    """Two distinct segments for each draw, uniformly (lines 4 and 6)."""
    first = generator.integers(len(choice), size=draws)
    second = (first + 1 + generator.integers(len(choice) - 1, size=draws)) % len(choice)
    return choice[np.stack((first, second), axis=-1)]


def _drawn_angles(
    generator: np.random.Generator, segment_map: SegmentMap, pairs: IntArray
) -> tuple[IntArray, FloatArray]:
    """Pairs and headings of drawn segments: in beam order where there is one, directions drawn where there is none."""
    if segment_map.order is Order.BEAMS:
        pairs = np.sort(pairs, axis=1)
    headings = segment_map.headings[pairs]
    if not segment_map.directed.all():
        turned = generator.integers(2, size=pairs.shape).astype(bool) & ~segment_map.directed[pairs]
        headings = headings + math.pi * turned
    return pairs, headings


def _equal_drawn(
    map_1: SegmentMap,
    drawn_1: tuple[IntArray, FloatArray],
    map_2: SegmentMap,
    drawn_2: tuple[IntArray, FloatArray],
    parameters: Parameters,
) -> Candidates:
    """The candidates of the draws whose angles have a vertex and are equal (lines 8 to 10)."""
    (pairs_1, headings_1), (pairs_2, headings_2) = drawn_1, drawn_2
    difference = np.diff(headings_1)[:, 0] - np.diff(headings_2)[:, 0]
    meet = [_meet(headings, parameters.min_vertex_angle) for headings in (headings_1, headings_2)]
    keep = meet[0] & meet[1] & (np.abs(wrap(difference)) < parameters.angle_difference_tolerance)
    tracing.tell("draws", drawn_1=drawn_1, drawn_2=drawn_2, meet=meet, keep=keep)
    pairs_1, pairs_2 = pairs_1[keep], pairs_2[keep]
    headings_1, headings_2 = headings_1[keep], headings_2[keep]
    poses = _kernels.superimpose(
        headings_1, _vertices(map_1, pairs_1, headings_1), headings_2, _vertices(map_2, pairs_2, headings_2)
    )
    return Candidates(poses, pairs_1, pairs_2, draws=len(keep))


def _extreme_candidates(map_1: SegmentMap, map_2: SegmentMap) -> Iterator[Candidates]:
    """Beyond the paper: a segment of map 2 laid on one of map 1, starts, ends or middles together.

    Three candidates for each pair of segments, n_1 n_2 pairs; an undirected segment is laid both ways. Of partial
    maps with many segments the longest are taken.
    """
    chosen_1, chosen_2 = _chosen(map_1, map_2)
    first, second = (chosen.ravel() for chosen in np.meshgrid(chosen_1, chosen_2, indexing="ij"))
    either_way = ~(map_1.directed[first] & map_2.directed[second])
    for turn, rows in ((0.0, slice(None)), (math.pi, either_way)):
        i, j = first[rows], second[rows]
        theta = wrap(map_1.headings[i] - map_2.headings[j] + turn)
        for share in (0.0, 1.0, 0.5):
            anchor_1 = _along(map_1, i, share)
            anchor_2 = _along(map_2, j, 1.0 - share if turn else share)
            shift = anchor_1 - _turned(anchor_2, theta)
            pairs = np.repeat(np.stack((i, j))[..., None], 2, axis=-1)
            yield Candidates(np.column_stack((shift, theta)), *pairs)


def _chosen(map_1: SegmentMap, map_2: SegmentMap) -> tuple[IntArray, IntArray]:
    """The segments to lay on each other: all, or the longest of maps of which one is partial and that have too many."""
    sizes = len(map_1), len(map_2)
    if math.prod(sizes) <= MOST_LAID or Order.NONE not in (map_1.order, map_2.order):
        return np.arange(sizes[0]), np.arange(sizes[1])
    most = (max(math.isqrt(MOST_LAID), MOST_LAID // max(1, other)) for other in sizes[::-1])
    longest = (np.argsort(-m.lengths, kind="stable")[:count] for m, count in zip((map_1, map_2), most, strict=True))
    chosen_1, chosen_2 = (np.sort(rows) for rows in longest)
    return chosen_1, chosen_2


def _along(segment_map: SegmentMap, rows: IntArray, share: float) -> FloatArray:
    """Points of segments: 0 the start, 1 the end."""
    start, end = segment_map.coordinates[rows, :2], segment_map.coordinates[rows, 2:]
    return start + share * (end - start)


def _turned(points: FloatArray, theta: FloatArray) -> FloatArray:
    cosine, sine = np.cos(theta), np.sin(theta)
    x, y = points.T
    return np.stack((cosine * x - sine * y, sine * x + cosine * y), axis=-1)


class _Seen:
    """Poses seen so far, to the resolution above."""

    def __init__(self) -> None:
        self._keys = np.empty((0, 3), np.int64)
        self._table = np.empty(0, np.int64)
        self._filled = 0

    def new(self, poses: FloatArray) -> IntArray:
        """The rows of poses that were not seen before."""
        self._make_room(len(poses))
        rows: IntArray = _kernels.first_of_each(poses, POSE_RESOLUTION, self._keys, self._filled, self._table)
        self._filled += len(rows)
        return rows

    def _make_room(self, more: int) -> None:
        """Room for so many more keys; it grows at least twofold, and the keys held are placed anew."""
        if self._filled + more <= len(self._keys):
            return
        held, room = self._keys[: self._filled], max(self._filled + more, 2 * len(self._keys))
        self._keys = np.empty((room, 3), np.int64)
        self._keys[: self._filled] = held
        self._table = np.full(1 << (2 * room).bit_length(), -1)
        _kernels.place_keys(held, self._table)
