"""Explanations: the terms sum to the totals, each is what it says, and any pose can be explained."""

import math
from dataclasses import replace

import numpy as np
import plain_reading
import pytest
import simulated
from hypothesis import given, settings
from worlds import maps, poses

from segmap.chains import matching_chains
from segmap.evaluation import evaluate
from segmap.explanation import Explanation, explain
from segmap.integration import integrate, match_maps
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import SegmentMap
from segmap.visibility import CLASS_NAMES, classes, look, score, sighting

P = preset("verified")
WIDE = Parameters(point_distance_tolerance=0.3, segment_distance_threshold=8.0)
HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)
quick = settings(deadline=None, max_examples=100)


@pytest.fixture(scope="module")
def in_the_room():
    """Two scans of a furnished room, and their true pose."""
    return simulated.pair(simulated.room(), HERE, THERE, P, seed=3)


def told(explanation):
    """Everything an explanation of two maps with scans sums up, by map: returns and segments."""
    return [term for side in explanation.sights for term in side.returns], [
        term for side in explanation.sights for term in side.segments
    ]


# --- the value ------------------------------------------------------------------------------------


@given(maps(), maps(), poses)
@quick
def test_pairs_sum_to_the_value(map_1, map_2, T_1_2):
    """In index order to the last bit, where paper mode does not discard; chains to rounding."""
    found = explain(map_1, map_2, T_1_2, WIDE)
    value = evaluate(map_1, map_2, np.array([tuple(T_1_2)]), WIDE)[0]
    assert sum(pair.value for pair in found.pairs) == found.value
    assert found.discarded == math.isnan(value)
    assert found.discarded or found.value == value
    assert sum(chain.value for chain in found.chains) == pytest.approx(found.value, abs=1e-8)


@given(maps(), maps(), poses)
@quick
def test_every_pair_is_its_lengths_times_its_factor(map_1, map_2, T_1_2):
    """The mean of the two common lengths, times a factor that the distance alone decides."""
    for pair in explain(map_1, map_2, T_1_2, WIDE).pairs:
        assert pair.value == pytest.approx(0.5 * (pair.common_1 + pair.common_2) * pair.factor, abs=1e-9)
        tolerances = pair.distance / WIDE.point_distance_tolerance
        assert pair.factor == 1.0 or pair.factor == pytest.approx(WIDE.distance_penalty**tolerances)
        assert tolerances <= WIDE.segment_distance_threshold + 1e-9
        assert pair.common_1 <= map_1.lengths[pair.first] + 1e-9
        assert pair.common_2 <= map_2.lengths[pair.second] + 1e-9


@given(maps(), maps(), poses)
@quick
def test_chains_are_the_matching_chains(map_1, map_2, T_1_2):
    """The same chains in the same order, and every pair names its own."""
    found = explain(map_1, map_2, T_1_2, WIDE)
    chains = matching_chains(map_1, map_2, T_1_2, WIDE)
    assert [(chain.first, chain.second) for chain in found.chains] == [(chain.first, chain.second) for chain in chains]
    for place, chain in enumerate(chains):
        named = [(pair.first, pair.second, pair.value) for pair in found.pairs if pair.chain == place]
        assert named == list(chain.pairs)
        assert found.chains[place].value == pytest.approx(chain.value)


@given(maps(), maps(), poses)
@quick
def test_crossings_are_the_pairs_that_discard(map_1, map_2, T_1_2):
    """Each one alone discards, none other does, and the plain reading agrees."""
    narrow = Parameters(segment_length_refuse=0.5)
    found = {(c.first, c.second) for c in explain(map_1, map_2, T_1_2, narrow).crossings}
    pose = np.array([tuple(T_1_2)])
    for i in range(len(map_1)):
        for j in range(len(map_2)):
            alone = plain_reading.values(map_1.take([i]), map_2.take([j]), pose, narrow)
            assert ((i, j) in found) == math.isnan(alone[0])


def test_a_crossing_says_where_and_how():
    """Two walls of 4 m, crossing at right angles one metre up: the point in frame 1, and a quarter turn."""
    wall = SegmentMap([[0.0, -2.0, 0.0, 2.0]])
    other = SegmentMap([[-2.0, 0.0, 2.0, 0.0]])
    found = explain(wall, other, Pose2(0.5, 1.0, 0.0), P)
    (crossing,) = found.crossings
    assert found.discarded
    assert (crossing.x, crossing.y, crossing.angle) == pytest.approx((0.0, 1.0, math.pi / 2))


def test_the_value_is_that_of_the_match(in_the_room):
    """What paper and verified mode say of their candidates is what the explanation adds up to."""
    map_1, map_2, _ = in_the_room
    for mode in ("paper", "verified"):
        for candidate in match_maps(map_1, map_2, P, None, mode).ranked:
            found = explain(map_1, map_2, candidate.T_1_2, P)
            assert found.value == pytest.approx(candidate.value, abs=1e-9)
            assert mode == "verified" or not found.discarded


# --- the score ------------------------------------------------------------------------------------


@pytest.mark.parametrize("shift", [0.0, 0.1, 0.7, 30.0])
def test_returns_and_segments_sum_to_the_score(in_the_room, shift):
    """By return, by segment and by kind of evidence: at the true pose, near it, off it and nowhere near."""
    map_1, map_2, truth = in_the_room
    T_1_2 = Pose2(truth.x + shift, truth.y - shift, truth.theta + shift / 3.0)
    found = explain(map_1, map_2, T_1_2, P)
    seen = sighting(map_1), sighting(map_2)
    totals = look(*seen, np.array([tuple(T_1_2)]), P)
    assert found.score == score(totals, P)[0]
    assert [getattr(found.evidence, name) for name in CLASS_NAMES] == totals[0].tolist()
    assert sum(found.terms.values()) == pytest.approx(found.score, abs=1e-12)
    for terms in told(found):
        assert math.fsum(term.score for term in terms) == pytest.approx(found.score, abs=1e-9)
    for name, metres in zip(CLASS_NAMES, totals[0], strict=True):
        returns, segments = told(found)
        assert math.fsum(term.width for term in returns if term.seen == name) == pytest.approx(metres, abs=1e-9)
        assert math.fsum(getattr(term.evidence, name) for term in segments) == pytest.approx(metres, abs=1e-9)


def test_every_return_is_there_once_and_says_what_is_seen(in_the_room):
    """Place, width and class of each, as lines of sight have them; its segment runs by it, and counts it."""
    map_1, map_2, truth = in_the_room
    found = explain(map_1, map_2, truth, P)
    seen = sighting(map_1), sighting(map_2)
    for segment_map, side, by, kinds in zip((map_1, map_2), found.sights, seen, classes(*seen, truth, P), strict=True):
        assert [(term.x, term.y, term.width) for term in side.returns] == [tuple(row) for row in by.points.tolist()]
        assert [term.seen for term in side.returns] == [CLASS_NAMES[kind] for kind in kinds]
        for term in side.segments:
            own = [one for one in side.returns if one.segment == term.segment]
            assert math.fsum(one.score for one in own) == pytest.approx(term.score, abs=1e-9)
        for one in side.returns:
            if one.segment is not None:
                x1, y1, x2, y2 = segment_map.coordinates[one.segment]
                along = np.array((x2 - x1, y2 - y1)) / math.dist((x1, y1), (x2, y2))
                assert abs(along[0] * (one.y - y1) - along[1] * (one.x - x1)) < 0.1
        on_walls = sum(one.width for one in side.returns if one.segment is not None)
        assert on_walls > 0.8 * sum(one.width for one in side.returns)


def test_returns_of_a_fused_map_sum_to_the_score(in_the_room):
    """Of several scans each place counts once and no more is unseen than of one: by return, by segment, in sum."""
    map_1, map_2, truth = in_the_room
    fused = integrate(map_1, map_2, P, mode="verified").map
    for T_1_2 in (truth, Pose2(truth.x + 0.5, truth.y, truth.theta), Pose2(40.0, 0.0, 0.0)):
        found = explain(fused, map_2, T_1_2, P)
        for terms in told(found):
            assert math.fsum(term.score for term in terms) == pytest.approx(found.score, abs=1e-9)
        for name in CLASS_NAMES:
            metres = math.fsum(term.width for side in found.sights for term in side.returns if term.seen == name)
            assert metres == pytest.approx(getattr(found.evidence, name), abs=1e-9)


def test_what_speaks_against_a_pose_is_found_where_it_is(in_the_room):
    """With a wall taken out of the second map's scan, the first map's returns on it are contradicted, no others."""
    map_1, _, _ = in_the_room
    scan = map_1.sights[0].scan
    ranges = scan.ranges.copy()
    ranges[60:90] += 3.0
    through = replace(map_1, sights=(replace(map_1.sights[0], scan=replace(scan, ranges=ranges)),))
    side, _ = explain(map_1, through, Pose2.identity(), P).sights
    against = [k for k, one in enumerate(side.returns) if one.seen == "contradicted"]
    assert set(against) <= set(range(60, 90))
    assert len(against) > 25
    assert min(side.segments, key=lambda term: term.score).evidence.contradicted > 0.5


# --- whatever is asked ----------------------------------------------------------------------------


def test_json_keeps_it(in_the_room):
    """Stored and read, nothing is lost; with and without lines of sight."""
    for sights in (True, False):
        found = explain(*in_the_room, P, sights=sights)
        assert Explanation.from_json(found.to_json()) == found
        assert (found.score is None) == (found.sights is None) == (not sights)


def test_maps_without_sights_have_a_value_alone(in_the_room):
    """Segments without scans, on either side: pairs and chains, no score."""
    map_1, map_2, truth = in_the_room
    blind = map_2.take(range(len(map_2)))
    for one, other in ((map_1, blind), (blind, map_1)):
        assert explain(one, other, truth, P).score is None
    assert explain(map_1, blind, truth, P).pairs == explain(map_1, map_2, truth, P).pairs


def test_nothing_is_explained_as_nothing():
    """Empty maps: a value of zero from no pairs."""
    found = explain(SegmentMap.empty(), SegmentMap.empty(), Pose2(1.0, 2.0, 3.0), P)
    assert (found.value, found.pairs, found.chains, found.crossings) == (0.0, (), (), ())
    assert not found.discarded
