"""INTEGRATE where partial maps take part: what is tried of many segments, and what the sights of many scans say."""

import numpy as np
import pytest
import simulated

from segmap.candidates import MOST_LAID, candidates
from segmap.integration import Verdict, match_maps
from segmap.merging.components import fused
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import Order, SegmentMap, extract
from segmap.verified_mode import MOST_ANGLES

V = preset("verified")
PLACES = [Pose2(1.2 + 0.5 * i, 1.6 + 0.3 * (i % 3), 0.5 * i) for i in range(7)]


def scattered(count, seed, order):
    """Segments of all lengths, anywhere."""
    generator = np.random.default_rng(seed)
    start, heading = generator.uniform(-10.0, 10.0, (count, 2)), generator.uniform(-np.pi, np.pi, count)
    way = generator.uniform(0.1, 3.0, count)[:, None] * np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    return SegmentMap(np.concatenate((start, start + way), axis=1), order)


def laid(map_1, map_2):
    """Which segments ``extremes`` lays on each other."""
    found = list(candidates(map_1, map_2, "extremes", Parameters()))
    return [{int(row) for block in found for row in getattr(block, side)[:, 0]} for side in ("angles_1", "angles_2")]


@pytest.mark.parametrize(("sizes", "taken"), [((200, 100), (81, 81)), ((700, 12), (550, 12)), ((60, 60), (60, 60))])
def test_of_many_segments_the_longest_are_laid_on_each_other(sizes, taken):
    """No more pairs than the bound, the longest of either map, more of one where the other is small."""
    maps = [scattered(size, seed, Order.NONE) for seed, size in enumerate(sizes)]
    for segment_map, rows, count in zip(maps, laid(*maps), taken, strict=True):
        longest = np.argsort(-segment_map.lengths, kind="stable")[:count]
        assert rows == set(longest.tolist())
    assert taken[0] * taken[1] <= MOST_LAID


def test_of_scans_all_segments_are_laid_on_each_other():
    """The bound is for partial maps alone."""
    maps = [scattered(100, seed, Order.BEAMS) for seed in (0, 1)]
    assert [len(rows) for rows in laid(*maps)] == [100, 100]


def building(world, places, seed):
    """A map of scans of a world, in the frame of the first."""
    whole, *rest = (extract(simulated.noisy(world, T, seed + i, 12.0), V, 0, i) for i, T in enumerate(places))
    for scan, T in zip(rest, places[1:], strict=True):
        whole = fused(whole, scan, places[0].inverse() @ T, V)
    return whole


@pytest.mark.parametrize("new", [3, 5])
def test_a_scan_finds_its_place_in_a_map(new):
    """With the evidence of all the map's scans it is accepted, and right; so are two maps of the same room."""
    rest = [T for i, T in enumerate(PLACES) if i != new]
    whole = building(simulated.room(), rest, 10)
    scan = building(simulated.room(), PLACES[new : new + 1], 50)
    match = match_maps(whole, scan, V, None, "verified")
    assert match.verdict is Verdict.ACCEPTED
    metres, radians = match.T_1_2.distance(rest[0].inverse() @ PLACES[new])
    assert metres < 0.05
    assert radians < 0.02
    halves = building(simulated.room(), PLACES[:4], 70), building(simulated.room(), PLACES[3:], 90)
    match = match_maps(*halves, V, None, "verified")
    assert match.verdict is Verdict.ACCEPTED
    assert match.T_1_2.distance(PLACES[0].inverse() @ PLACES[3])[0] < 0.05


def test_a_scan_of_another_room_has_no_place_in_a_map():
    """However large the map, and however many its sights."""
    whole = building(simulated.room(), PLACES, 10)
    for T in (Pose2(1.2, 2.0, 0.3), Pose2(2.0, 6.0, 2.0)):
        match = match_maps(whole, building(simulated.other_room(), [T], 5), V, None, "verified")
        assert match.verdict is not Verdict.ACCEPTED


def test_automatic_does_not_try_all_angles_of_large_maps():
    """What it tries stays below what laying segments on each other gives, both ways, where ``all`` has too many."""
    whole = building(simulated.room(), PLACES, 10)
    clutter = scattered(60, 3, Order.NONE)
    large = SegmentMap.joined([whole, clutter])
    pairs = (len(large) * (len(large) - 1) // 2) ** 2
    assert pairs > MOST_ANGLES
    match = match_maps(large, SegmentMap.joined([large.moved(Pose2(50.0, 0.0, 0.0))]), V, None, "verified")
    assert match.candidates <= 6 * MOST_LAID
