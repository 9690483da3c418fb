"""The fast search against evaluating everything: the same candidates, the same values to the last bit."""

import math

import numpy as np
import pytest
import real_pairs
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from worlds import maps, poses, room

from segmap import evaluation
from segmap._threads import crew
from segmap._value_kernels import crossing
from segmap.bounds import Bounds
from segmap.candidates import POSE_RESOLUTION, Candidates, _Seen, candidates
from segmap.errors import CancelledError
from segmap.evaluation import best, evaluate, matching_values, search
from segmap.integration import match_maps
from segmap.parameters import Parameters, preset
from segmap.segments import Order, SegmentMap

quick = settings(deadline=None, max_examples=60)
KEEP_ALL = {"segment_length_refuse": 100.0}


@pytest.fixture
def always_bounded(monkeypatch):
    """Bounds are used however few the candidates are."""
    monkeypatch.setattr(evaluation, "BOUNDED", 0)
    monkeypatch.setattr(evaluation, "SPARSE", 0)


def found(map_1, map_2, parameters, heuristic="all"):
    return Candidates.joined(list(candidates(map_1, map_2, heuristic, parameters))).poses


def bounds_of(map_1, map_2, rows, parameters, workers=1):
    with crew(workers) as threads:
        return Bounds(map_1, map_2, rows, parameters, threads).of_all()


def assert_same_best(map_1, map_2, rows, parameters, *counts, workers=1):
    """What search gives is what evaluating everything gives."""
    values = evaluate(map_1, map_2, rows, parameters)
    for count in counts:
        expected = best(values, count)
        top = search(map_1, map_2, rows, parameters, count, workers=workers)
        assert np.array_equal(top.rows, expected)
        assert np.array_equal(top.values, values[expected])
        assert top.discarded == np.isnan(values).sum()


# --- maps and poses that are hard on bounds -------------------------------------------------------


def world(generator, centre):
    """Up to 30 segments: long and very short ones, many on the axes, some on one line."""
    count = generator.integers(1, generator.choice([4, 9, 31]))
    middles = generator.normal(0.0, generator.choice([0.1, 2.0, 10.0]), (count, 2)) + centre
    lengths = np.exp(generator.uniform(np.log(generator.choice([1e-4, 0.03, 0.3])), np.log(3.0), count))
    turned = generator.choice([0.0, 1e-9, 0.02, 2.0], count) * generator.normal(size=count)
    angles = generator.choice([0.0, math.pi / 2, math.pi / 4, -math.pi], count) + turned
    halves = 0.5 * lengths[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return SegmentMap(np.concatenate((middles - halves, middles + halves), axis=1))


def meeting_poses(generator, map_1, map_2, limit, count):
    """Poses that bring a segment of one map near the line of one of the other: flat, steep, close and far along it."""
    i, j = generator.integers(len(map_1), size=count), generator.integers(len(map_2), size=count)
    middle_1, middle_2 = (0.5 * (m.coordinates[:, :2] + m.coordinates[:, 2:]) for m in (map_1, map_2))
    between = generator.choice([0.0, math.pi / 2, 1.0], count) + generator.choice([0.02, 0.3], count) * (
        generator.normal(size=count)
    )
    theta = map_1.headings[i] - map_2.headings[j] + between
    line = np.where(generator.random(count) < 0.5, map_1.headings[i], map_2.headings[j] + theta)
    along = generator.normal(size=count) * generator.choice([0.2, 1.0, 5.0], count)
    across = generator.uniform(-1.2, 1.2, count) * limit
    place = middle_1[i] + along[:, None] * np.column_stack((np.cos(line), np.sin(line)))
    place += across[:, None] * np.column_stack((-np.sin(line), np.cos(line)))
    x, y = middle_2[j].T
    cosine, sine = np.cos(theta), np.sin(theta)
    shift = place - np.column_stack((cosine * x - sine * y, sine * x + cosine * y))
    return np.column_stack((shift, np.mod(theta + math.pi, 2.0 * math.pi) - math.pi))


def hard_case(seed):
    """Two maps, poses, some of them twice, and parameters."""
    generator = np.random.default_rng(seed)
    map_1, map_2 = (world(generator, generator.choice([0.0, 0.0, 1e4, 1e7]) * generator.normal(size=2)) for _ in "12")
    parameters = Parameters(
        point_distance_tolerance=math.exp(generator.uniform(math.log(0.002), math.log(0.5))),
        segment_distance_threshold=generator.choice([0.3, 1.0, 5.0, 10.0]),
        distance_penalty=generator.choice([0.5, 0.95, 1.0]),
        segment_length_refuse=generator.choice([0.5, 1.0, 100.0]),
        refuse_angle=generator.choice([0.0, 0.2]),
    )
    limit = parameters.segment_distance_threshold * parameters.point_distance_tolerance
    rows = meeting_poses(generator, map_1, map_2, limit, 400)
    return map_1, map_2, np.concatenate((rows, rows[:40])), parameters


# --- bounds ---------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@quick
def test_no_value_exceeds_its_bound(seed):
    """Far along a wall at right angles to it, beside it, across it, near and far from the origin: never."""
    map_1, map_2, rows, parameters = hard_case(seed)
    values = evaluate(map_1, map_2, rows, parameters.replace(**KEEP_ALL))
    assert (bounds_of(map_1, map_2, rows, parameters) >= values).all()


@given(maps(), maps(), st.lists(poses, min_size=1, max_size=5))
@quick
def test_no_value_of_any_pose_exceeds_its_bound(map_1, map_2, some):
    """Nor for poses that have nothing to do with the maps, nor for those that lay segment on segment."""
    assume(len(map_1) and len(map_2))
    parameters = Parameters(point_distance_tolerance=0.2, **KEEP_ALL)
    rows = np.concatenate(([tuple(T) for T in some], found(map_1, map_2, parameters, "extremes")))
    assert (bounds_of(map_1, map_2, rows, parameters) >= evaluate(map_1, map_2, rows, parameters)).all()


@given(st.integers(0, 2**32 - 1))
@quick
def test_what_reaches_a_value_outlasts_a_closer_look(seed):
    """Whatever value is asked for, those that have it or more stay, and no others."""
    map_1, map_2, rows, parameters = hard_case(seed)
    values = evaluate(map_1, map_2, rows, parameters.replace(**KEEP_ALL))
    with crew(2) as threads:
        bounds = Bounds(map_1, map_2, rows, parameters, threads)
        for least in np.quantile(values[values > 0.0], [0.0, 0.3, 0.9, 1.0], method="lower") if values.any() else ():
            kept = bounds.outlasting(np.arange(len(rows)), least)
            assert set(np.flatnonzero(values >= least)) <= set(kept)
            assert (values[kept] >= 0.999 * least - 1e-8).all()


def test_a_bound_is_zero_where_nothing_can_match():
    """Maps a kilometre apart: no bound, so nothing to evaluate."""
    rows = np.array([[1000.0, 0.0, 0.3], [0.0, -1000.0, 2.0]])
    assert (bounds_of(room(), room(), rows, Parameters()) < 0.1).all()


def test_bounds_are_close_enough_to_help(benchmarks, datasets):
    """On real pairs with many candidates, at most one in ten has to be evaluated for the best 50."""
    parameters = preset("default")
    shares = []
    for log, pair in real_pairs.some(benchmarks, datasets, each=6, kinds=("consecutive",)):
        map_1, map_2 = real_pairs.maps(pair, log, parameters)
        rows = found(map_1, map_2, parameters)
        if len(rows) > 5000:
            values = evaluate(map_1, map_2, rows, parameters)
            worst = values[best(values, 50)[-1]]
            shares.append((bounds_of(map_1, map_2, rows, parameters) >= worst).mean())
    assert len(shares) >= 5
    assert np.median(shares) < 0.1


# --- the search -----------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 7, 100, 10_000]), st.sampled_from([1, 2]))
@settings(quick, suppress_health_check=["function_scoped_fixture"])
def test_hard_maps_have_the_best_of_brute_force(always_bounded, seed, count, workers):
    """The same rows and values, poses that come twice and discarded ones included, for any number wanted."""
    assert_same_best(*hard_case(seed), count, workers=workers)


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("parameters", [preset("default"), preset("paper-lab")])
@pytest.mark.slow
def test_real_pairs_have_the_best_of_brute_force(always_bounded, benchmarks, datasets, parameters, workers):
    """All kinds of pairs of five logs, whatever the number wanted."""
    compared = 0
    for log, pair in real_pairs.some(benchmarks, datasets, each=2):
        maps_of_pair = real_pairs.maps(pair, log, parameters)
        rows = found(*maps_of_pair, parameters)
        rows = rows[:: 1 + len(rows) // 5000]
        if len(rows):
            assert_same_best(*maps_of_pair, rows, parameters, 1, 50, 1500, workers=workers)
            compared += 1
    assert compared >= 20


@pytest.mark.parametrize("count", [1, 2, 7, 60, 400])
def test_bounds_as_tight_as_can_be_lose_nothing(always_bounded, monkeypatch, count):
    """Where bounds hardly exceed the values, and later rows look better, ties are evaluated all the same."""

    class Tight(Bounds):
        def of_all(self):
            later = 1.0 + 1e-12 * np.arange(len(rows))
            return np.nan_to_num(evaluate(square, square, rows, Parameters())) * later

    square = room(4.0, 4.0)
    rows = np.tile(found(square, square, Parameters()), (40, 1))
    monkeypatch.setattr(evaluation, "Bounds", Tight)
    monkeypatch.setattr(evaluation, "FIRST", 1)
    assert_same_best(square, square, rows, Parameters(), count)


def test_ties_go_to_the_first(always_bounded):
    """A square looks the same four ways, and every pose is there three times: the lowest rows win."""
    square = room(4.0, 4.0)
    rows = np.repeat(found(square, square, Parameters()), 3, axis=0)[::-1].copy()
    values = evaluate(square, square, rows, Parameters())
    assert (values == np.nanmax(values)).sum() >= 12
    assert_same_best(square, square, rows, Parameters(), 1, 5, 12, 30)


def test_a_moved_copy_is_found_among_all(always_bounded):
    """A map, shuffled and partly undirected, against its moved copy."""
    generator = np.random.default_rng(4)
    walls = SegmentMap(generator.uniform(-4.0, 4.0, (14, 4)), Order.NONE, generator.random(14) < 0.5)
    moved = walls.moved(next(iter(match_maps(room(), room()).ranked)).T_1_2)
    parameters = Parameters(**KEEP_ALL)
    rows = found(walls, moved, parameters)
    assert_same_best(walls, moved, rows, parameters, 1, 50, workers=2)


@pytest.mark.parametrize("sizes", [(0, 0), (0, 3), (3, 0), (1, 1), (1, 4)])
def test_few_segments_or_none(always_bounded, sizes):
    """Empty maps, single segments, no candidates: nothing is lost and nothing breaks."""
    map_1, map_2 = (SegmentMap(room().coordinates[:size]) for size in sizes)
    for rows in (np.empty((0, 3)), np.array([[0.0, 0.0, 0.0], [0.0, 0.01, 0.0]])):
        assert_same_best(map_1, map_2, rows, Parameters(), 5)


def test_nothing_is_found_where_all_are_discarded(always_bounded):
    """Two long crosses laid across each other: no candidate is left, all are counted."""
    cross = SegmentMap(np.array([[-2.0, 0.0, 2.0, 0.0], [0.0, -2.0, 0.0, 2.0]]))
    rows = np.array([[0.3, 0.3, 0.0], [0.3, -0.3, 0.5], [-0.3, 0.4, 1.0]])
    top = search(cross, cross, rows, Parameters(), 2)
    assert (len(top.rows), top.discarded) == (0, 3)


def test_only_the_promising_are_evaluated(monkeypatch, benchmarks, datasets):
    """Most candidates of a large pair are left out, and the best are those of brute force all the same."""
    parameters = preset("paper-lab")
    pairs = (real_pairs.maps(pair, log, parameters) for log, pair in real_pairs.some(benchmarks, datasets, each=8))
    map_1, map_2 = next(two for two in pairs if min(map(len, two)) > 35)
    rows = found(map_1, map_2, parameters)
    assert_same_best(map_1, map_2, rows, parameters, 50)
    evaluated = []
    kernel = evaluation._value_kernels.evaluate
    monkeypatch.setattr(
        evaluation._value_kernels,
        "evaluate",
        lambda a, b, some, *rest: evaluated.append(len(some)) or kernel(a, b, some, *rest),
    )
    search(map_1, map_2, rows, parameters, 50)
    assert 50 <= sum(evaluated) < 0.1 * len(rows)


def test_a_bounded_search_can_be_stopped(always_bounded):
    """Whatever the check raises ends the search, on one thread and on two."""

    def stop():
        raise CancelledError("stopped")

    for workers in (1, 2):
        with pytest.raises(CancelledError):
            search(room(), room(), found(room(), room(), Parameters()), Parameters(), 1, workers=workers, check=stop)


# --- what the search is made of -------------------------------------------------------------------


@given(maps(most=6), maps(most=6), st.lists(poses, max_size=6))
@quick
def test_discarded_are_those_under_which_long_segments_cross(map_1, map_2, some):
    """The test for crossings alone and the value agree on what is discarded."""
    rows = np.array([tuple(T) for T in some]).reshape(-1, 3)
    p = Parameters(segment_length_refuse=0.5)
    crossed = crossing(map_1.coordinates, map_2.coordinates, rows, p.point_distance_tolerance, 0.5, p.refuse_angle)
    assert np.array_equal(crossed, np.isnan(evaluate(map_1, map_2, rows, p)))


@given(maps(most=12), maps(most=12), poses)
@quick
def test_a_value_is_the_sum_of_its_matching_values_in_index_order(map_1, map_2, T):
    """To the last bit."""
    parameters = Parameters(point_distance_tolerance=0.3, **KEEP_ALL)
    value = 0.0
    for one in matching_values(map_1, map_2, T, parameters, least=0.0)[1]:
        value += one
    assert evaluate(map_1, map_2, np.array([tuple(T)]), parameters)[0] == value


whole = st.integers(-3, 3) | st.integers(-(2**53), 2**53)


@given(st.lists(st.tuples(whole, whole, whole), max_size=200), st.lists(st.integers(0, 200), max_size=4))
@quick
def test_a_pose_comes_once(keys, cuts):
    """However many calls they come in, poses are new the first time to the resolution, and then no more."""
    seen, known = _Seen(), set()
    for part in np.split(np.array(keys, float).reshape(-1, 3), sorted(cuts)):
        expected = [k for k, key in enumerate(map(tuple, part)) if not (key in known or known.add(key))]
        jitter = np.linspace(-0.4, 0.4, 3 * len(part)).reshape(-1, 3) * (abs(part) < 2**50)
        assert seen.new((part + jitter) * POSE_RESOLUTION).tolist() == expected
