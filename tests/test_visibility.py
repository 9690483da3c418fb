"""Lines of sight: what the beams of one map say of the returns of another."""

import math

import numpy as np
import plain_sight as plain
import pytest
import real_pairs
import simulated
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from simulated import DEGREE, alone, exact, read_backwards, sight_map

from segmap._sight_kernels import CLASSES, CONTRADICTED, SHADOWED, SUPPORTED, UNSEEN
from segmap.chains import matching_chains
from segmap.fusion import fuse
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import SegmentMap, extract
from segmap.visibility import Evidence, classes, evidence, look, score, sighting, thinned

HERE = Pose2(2.0, 2.5, 0.4)
THERE = Pose2(3.1, 2.2, -0.5)
SHIFTED = HERE.inverse() @ THERE @ Pose2(0.15, -0.1, 0.06)
ROUND = {"beams": 360, "first": -math.pi}
SEAM = {"beams": 359, "first": 1.0, "step": 2.0 * math.pi / 359.4}  # last and first beam are 1.4 steps apart
COARSE = {"beams": 45, "first": -1.1, "step": 0.05}
quick = settings(deadline=None, max_examples=40)


def somewhere(generator, sights, count=150):
    """Points of a map: at random, and near what its sensors saw, where most of the borders are."""
    returns = np.concatenate([sight.T_map_sensor @ sight.scan.returns()[0] for sight in sights])
    near = returns * generator.uniform(0.7, 1.3, (len(returns), 1)) + generator.uniform(-0.1, 0.1, returns.shape)
    return np.concatenate((generator.uniform(-5.0, 8.0, (count, 2)), near))


def classified(segment_map, points, T=None, parameters=None):
    """The class of points of another map by the sensors of this one."""
    seen = sighting(segment_map)
    others = seen._replace(points=np.column_stack((points, np.ones(len(points)))))
    return classes(seen, others, T or Pose2.identity(), parameters or Parameters())[1]


def assert_as_plain(segment_map, points, parameters=None, clearance=1e-6):
    """Every point clear of the borders has the class of the plain reading; few are not clear."""
    parameters = parameters or Parameters()
    expected, clear = plain.classes(segment_map.sights, points, parameters)
    found = classified(segment_map, points, parameters=parameters)
    assert np.array_equal(found[clear > clearance], expected[clear > clearance])
    assert (clear > clearance).mean() > 0.95
    return found


# --- against the plain reading --------------------------------------------------------------------


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("laser", [{}, ROUND, {"beams": 120, "step": 3 * DEGREE}, COARSE, {"reach": 3.0}])
def test_points_are_seen_as_in_the_plain_reading(laser, backwards):
    """Half a turn, all round, coarse and short-sighted lasers, forwards and backwards: all four classes."""
    scan = exact(simulated.room(), HERE, **laser)
    sensor = sight_map((Pose2(0.3, -0.2, 2.0), read_backwards(scan) if backwards else scan))
    found = assert_as_plain(sensor, somewhere(np.random.default_rng(1), sensor.sights))
    assert set(found) == {SUPPORTED, CONTRADICTED, SHADOWED, UNSEEN}


def test_the_seam_of_an_all_round_scan_is_no_gap():
    """Between the last beam and the first, points are judged as between any others."""
    for laser in (ROUND, SEAM):
        scan = exact(simulated.room(), HERE, **laser)
        seam = scan.first_angle - np.linspace(0.05, 0.95, 7)[:, None] * DEGREE
        points = (np.linspace(0.3, 4.0, 40) * np.stack((np.cos(seam), np.sin(seam)))).reshape(2, -1).T
        found = assert_as_plain(alone(scan), points)
        assert {SUPPORTED, CONTRADICTED, SHADOWED} <= set(found)


@given(
    npst.arrays(float, st.integers(1, 24), elements=st.one_of(st.floats(0.3, 5.0), st.just(math.nan))),
    st.sampled_from([0.05, 0.1, math.pi / 12.0]),
    st.integers(0, 9),
)
@quick
def test_any_ranges_are_read_as_in_the_plain_reading(ranges, step, seed):
    """Ranges that jump, beams without return, one beam: as in the plain reading, either way round."""
    if np.isnan(ranges).all():
        return
    forwards = LaserScan(ranges, -0.4, step)
    points = np.random.default_rng(seed).uniform(-5.0, 5.0, (60, 2))
    for scan in (forwards, read_backwards(forwards)):
        expected, clear = plain.classes(alone(scan).sights, points, Parameters())
        found = classified(alone(scan), points)
        assert np.array_equal(found[clear > 1e-6], expected[clear > 1e-6])


def test_real_pairs_are_seen_as_in_the_plain_reading(benchmarks, datasets):
    """Ten pairs of five real logs, at their true poses and beside them."""
    for log, pair in real_pairs.some(benchmarks, datasets, each=1, kinds=("consecutive", "wide")):
        sensor = alone(log[pair.i])
        points = sighting(alone(log[pair.j])).points[::2, :2]
        assert_as_plain(sensor, pair.truth @ points)
        assert_as_plain(sensor, (pair.truth @ Pose2(0.3, 0.2, 0.1)) @ points)


def test_a_surface_bulges_towards_the_sensor():
    """The line between two returns passes in front of both, and supports what is near it."""
    coarse = alone(LaserScan(np.full(9, 0.9), 0.0, 15.0 * DEGREE))
    heading = 52.5 * DEGREE
    in_front = np.linspace(0.68, 0.71, 31)[:, None] * (math.cos(heading), math.sin(heading))
    assert set(assert_as_plain(coarse, in_front)) == {SUPPORTED, CONTRADICTED}


def test_the_tolerances_are_the_parameters():
    """A wider tolerance and a deeper shadow are those of the plain reading, too."""
    sensor = alone(exact(simulated.room(), HERE))
    points = somewhere(np.random.default_rng(2), sensor.sights)
    for parameters in (Parameters(sight_tolerance=0.05), Parameters(shadow_depth=0.0), Parameters(shadow_depth=2.0)):
        assert_as_plain(sensor, points, parameters)


def test_totals_are_the_classes_in_metres():
    """Each return adds its width to the total of its class, both ways; every return is in one class."""
    seen_1, seen_2 = (sighting(alone(exact(simulated.room(), T))) for T in (HERE, THERE))
    totals = look(seen_1, seen_2, np.array([tuple(SHIFTED)]), Parameters())[0]
    of_1, of_2 = classes(seen_1, seen_2, SHIFTED, Parameters())
    both, widths = np.concatenate((of_1, of_2)), np.concatenate((seen_1.points[:, 2], seen_2.points[:, 2]))
    assert totals == pytest.approx(np.bincount(both, weights=widths, minlength=CLASSES))
    assert totals.sum() == pytest.approx(widths.sum())


# --- laws -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("laser", [{}, ROUND, {"beams": 181, "step": -DEGREE, "first": 1.5}])
def test_a_scan_supports_itself(laser):
    """Under the identity every return is supported, and nothing is contradicted or even unseen."""
    seen = sighting(alone(exact(simulated.room(), HERE, **laser)))
    totals = look(seen, seen, np.zeros((1, 3)), Parameters())[0]
    assert totals[1:].tolist() == [0.0, 0.0, 0.0]
    assert totals[0] == pytest.approx(2.0 * seen.points[:, 2].sum())
    assert evidence(totals).agreement == evidence(totals).overlap == 1.0


@given(npst.arrays(float, st.integers(1, 361), elements=st.floats(0.01, 80.0)), st.floats(-math.pi, math.pi))
@quick
def test_any_scan_supports_itself(ranges, first):
    """Whatever the ranges, forwards and backwards, half or all round."""
    for scan in (LaserScan(ranges, first, DEGREE), LaserScan(ranges, first, -DEGREE)):
        found = classified(alone(scan), scan.returns()[0])
        assert set(found) == {SUPPORTED}


def test_a_pose_and_its_inverse_say_the_same():
    """With the maps swapped and the pose inverted, the totals are the same."""
    seen_1, seen_2 = (sighting(alone(exact(simulated.room(), T))) for T in (HERE, THERE))
    there, back = (
        look(one, other, np.array([tuple(T)]), Parameters())
        for one, other, T in ((seen_1, seen_2, SHIFTED), (seen_2, seen_1, SHIFTED.inverse()))
    )
    assert there == pytest.approx(back)


def test_moving_both_maps_changes_nothing():
    """The totals depend on how the maps lie to each other alone."""
    map_1, map_2 = (alone(exact(simulated.room(), T)) for T in (HERE, THERE))
    T_1, T_2 = Pose2(40.0, -7.0, 2.5), Pose2(-3.0, 11.0, -1.2)
    here = look(sighting(map_1), sighting(map_2), np.array([tuple(SHIFTED)]), Parameters())
    T_moved = T_1 @ SHIFTED @ T_2.inverse()
    moved = sighting(map_1.moved(T_1)), sighting(map_2.moved(T_2))
    assert look(*moved, np.array([tuple(T_moved)]), Parameters()) == pytest.approx(here)


@pytest.mark.parametrize("laser", [{}, ROUND, {"reach": 3.0}])
def test_a_scan_read_backwards_sees_the_same(laser):
    """Clockwise or counter-clockwise is a matter of writing, beams without a return included."""
    scans = [exact(simulated.room(), T, **laser) for T in (HERE, THERE)]
    seen = [sighting(alone(scan)) for scan in scans]
    backwards = [sighting(alone(read_backwards(scan))) for scan in scans]
    poses = np.array([tuple(SHIFTED), (0.4, -0.7, 2.0)])
    assert look(*backwards, poses, Parameters()) == pytest.approx(look(*seen, poses, Parameters()))


def test_the_true_pose_scores_best():
    """Of a thousand poses around the truth none beats it, and what is far off scores much less."""
    seen_1, seen_2 = (sighting(alone(exact(simulated.room(), T))) for T in (HERE, THERE))
    generator, T_1_2 = np.random.default_rng(3), np.array(tuple(HERE.inverse() @ THERE))
    poses = T_1_2 + generator.uniform(-1.0, 1.0, (1000, 3)) * generator.uniform(0.0, 1.0, (1000, 1))
    scores = score(look(seen_1, seen_2, np.vstack((T_1_2, poses)), Parameters()), Parameters())
    assert scores.max() < scores[0] + 0.5
    far = np.hypot(*(poses - T_1_2)[:, :2].T) > 0.4
    assert far.any()
    assert scores[1:][far].max() < 0.7 * scores[0]


def test_a_return_weighs_as_wide_as_its_beam():
    """Range times the angle between beams, and never more than half a metre."""
    ranges = np.array([1.0, 10.0, 28.0, 29.0, 80.0])
    widths = sighting(alone(LaserScan(ranges, 0.0, DEGREE))).points[:, 2]
    assert widths == pytest.approx(np.minimum(ranges * DEGREE, 0.5))
    backwards = sighting(alone(LaserScan(ranges, 0.0, -DEGREE))).points[:, 2]
    assert backwards == pytest.approx(widths)


@pytest.mark.parametrize(("most", "share"), [(24, 0.1), (40, 0.06), (180, 0.02)])
def test_thinning_keeps_the_weight(most, share):
    """At most about as many returns as asked for, the same sensors, the total weight to within a few percent."""
    for world in (simulated.room(), simulated.other_room()):
        seen = sighting(alone(exact(world, Pose2(1.5, 1.5, 0.2), beams=361, first=-math.pi)))
        few = thinned(seen, most)
        assert len(few.points) <= 1.5 * most
        assert few.points[:, 2].sum() == pytest.approx(seen.points[:, 2].sum(), rel=share)
        assert few.beams is seen.beams
        assert few.sensors is seen.sensors


def test_a_wall_at_a_grazing_angle_goes_on():
    """Along a corridor returns lie metres apart, and what lies between them is supported: any shift is as good."""
    world = simulated.corridor(2.0)
    here, there = (alone(exact(world, Pose2(x, 1.0, 0.0), reach=14.0)) for x in (100.0, 100.7))
    T_1_2 = Pose2(0.7, 0.0, 0.0)
    _, found = classes(sighting(here), sighting(there), T_1_2, Parameters())
    points = T_1_2 @ sighting(there).points[:, :2]
    far = (points[:, 0] > 6.0) & (points[:, 0] < 11.0)
    assert far.sum() > 6
    assert (found[far] == SUPPORTED).all()


def test_the_edge_of_a_thing_does_not_go_on_to_what_is_behind_it():
    """A box before a wall, near and far: nothing is joined across the jump."""
    for near in (0.4, 1.5, 4.0):
        ranges = np.full(90, near + 2.5) / np.cos((np.arange(90) - 45.0) * DEGREE)
        ranges[35:55] = near / np.cos((np.arange(35, 55) - 45.0) * DEGREE)
        beams = sighting(alone(LaserScan(ranges, -math.pi / 4.0, DEGREE))).beams
        assert not beams[[34, 54], 5].any()


def test_returns_beyond_the_range_asked_for_are_none():
    """max_range limits lines of sight as it limits segments: no point, no free space up to it."""
    scan = exact(simulated.room(), HERE)
    seen = sighting(alone(scan), 2.5)
    assert len(seen.points) == (scan.ranges <= 2.5).sum()
    assert np.isnan(seen.beams[scan.ranges > 2.5, 2]).all()
    near = LaserScan(np.where(scan.ranges <= 2.5, scan.ranges, np.nan), scan.first_angle, scan.angle_step)
    assert np.array_equal(seen.beams, sighting(alone(near)).beams, equal_nan=True)
    assert sighting(alone(scan), 0.01) is None
    for far in (None, 100.0):
        assert np.array_equal(sighting(alone(scan), far).beams, sighting(alone(scan)).beams, equal_nan=True)


# --- several sensors ------------------------------------------------------------------------------


def test_the_same_scan_many_times_counts_once():
    """A map of one scan, twice or ten times over, has as many metres of each class as that scan."""
    scans = [(Pose2.identity(), exact(simulated.room(), T)) for T in (HERE, THERE)]
    poses = np.array([tuple(SHIFTED), (0.4, -0.7, 2.0), (90.0, 0.0, 0.0)])
    once = look(*(sighting(sight_map(scan)) for scan in scans), poses, Parameters())
    for times in ((2, 1), (1, 10), (3, 5)):
        often = [sighting(sight_map(*[scan] * n)) for scan, n in zip(scans, times, strict=True)]
        assert look(*often, poses, Parameters()) == pytest.approx(once)


def test_of_a_map_all_that_is_judged_counts_and_little_that_is_not():
    """The weight of a place is shared by the scans that saw it; unseen is at most what one scan would have."""
    sights = [(T, exact(simulated.room(), T)) for T in (HERE, THERE, Pose2(4.5, 3.8, 2.8))]
    lone, whole = sighting(alone(sights[0][1])), sighting(sight_map(*sights))
    scans = [sighting(sight_map(sight)) for sight in sights]
    each = np.concatenate([scan.points[:, 2] for scan in scans])
    seeing = sum(classified(sight_map(sight), whole.points[:, :2]) == SUPPORTED for sight in sights)
    assert set(seeing) == {1, 2, 3}
    assert whole.points[:, 2] == pytest.approx(each / seeing)
    assert whole.mean == pytest.approx(each.sum() / 3)
    for T in (HERE.inverse(), Pose2(-1.0, 0.3, 0.4), Pose2(90.0, 0.0, 0.0)):
        of_lone, of_whole = classes(lone, whole, T, Parameters())
        expected = np.bincount(of_lone, weights=lone.points[:, 2], minlength=CLASSES)
        metres = np.bincount(of_whole, weights=whole.points[:, 2], minlength=CLASSES)
        metres[UNSEEN] = max(0.0, whole.mean - metres[:UNSEEN].sum())
        assert look(lone, whole, np.array([tuple(T)]), Parameters())[0] == pytest.approx(expected + metres)


def test_one_sensor_s_support_outweighs_another_s_conflict():
    """What one sensor supports is supported, whatever the others say; then conflict, then shadow."""
    sights = [(T, exact(simulated.room(), T)) for T in (HERE, THERE, Pose2(4.5, 3.8, 2.8))]
    together = sight_map(*sights)
    points = somewhere(np.random.default_rng(4), together.sights, 400)
    each = np.stack([classified(sight_map(sight), points) for sight in sights])
    assert np.array_equal(classified(together, points), each.min(axis=0))
    assert_as_plain(together, points[::4])
    conflicting = (each.min(axis=0) == SUPPORTED) & (each == CONTRADICTED).any(axis=0)
    assert conflicting.any()


def test_a_fused_map_sees_at_least_what_each_scan_saw():
    """Sensors of both maps stand where they stood, and what one of them supports, their fusion supports."""
    parameters = Parameters()
    map_1, map_2, T_1_2 = simulated.pair(simulated.room(), HERE, THERE)
    fused = fuse(map_1, map_2, T_1_2, matching_chains(map_1, map_2, T_1_2, parameters), parameters).map
    third = exact(simulated.room(), Pose2(4.5, 3.8, 2.8)).returns()[0]
    points = (HERE.inverse() @ Pose2(4.5, 3.8, 2.8)) @ third
    found = classified(fused, points)
    for alone_1_or_2 in (map_1, map_2.moved(T_1_2)):
        assert (found <= classified(alone_1_or_2, points)).all()
    assert (found == SUPPORTED).sum() > (classified(map_1, points) == SUPPORTED).sum()


def test_maps_keep_their_sights_through_motion_and_fusion():
    """Extracted: where the sensor is; moved: moved along; fused and joined: all of both; taken apart: none."""
    parameters = Parameters()
    map_1, map_2, T_1_2 = simulated.pair(simulated.room(), HERE, THERE)
    assert [tuple(sight.T_map_sensor) for sight in map_1.sights] == [(0.0, 0.0, 0.0)]
    T, again = Pose2(1.0, 2.0, 3.0), Pose2(-4.0, 0.5, -2.0)
    moved = map_1.moved(T).moved(again)
    assert tuple(moved.sights[0].T_map_sensor) == pytest.approx(tuple(again @ T))
    assert moved.sights[0].scan is map_1.sights[0].scan
    fused = fuse(map_1, map_2, T_1_2, matching_chains(map_1, map_2, T_1_2, parameters), parameters).map
    for whole in (fused, SegmentMap.joined([map_1, map_2.moved(T_1_2)])):
        assert [sight.scan for sight in whole.sights] == [map_1.sights[0].scan, map_2.sights[0].scan]
        assert [tuple(sight.T_map_sensor) for sight in whole.sights] == [(0.0, 0.0, 0.0), tuple(T_1_2)]
    assert map_1.take([0, 1]).sights == ()
    both = fuse(fused, fused, T, (), parameters).map
    assert [tuple(s.T_map_sensor) for s in both.sights[2:]] == [
        pytest.approx(tuple(T @ s.T_map_sensor)) for s in fused.sights
    ]


# --- poor input -----------------------------------------------------------------------------------


def test_scans_without_returns_see_nothing():
    """Maps of no scan, or of scans without returns, have no sighting; among others such scans do not count."""
    blind = LaserScan(np.full(180, np.nan), 0.0, DEGREE)
    assert sighting(SegmentMap.empty()) is None
    assert sighting(alone(blind)) is None
    assert sighting(extract(LaserScan(np.empty(0), 0.0, DEGREE), Parameters())) is None
    scan = exact(simulated.room(), HERE)
    among = sight_map((HERE, blind), (THERE, scan), (HERE, blind))
    points = somewhere(np.random.default_rng(5), sight_map((THERE, scan)).sights)
    assert np.array_equal(classified(among, points), classified(sight_map((THERE, scan)), points))


def test_one_return_supports_what_is_near_it_and_judges_nothing_else():
    """Without a neighbour there is no surface to be before or behind; one beam has no width either."""
    ranges = np.full(9, np.nan)
    ranges[4] = 2.0
    lonely = alone(LaserScan(ranges, -4 * DEGREE, DEGREE))
    points = np.array([[2.0, 0.0], [2.0, 0.19], [1.85, 0.01], [1.0, 0.0], [2.5, 0.0], [1.0, 0.005]])
    assert classified(lonely, points).tolist() == [SUPPORTED, UNSEEN, SUPPORTED, UNSEEN, UNSEEN, UNSEEN]
    single = sighting(alone(LaserScan(np.array([2.0]), 0.0, 0.0)))
    assert look(single, single, np.zeros((1, 3)), Parameters()).tolist() == [[0.0] * CLASSES]


def test_evidence_is_shares_of_what_can_be_judged():
    """Agreement leaves out what is unseen, overlap counts it; nothing to judge is no agreement."""
    seen = Evidence(supported=6.0, contradicted=1.0, shadowed=1.0, unseen=4.0)
    assert seen.agreement == 0.75
    assert seen.overlap == 0.5
    assert Evidence(0.0, 0.0, 0.0, 5.0).agreement == 0.0
    assert Evidence(0.0, 0.0, 0.0, 0.0).overlap == 0.0


@given(npst.arrays(float, (1, 4), elements=st.floats(0.0, 100.0)), st.integers(0, 3))
@quick
def test_support_raises_the_score_and_all_else_lowers_it(totals, changed):
    """A metre more of support adds a metre; a metre more of anything else takes its weight."""
    parameters, more = Parameters(), totals.copy()
    more[0, changed] += 1.0
    change = score(more, parameters)[0] - score(totals, parameters)[0]
    weights = 1.0, -parameters.conflict_weight, -parameters.shadow_weight, -parameters.unseen_weight
    assert change == pytest.approx(weights[changed])
