"""INTEGRATE in paper mode against a plain numpy reading, on real pairs and on hard maps."""

import math

import numpy as np
import plain_reading as plain
import pytest
import real_pairs
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from worlds import maps, poses, room

from segmap.candidates import PAPER_HEURISTICS, Candidates, candidates
from segmap.errors import CancelledError, ParameterError
from segmap.evaluation import best, evaluate, matching_values
from segmap.integration import Match, Verdict, integrate, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import Order, SegmentMap, extract

LITERAL = preset("paper-lab").replace(min_segment_length=0.15)
COMPARED = ("all", "consecutive", "histogram")
quick = settings(deadline=None, max_examples=60)


def found(map_1, map_2, heuristic, parameters):
    return Candidates.joined(list(candidates(map_1, map_2, heuristic, parameters)))


def assert_same_poses(some, others):
    """Two sets of poses agree to 1e-6, and neither holds a pose that the other lacks."""
    for a, b in ((some, others), (others, some)):
        if len(a):
            assert cKDTree(as_points(b)).query(as_points(a))[0].max() < 1e-6


def as_points(poses):
    return np.column_stack((poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])))


def assert_same_as_plain(map_1, map_2, heuristic, parameters):
    """The same candidates, the same values to 1e-9, the same best unless values tie."""
    ours = found(map_1, map_2, heuristic, parameters)
    assert_same_poses(ours.poses, plain.candidates(map_1, map_2, heuristic, parameters))
    expected = plain.values(map_1, map_2, ours.poses, parameters)
    values = evaluate(map_1, map_2, ours.poses, parameters)
    np.testing.assert_allclose(values, expected, atol=1e-9)
    match = match_maps(map_1, map_2, parameters, heuristic)
    if not (expected > 1e-9).any():
        assert match.value < 1e-9
        return
    assert match.value == pytest.approx(np.nanmax(expected), abs=1e-9)
    ties = np.flatnonzero(expected >= np.nanmax(expected) - 1e-9)
    assert match.best.index in ties
    assert tuple(match.T_1_2) == pytest.approx(ours.poses[match.best.index], abs=1e-12)


@pytest.mark.parametrize("heuristic", COMPARED)
@pytest.mark.parametrize("parameters", [Parameters(), LITERAL])
@pytest.mark.slow
def test_real_pairs_give_what_the_plain_reading_gives(benchmarks, datasets, heuristic, parameters):
    """At least 50 pairs of five real logs: candidates, best value and pose are those of brute force in numpy.

    Pairs of more than 3,000 candidates are left out: numpy takes seconds for each.
    """
    compared = 0
    for log, pair in real_pairs.some(benchmarks, datasets, each=8):
        maps_of_pair = real_pairs.maps(pair, log, parameters)
        if len(found(*maps_of_pair, heuristic, parameters)) <= 3000:
            assert_same_as_plain(*maps_of_pair, heuristic, parameters)
            compared += 1
    assert compared >= 50


@given(maps(most=5), maps(most=5), st.sampled_from(COMPARED), st.booleans(), st.sampled_from([0.0, 0.2]))
@quick
def test_hard_maps_give_what_the_plain_reading_gives(map_1, map_2, heuristic, strict, refuse_angle):
    """Parallel, touching, undirected and unordered segments: as in the plain reading."""
    parameters = Parameters(consecutive_strict=strict, refuse_angle=refuse_angle, min_vertex_angle=0.1234)
    assert_same_poses(
        found(map_1, map_2, heuristic, parameters).poses, plain.candidates(map_1, map_2, heuristic, parameters)
    )


@given(maps(most=6), maps(most=6), poses)
@quick
def test_values_are_those_of_the_plain_reading(map_1, map_2, T):
    """Any pose of any two maps has the value the formulas give, except on the edge of a condition."""
    parameters = Parameters(point_distance_tolerance=0.2)
    rows = np.array([tuple(T)])
    value, expected = evaluate(map_1, map_2, rows, parameters), plain.values(map_1, map_2, rows, parameters)
    nudged = plain.values(map_1, map_2, rows + np.array([1e-7, -1e-7, 1e-7]), parameters)
    if np.isnan(nudged) == np.isnan(expected) and (np.isnan(expected) or abs(nudged - expected) < 1e-5):
        np.testing.assert_allclose(value, expected, atol=1e-9)


@given(maps(most=6), maps(most=6), poses)
@quick
def test_matching_values_sum_to_the_value(map_1, map_2, T):
    """What each pair of segments adds is the whole value."""
    parameters = Parameters(segment_length_refuse=100.0, point_distance_tolerance=0.3)
    pairs, values = matching_values(map_1, map_2, T, parameters)
    assert values.sum() == pytest.approx(evaluate(map_1, map_2, np.array([tuple(T)]), parameters)[0], abs=1e-6)
    assert (values > 0.0).all()
    assert [tuple(p) for p in pairs] == sorted(tuple(p) for p in pairs)


@given(maps(most=6), maps(most=6), poses, poses)
@quick
def test_matching_does_not_change_when_both_maps_move(map_1, map_2, T, T_1_2):
    """The value depends on the maps' relative pose alone."""
    parameters = Parameters(segment_length_refuse=100.0, point_distance_tolerance=0.3)
    here = matching_values(map_1, map_2, T_1_2, parameters)[1].sum()
    T_moved = T @ T_1_2 @ T.inverse()
    there = matching_values(map_1.moved(T), map_2.moved(T), T_moved, parameters)[1].sum()
    assert there == pytest.approx(here, abs=1e-6) or here == pytest.approx(there, rel=0.2)


@pytest.mark.parametrize(("parameters", "least"), [(LITERAL, 500), (Parameters(), 498)])
def test_a_moved_copy_is_recovered(datasets, parameters, least):
    """Of 500 real scans, each moved, the pose comes back to 1e-6.

    With the wide tolerance of the default, another pose can be worth more than the true one, where walls
    of one scan match each other: at most two of 500.
    """
    generator = np.random.default_rng(1)
    log = read_log(datasets / "intel" / "intel-corrected.log.gz")
    maps_of = (extract(scan, parameters) for scan in log.scans)
    usable = [m for m in maps_of if has_an_angle(m, parameters)][:500]
    assert len(usable) == 500
    recovered = 0
    for segment_map in usable:
        T_1_2 = Pose2(*generator.uniform(-5, 5, 2), generator.uniform(-math.pi, math.pi))
        match = match_maps(segment_map, segment_map.moved(T_1_2.inverse()), parameters)
        back = max(match.T_1_2.distance(T_1_2)) < 1e-6
        identity = np.array([tuple(T_1_2)])
        assert back or match.value > evaluate(segment_map, segment_map.moved(T_1_2.inverse()), identity, parameters)[0]
        recovered += back
    assert recovered >= least


def has_an_angle(segment_map, parameters):
    return len(found(segment_map, segment_map, "all", parameters)) > 0


# --- the heuristics -------------------------------------------------------------------------------


def test_one_room_in_two_poses():
    """Four walls: every heuristic finds the pose, or one of the turns that look the same."""
    T_1_2 = Pose2(0.7, -0.4, 0.3)
    map_2 = room().moved(T_1_2.inverse())
    for heuristic in PAPER_HEURISTICS:
        match = match_maps(room(), map_2, Parameters(), heuristic)
        turned = [T_1_2, T_1_2 @ Pose2(0.0, 0.0, math.pi)]
        assert match.value == pytest.approx(14.0)
        assert min(sum(match.T_1_2.distance(T)) for T in turned) < 1e-9
        assert match.verdict is Verdict.ACCEPTED
        assert len(match.chains) == 4
        assert sum(chain.value for chain in match.chains) == pytest.approx(match.value)


def test_undirected_and_unordered_maps_are_tried_both_ways():
    """A map whose directions are lost and whose order is shuffled is matched all the same."""
    T_1_2 = Pose2(0.7, -0.4, 0.3)
    there = room().moved(T_1_2.inverse()).coordinates[[2, 0, 3, 1]]
    there[1] = there[1][[2, 3, 0, 1]]
    lost = SegmentMap(there, Order.NONE, np.array([True, False, True, True]))
    for heuristic in ("all", "consecutive", "histogram"):
        assert match_maps(room(), lost, Parameters(), heuristic).value == pytest.approx(14.0)
        assert match_maps(lost, room(), Parameters(), heuristic).value == pytest.approx(14.0)


def test_no_pose_is_evaluated_twice():
    """Random draws repeat; the poses evaluated are all different, and fewer than the draws."""
    match = match_maps(room(), room(), Parameters(), "random")
    assert match.draws == 20 * (2**10 - 2)
    blocks = found(room(), room(), "random", Parameters())
    assert match.candidates == len(blocks) == len(np.unique(blocks.poses.round(9), axis=0))


def test_random_is_the_same_for_the_same_seed():
    """The draws are those of the seed; a good enough value stops them early."""
    world = SegmentMap(np.random.default_rng(3).uniform(-4, 4, (12, 4)), Order.BEAMS)
    parameters = Parameters(segment_length_refuse=100.0)
    first, again = (match_maps(world, world, parameters, "random") for _ in range(2))
    assert first.ranked == again.ranked
    assert first.ranked != match_maps(world, world, parameters.replace(seed=1), "random").ranked
    early = match_maps(world, world, parameters.replace(good_enough=0.001), "random")
    assert early.draws < first.draws


def test_random_skips_rounds_without_two_long_segments():
    """One long wall and short ones: rounds that could only pick the wall make no draws."""
    walls = SegmentMap(np.array([[0, 0, 8.0, 0], [0, 1, 0, 2.0], [1, 1, 2, 1.0]]), Order.BEAMS)
    match = match_maps(walls, walls, Parameters(random_rounds=4), "random")
    assert match.draws == 20 * 2**4  # only 0.5^4 * 8 m is below 1 m


# --- plain answers to poor input ------------------------------------------------------------------

ONE = SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0]]), Order.BEAMS)
CORNER = SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.0, 1.0]]), Order.BEAMS)
OBTUSE = SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.5, 0.5]]), Order.BEAMS)


@pytest.mark.parametrize("heuristic", PAPER_HEURISTICS)
@pytest.mark.parametrize(
    ("map_1", "map_2", "told"),
    [
        (SegmentMap.empty(), CORNER, "first map has no segments"),
        (CORNER, SegmentMap.empty(), "second map has no segments"),
        (ONE, CORNER, "first map has one segment"),
        (CORNER, OBTUSE, "No angle"),
    ],
)
def test_nothing_to_match_is_said(map_1, map_2, told, heuristic):
    """No segments, one segment, no equal angle: rejected, with the reason."""
    integration = integrate(map_1, map_2, Parameters(), heuristic)
    assert integration.match.verdict is Verdict.REJECTED
    assert told in integration.match.reasons[0]
    assert integration.match.T_1_2 is integration.map is None


def test_long_segments_that_cross_are_said():
    """Where every candidate is discarded, the reason says so."""
    cross = SegmentMap(np.array([[-2.0, 0.0, 2.0, 0.0], [0.0, -2.0, 0.0, 2.0]]), Order.BEAMS)
    turned = SegmentMap(np.array([[0.0, 0.0, 4.0, 0.0], [2.0, 1.0, 2.0, 5.0]]), Order.BEAMS)
    match = match_maps(cross, turned, Parameters())
    assert match.discarded == match.candidates > 0
    assert "discarded" in match.reasons[0]


def test_shared_corners_are_no_crossing():
    """Walls that meet at a corner do not discard the true pose, under either rule."""
    for refuse_angle in (0.0, 0.2):
        match = match_maps(room(), room(), Parameters(refuse_angle=refuse_angle))
        assert match.T_1_2.distance(Pose2.identity())[0] == pytest.approx(0.0, abs=1e-9)


def test_an_unknown_heuristic_or_mode_is_told():
    """The error lists what there is."""
    with pytest.raises(ParameterError, match="consecutive"):
        match_maps(CORNER, CORNER, Parameters(), "best")
    with pytest.raises(ParameterError, match="paper"):
        match_maps(CORNER, CORNER, Parameters(), "all", "guess")


def test_a_search_can_be_stopped():
    """Whatever the check raises ends the search."""

    def stop():
        raise CancelledError("stopped")

    with pytest.raises(CancelledError):
        match_maps(CORNER, CORNER, Parameters(), check=stop)


def test_threads_change_nothing():
    """Values are the same to the last bit on one thread and on several."""
    world = SegmentMap(np.random.default_rng(5).uniform(-4, 4, (40, 4)), Order.BEAMS)
    poses = found(world, world, "all", Parameters()).poses
    assert len(poses) > 3 * 4096
    one, several = (evaluate(world, world, poses, Parameters(), workers=w) for w in (1, 3))
    assert np.array_equal(one, several, equal_nan=True)


def test_best_breaks_ties_by_index():
    """Best first, discarded and worthless ones never, the lower index where values tie."""
    values = np.array([1.0, np.nan, 3.0, 0.0, 3.0, 2.0])
    assert best(values, 3).tolist() == [2, 4, 5]
    assert best(values, 1).tolist() == [2]
    assert best(values, 99).tolist() == [2, 4, 5, 0]


def test_a_match_survives_json():
    """What is stored is what was found."""
    match = match_maps(room(), room(), Parameters(), "random")
    assert Match.from_json(match.to_json()) == match
    strict, lax = Parameters(value_threshold=99.0), Parameters(value_threshold=1.0)
    assert match.judged(strict).verdict is Verdict.REJECTED
    assert match.judged(strict).judged(lax) == match.judged(lax)
