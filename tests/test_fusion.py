"""Chains become polylines, and every segment keeps its provenance."""

import math

import numpy as np
import pytest
import real_pairs
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from worlds import maps, poses, room

from segmap._kernels import closest_edges as closest_edges_kernel
from segmap._kernels import closest_edges_again, covers
from segmap.chains import MatchingChain, matching_chains
from segmap.fusion import chains, closest_edges, fuse, polyline
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import Order, SegmentMap, Source, extract

PAPER = preset("paper-lab").replace(min_segment_length=0.15)
PLAIN = PAPER.replace(fusion_variant="plain")
loose = settings(deadline=None, max_examples=80)


def fused(map_1, map_2, T_1_2, parameters):
    return fuse(map_1, map_2, T_1_2, matching_chains(map_1, map_2, T_1_2, parameters), parameters)


def as_set(segment_map):
    return sorted(tuple(row) for row in segment_map.coordinates.round(9))


def extremes_distance(members, line):
    """Farthest extreme of some segments from a polyline: a foreign ruler."""
    points = shapely.points(members.coordinates.reshape(-1, 2))
    return shapely.distance(points, shapely.linestrings(line.vertices)).max()


# --- chains ---------------------------------------------------------------------------------------


@given(maps(most=6), maps(most=6), poses)
@loose
def test_chains_are_the_components_of_matching(map_1, map_2, T):
    """A brute-force closure of "shares a segment with" gives the same chains."""
    parameters = Parameters(point_distance_tolerance=0.5)
    chains = matching_chains(map_1, map_2, T, parameters)
    pairs = [pair for chain in chains for pair in chain.pairs]
    groups = [{("1", i), ("2", j)} for i, j, _ in pairs]
    merging = True
    while merging:
        merging = False
        for a in groups:
            for b in groups:
                if a is not b and a & b:
                    a |= b
                    groups.remove(b)
                    merging = True
                    break
            if merging:
                break
    ours = [{("1", i) for i in chain.first} | {("2", j) for j in chain.second} for chain in chains]
    assert sorted(map(sorted, ours)) == sorted(map(sorted, groups))


@given(maps(most=6), npst.arrays(float, st.tuples(st.integers(2, 6), st.just(2)), elements=st.integers(-5, 5)))
@loose
def test_the_closest_edge_is_the_one_a_foreign_ruler_finds(members, vertices):
    """Distance of the farther extreme from each edge, by shapely, edge by edge."""
    distances, edges = closest_edges(members.coordinates, vertices)
    if len(members):
        points = shapely.points(members.coordinates.reshape(-1, 2, 2))
        lines = [shapely.linestrings(edge) for edge in np.stack((vertices[:-1], vertices[1:]), axis=1)]
        expected = np.stack([shapely.distance(points, line).max(axis=1) for line in lines])
        assert distances == pytest.approx(expected.min(axis=0), abs=1e-9)
        assert expected[edges, np.arange(len(edges))] == pytest.approx(distances, abs=1e-9)


# --- fusing a map with itself ---------------------------------------------------------------------


def test_a_room_fused_with_itself_is_the_room():
    """Nothing changes: neither coordinates nor directions."""
    fusion = fused(room(), room(), Pose2.identity(), PAPER)
    assert as_set(fusion.map) == as_set(room())
    assert fusion.map.directed.all()


def test_real_scans_fused_with_themselves(benchmarks, datasets):
    """Where no two segments of a scan match each other, fusing it with itself gives the scan."""
    compared = 0
    for log, pair in real_pairs.some(benchmarks, datasets, each=30, kinds=("consecutive",)):
        segment_map = extract(log[pair.i], PAPER)
        chains = matching_chains(segment_map, segment_map, Pose2.identity(), PAPER)
        if all(chain.first == chain.second and len(chain.first) == 1 for chain in chains):
            fusion = fuse(segment_map, segment_map, Pose2.identity(), chains, PAPER)
            assert as_set(fusion.map) == as_set(segment_map)
            compared += 1
    assert compared >= 20


@pytest.mark.parametrize("parameters", [PLAIN, Parameters(fusion_variant="plain")])
def test_plain_fusion_keeps_every_source_within_the_tolerance(benchmarks, datasets, parameters):
    """On real pairs, both extremes of every segment lie within fusion_tolerance of one edge, in every chain."""
    lines = 0
    for log, pair in real_pairs.some(benchmarks, datasets, each=12, kinds=("consecutive", "wide")):
        map_1, map_2 = real_pairs.maps(pair, log, parameters)
        T_1_2 = pair.truth
        chains = matching_chains(map_1, map_2, T_1_2, parameters)
        moved_2 = map_2.moved(T_1_2)
        for chain, line in zip(chains, fuse(map_1, map_2, T_1_2, chains, parameters).polylines, strict=True):
            members = SegmentMap.joined([map_1.take(chain.first), moved_2.take(chain.second)])
            distances, _ = closest_edges(members.coordinates, line.vertices)
            assert distances.max() <= parameters.fusion_tolerance + 1e-9
            lines += 1
    assert lines > 200


def test_greedy_fusion_errs_as_little_as_the_paper_says(benchmarks, datasets):
    """Section III-D: almost always less than 40 mm; here, at least 95 % of the sources of real pairs."""
    distances = []
    for log, pair in real_pairs.some(benchmarks, datasets, each=12, kinds=("consecutive", "wide")):
        map_1, map_2 = real_pairs.maps(pair, log, PAPER)
        chains = matching_chains(map_1, map_2, pair.truth, PAPER)
        moved_2 = map_2.moved(pair.truth)
        for chain, line in zip(chains, fuse(map_1, map_2, pair.truth, chains, PAPER).polylines, strict=True):
            members = SegmentMap.joined([map_1.take(chain.first), moved_2.take(chain.second)])
            distances.append(extremes_distance(members, line))
    assert np.mean(np.array(distances) < 0.040) > 0.95


@given(maps(most=7), st.sampled_from(["greedy", "plain"]))
@loose
def test_a_polyline_ends(members, variant):
    """Any chain gives a polyline from one farthest extreme to the other, within the bound of insertions."""
    parameters = Parameters(fusion_variant=variant, fusion_bound=3)
    if not len(members):
        return
    line = polyline(members, parameters)
    points = members.coordinates.reshape(-1, 2)
    diameter = max(math.dist(p, q) for p in points for q in points)
    assert math.dist(line.vertices[0], line.vertices[-1]) == pytest.approx(diameter)
    assert line.insertions <= (1 if variant == "greedy" else 3) * len(members)
    if variant == "plain":
        distances, _ = closest_edges(members.coordinates, line.vertices)
        assert distances.max() <= parameters.fusion_tolerance + 1e-9


def test_the_paper_figure_four():
    """A corner of four segments: P_0 spans it, then the segments bend it until it fits."""
    corner = SegmentMap(np.array([[0, 0, 2, 0.0], [1.5, 0.01, 3, 0], [3, 0, 3, 1.5], [3.01, 1, 3, 3]]))
    line = polyline(corner, PAPER)
    assert line.vertices[[0, -1]].tolist() == [[0, 0], [3, 3]]
    assert extremes_distance(corner, line) <= PAPER.fusion_tolerance
    assert line.directed


# --- directions -----------------------------------------------------------------------------------


def test_a_polyline_runs_as_most_of_its_length_does():
    """A short segment against the rest changes nothing; where a third runs against it, direction is lost."""
    long, short = [4.0, 0.0, 0.0, 0.0], [0.0, 0.01, 1.0, 0.01]
    line = polyline(SegmentMap(np.array([long, short])), Parameters())
    assert line.directed
    assert line.vertices[0, 0] > line.vertices[-1, 0]
    wall = SegmentMap(np.array([long, [0.0, 0.1, 3.0, 0.1]]))
    assert not polyline(wall, Parameters()).directed
    lost = SegmentMap(np.array([long]), directed=np.array([False]))
    assert not polyline(lost, Parameters()).directed


# --- provenance -----------------------------------------------------------------------------------


def scan_room(index):
    return SegmentMap(
        room().coordinates, Order.BEAMS, sources=tuple((Source(0, index, i),) for i in range(len(room())))
    )


def test_every_fused_segment_knows_its_scans():
    """Two views of one room: each wall names both; what only one saw names that one."""
    seen_once = np.array([[0.0, 0.0, 0.5, 0.0]])
    map_2 = SegmentMap.joined([scan_room(1), SegmentMap(seen_once, sources=((Source(0, 1, 4),),))])
    fusion = fused(scan_room(0), map_2, Pose2(0.0, 0.005, 0.0), PAPER)
    by_scans = sorted({source.scan for source in sources} for sources in fusion.map.sources)
    assert by_scans == [{1}, {0, 1}, {0, 1}, {0, 1}, {0, 1}] or sorted(map(sorted, by_scans)) == [[0, 1]] * 4 + [[1]]


def test_no_wall_is_claimed_that_nobody_saw(benchmarks, datasets):
    """At shipped defaults: the map is nowhere farther from a source than half a gap and the reach, and loses none."""
    parameters = Parameters()
    reach = parameters.segment_distance_threshold * parameters.point_distance_tolerance
    for log, pair in real_pairs.some(benchmarks, datasets, each=6, kinds=("consecutive", "wide")):
        map_1, map_2 = real_pairs.maps(pair, log, parameters)
        both = SegmentMap.joined([map_1, map_2.moved(pair.truth)])
        result = fused(map_1, map_2, pair.truth, parameters).map
        assert farthest_from(result, both) <= parameters.max_connector / 2.0 + 2.0 * reach
        assert farthest_from(both, result) <= 2.0 * reach
        assert {s for sources in result.sources for s in sources} == {s for sources in both.sources for s in sources}


def farthest_from(segment_map, other):
    """How far a point of one map lies from the other at most, metres, by points 5 cm apart and a foreign ruler."""
    lines = shapely.segmentize(shapely.linestrings(segment_map.coordinates.reshape(-1, 2, 2)), 0.05)
    whole = shapely.union_all(shapely.linestrings(other.coordinates.reshape(-1, 2, 2)))
    return shapely.distance(shapely.points(shapely.get_coordinates(lines)), whole).max()


@given(maps(most=3), maps(most=3), st.floats(0.01, 1.0))
@loose
def test_covers_are_the_stretches_a_foreign_ruler_finds(edges, segments, reach):
    """Where a segment runs within reach of an edge's line, and beside the edge, that stretch of the edge is covered."""
    found = covers(edges.coordinates, segments.coordinates, reach)
    for k, (x1, y1, x2, y2) in enumerate(edges.coordinates):
        along = Pose2(x1, y1, math.atan2(y2 - y1, x2 - x1)).inverse()  # the edge on the x axis, from the origin
        strip = shapely.box(0.0, -reach, math.dist((x1, y1), (x2, y2)), reach)
        for i, segment in enumerate(segments.coordinates.reshape(-1, 2, 2)):
            within = shapely.intersection(shapely.linestrings(along @ segment), strip)
            expected = (within.bounds[2] - within.bounds[0]) if not within.is_empty else 0.0
            assert found[k, i, 1] - found[k, i, 0] == pytest.approx(expected, abs=1e-6)


def test_the_paper_keeps_every_edge():
    """Without a limit the polyline stays whole; with one, the stretch across a doorway is left out."""
    ends = SegmentMap(np.array([[0, 0, 1.0, 0], [3.0, 0, 4.0, 0]]), sources=((Source(0, 0, 0),), (Source(0, 0, 1),)))
    other = SegmentMap(np.array([[0.5, 0.01, 0.9, 0.01]]), sources=((Source(0, 1, 0),),))
    chain = MatchingChain(((0, 0, 1.0), (1, 0, 1.0)))
    whole = fuse(ends, other, Pose2.identity(), (chain,), PAPER).map
    parted = fuse(ends, other, Pose2.identity(), (chain,), PAPER.replace(max_connector=0.2)).map
    assert whole.coordinates.tolist() == [[0, 0, 4, 0]]
    assert sorted(parted.coordinates.tolist()) == [[0, 0, 1, 0], [3, 0, 4, 0]]
    bridged = fuse(ends, other, Pose2.identity(), (chain,), PAPER.replace(max_connector=2.5)).map
    assert bridged.coordinates.tolist() == [[0, 0, 4, 0]]


def test_unmatched_segments_are_kept_as_they_are():
    """Maps that share nothing are both in the result, to the last bit."""
    far = room().moved(Pose2(50.0, 0.0, 0.0))
    fusion = fused(room(), far, Pose2.identity(), PAPER)
    assert np.array_equal(fusion.map.coordinates, np.concatenate((room().coordinates, far.coordinates)))
    assert fusion.polylines == ()


def test_fusing_with_the_empty_map_changes_nothing():
    """Also the other way round, and both empty."""
    empty = SegmentMap.empty()
    assert as_set(fused(room(), empty, Pose2.identity(), PAPER).map) == as_set(room())
    assert as_set(fused(empty, room(), Pose2.identity(), PAPER).map) == as_set(room())
    assert len(fused(empty, empty, Pose2.identity(), PAPER).map) == 0


def test_integrated_pairs_hold_less_than_both_scans(benchmarks, datasets):
    """Fusing real neighbours under the true pose, at shipped defaults, removes what stands twice."""
    before, after = [], []
    for log, pair in real_pairs.some(benchmarks, datasets, each=6, kinds=("consecutive",)):
        map_1, map_2 = real_pairs.maps(pair, log, Parameters())
        result = fused(map_1, map_2, pair.truth, Parameters()).map
        before.append(map_1.lengths.sum() + map_2.lengths.sum())
        after.append(result.lengths.sum())
    assert len(after) == 30
    assert sum(after) < 0.8 * sum(before)


@given(maps(most=12), st.booleans())
@loose
def test_a_polyline_grown_step_by_step_is_that_of_the_algorithm(members, again):
    """Bringing distances up to date after an insertion gives what computing all of them anew gives, to the last bit."""
    if not len(members):
        return
    parameters = Parameters(fusion_variant="greedy", fusion_tolerance=0.05)
    vertices = chains._first_edge(members)[0]
    squares, edges = closest_edges_kernel(members.coordinates, vertices)
    waiting = np.ones(len(members), bool)
    for _ in range(2 * len(members)):
        s = int(np.argmax(np.where(waiting, squares, -1.0)))
        waiting[s] = again
        edge, before = int(edges[s]), len(vertices)
        vertices = chains._inserted(vertices, edge, members.coordinates[s], parameters.point_distance_tolerance)
        closest_edges_again(members.coordinates, vertices, squares, edges, edge, len(vertices) - before)
        fresh = closest_edges_kernel(members.coordinates, vertices)
        assert np.array_equal(squares, fresh[0])
        assert np.array_equal(edges, fresh[1])
