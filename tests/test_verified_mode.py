"""INTEGRATE in verified mode: what is recovered, what is left to a person, what is refused."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import real_pairs
import simulated
from hypothesis import given, settings
from simulated import DEGREE, alone, noisy
from worlds import maps

from segmap.benchmark import is_right
from segmap.candidates import Candidates, candidates
from segmap.errors import CancelledError, ParameterError
from segmap.integration import AUTOMATIC, DEFAULT_HEURISTIC, STAGES, Match, heuristics, integrate, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import Order, SegmentMap, extract
from segmap.simulate import World
from segmap.verdict import Verdict
from segmap.visibility import look as look_both_ways
from segmap.visibility import score, sighting

P = preset("verified")
SAMPLES = Path(__file__).parents[1] / "sample_logs"
HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)


def verified(map_1, map_2, parameters=P, heuristic=None, **options):
    return match_maps(map_1, map_2, parameters, heuristic, "verified", **options)


@pytest.fixture(scope="module")
def in_the_room():
    """Two scans of a furnished room, with noise, and their true pose."""
    return simulated.pair(simulated.room(), HERE, THERE, P, seed=3)


@pytest.fixture(scope="module")
def matched(in_the_room):
    """What verified mode finds for them."""
    return verified(*in_the_room[:2])


def sample(name):
    """The maps of a sample log's scans, and their true poses."""
    truth = json.loads((SAMPLES / f"{name}.truth.json").read_text())["sessions"][0]["poses"]
    return [extract(scan, P) for scan in read_log(SAMPLES / f"{name}.log")], [Pose2(*pose) for pose in truth]


@pytest.fixture(scope="module")
def samples():
    """The maps and the true poses of three simulated buildings."""
    return {name: sample(name) for name in ("office", "laboratory", "hall")}


# --- right, wrong, unsure -------------------------------------------------------------------------


def test_neighbours_in_simulated_buildings_are_recovered(samples):
    """Every fourth pair of an office, a laboratory and a hall: at least 95 % accepted, none of them wrong."""
    accepted, pairs = 0, 0
    for segment_maps, poses in samples.values():
        for i in range(0, len(poses) - 1, 4):
            match = verified(segment_maps[i], segment_maps[i + 1])
            pairs += 1
            if match.verdict is Verdict.ACCEPTED:
                accepted += 1
                assert is_right(match.T_1_2, poses[i].inverse() @ poses[i + 1])
    assert accepted >= 0.95 * pairs


def test_maps_of_different_buildings_are_never_accepted(samples):
    """Two rooms, and scans of different buildings: reviewed or rejected, whatever the heuristic."""
    rooms = [extract(noisy(world, T, 7), P) for world, T in _rooms()]
    pairs = [(rooms[0], rooms[1]), (rooms[1], rooms[0])]
    for one, other in (("office", "laboratory"), ("laboratory", "hall"), ("hall", "office")):
        pairs += [(samples[one][0][i], samples[other][0][i]) for i in range(0, 56, 8)]
    for map_1, map_2 in pairs:
        assert verified(map_1, map_2).verdict is not Verdict.ACCEPTED
    for heuristic in heuristics("verified"):
        assert verified(*pairs[0], heuristic=heuristic).verdict is not Verdict.ACCEPTED


def _rooms():
    return (simulated.room(), HERE), (simulated.other_room(), Pose2(1.8, 4.0, 1.2))


@pytest.mark.parametrize("reach", [6.0, 12.0, 30.0])
@pytest.mark.parametrize("width", [1.5, 2.4, 4.0, 8.0])
def test_an_empty_corridor_is_for_a_person(width, reach):
    """Nothing tells how far along it the two scans are: never accepted, and the reasons say why."""
    for seed, turn in ((10, -0.15), (20, 0.35), (30, 0.85)):
        T_1, T_2 = Pose2(100.0, width / 2.0, 0.05), Pose2(101.0, width / 2.0 + 0.1, 0.05 + turn)
        map_1, map_2, _ = simulated.pair(simulated.corridor(width), T_1, T_2, P, seed, reach)
        match = verified(map_1, map_2)
        assert match.verdict is not Verdict.ACCEPTED
        assert any("weakest direction" in reason or "rival" in reason for reason in match.reasons)


@pytest.mark.parametrize("reach", [8.0, 15.0])
def test_a_corridor_of_equal_doors_lists_its_rivals(reach):
    """One door looks like the next: a person chooses between the true pose and those a door away."""
    doors = [(x, -0.1, x + 0.9, 0.0) for x in range(0, 100, 2)] + [
        (x + 0.3, 1.8, x + 1.2, 1.9) for x in range(0, 100, 2)
    ]
    world = World.build("doors", [(0.0, 0.0, 100.0, 1.8), *doors])
    map_1, map_2, truth = simulated.pair(world, Pose2(50.3, 0.9, 0.05), Pose2(51.6, 1.0, 0.15), P, 10, reach)
    match = verified(map_1, map_2)
    assert match.verdict is Verdict.REVIEW
    assert any("rival" in reason for reason in match.reasons)
    near = [candidate.T_1_2 for candidate in match.ranked if candidate.score > 0.5 * match.best.score]
    assert min(T.distance(truth)[0] for T in near) < 0.25
    assert max(T.distance(truth)[0] for T in near) > 1.5


def test_a_real_corridor_is_not_accepted_wrongly(benchmarks, datasets):
    """The pairs of the aces log whose pose walls hold least along the corridor are right, or not accepted."""
    pairs, log = real_pairs.pair_set(benchmarks, datasets, "aces")
    for pair in [p for p in pairs.pairs if (p.i, p.j) in {(46, 47), (47, 48), (294, 295), (25, 26)}]:
        match = verified(*real_pairs.maps(pair, log, P))
        assert match.verdict is not Verdict.ACCEPTED or is_right(match.T_1_2, pair.truth)


# --- what a match holds ---------------------------------------------------------------------------


def test_the_ranked_are_distinct_and_best_first(in_the_room, matched):
    """By score, best first; each farther than the rival distance or the rival angle from every other."""
    scores = [candidate.score for candidate in matched.ranked]
    assert len(scores) > 3
    assert scores == sorted(scores, reverse=True)
    for a, one in enumerate(matched.ranked):
        for other in matched.ranked[a + 1 :]:
            distance, angle = one.T_1_2.distance(other.T_1_2)
            assert distance >= P.rival_distance or angle >= P.rival_angle


def test_scores_are_those_of_the_evidence(in_the_room, matched):
    """Each candidate's score and evidence is what all lines of sight say of its pose."""
    seen_1, seen_2 = (sighting(segment_map) for segment_map in in_the_room[:2])
    for candidate in matched.ranked:
        totals = look_both_ways(seen_1, seen_2, np.array([tuple(candidate.T_1_2)]), P)
        assert candidate.score == pytest.approx(score(totals, P)[0])
        assert candidate.evidence.supported == pytest.approx(totals[0, 0])
        assert candidate.evidence.unseen == pytest.approx(totals[0, 3])


def test_candidates_are_named_by_their_place_among_all(in_the_room):
    """The index counts all candidates in the order found, judged or not, and names the angle and about the pose."""
    map_1, map_2, _ = in_the_room
    for parameters in (P, P.replace(judged_candidates=60)):
        match = verified(map_1, map_2, parameters, "extremes")
        found = Candidates.joined(list(candidates(map_1, map_2, "extremes", parameters)))
        assert match.candidates == len(found)
        for candidate in match.ranked:
            (a, b), (c, d) = candidate.angle_1, candidate.angle_2
            assert found.angles_1[candidate.index].tolist() == [a, b]
            assert found.angles_2[candidate.index].tolist() == [c, d]
            assert Pose2(*found.poses[candidate.index]).distance(candidate.T_1_2)[0] < 1.5


def test_automatic_counts_on_through_its_heuristics():
    """Where two heuristics were needed, the candidates of the second come after those of the first."""
    rooms = [extract(noisy(world, T, 8), P) for world, T in _rooms()]
    blocks = [block for stage in STAGES for block in candidates(*rooms, stage, P)]
    found, match = Candidates.joined(blocks), verified(*rooms)
    assert match.candidates == len(found)
    for candidate in match.ranked:
        assert found.angles_1[candidate.index].tolist() == list(candidate.angle_1)
        assert found.angles_2[candidate.index].tolist() == list(candidate.angle_2)
    assert any(candidate.angle_1[0] != candidate.angle_1[1] for candidate in match.ranked)  # some of the second


def test_few_judged_candidates_find_the_pose_too(in_the_room):
    """The best by value are judged where there are more than judged_candidates; crossings are counted."""
    map_1, map_2, truth = in_the_room
    match = verified(map_1, map_2, P.replace(judged_candidates=200), "all")
    assert match.candidates > 200
    assert 0 < match.discarded < match.candidates
    assert is_right(match.T_1_2, truth)


def test_automatic_stops_when_the_evidence_is_clear(in_the_room, matched):
    """Accepted after the cheapest heuristic, it tries no other; unclear, it tries all."""
    assert matched.verdict is Verdict.ACCEPTED
    assert matched.heuristic == AUTOMATIC == DEFAULT_HEURISTIC["verified"]
    first, *_ = (verified(*in_the_room[:2], heuristic=stage) for stage in STAGES)
    assert matched.ranked == first.ranked
    assert matched.candidates == first.candidates
    rooms = [extract(noisy(world, T, 7), P) for world, T in _rooms()]
    tried = [verified(*rooms, heuristic=stage).candidates for stage in STAGES]
    assert verified(*rooms).candidates == sum(tried)


def test_twice_is_the_same_and_json_keeps_it(in_the_room, matched):
    """The same match to the last bit, but for the time it took; stored and read, nothing is lost."""
    again = verified(*in_the_room[:2])
    assert replace(again, milliseconds=0.0) == replace(matched, milliseconds=0.0)
    assert Match.from_json(matched.to_json()) == matched


def test_threads_change_nothing(in_the_room):
    """One worker or three: the same candidates, the same ranking."""
    one, several = (verified(*in_the_room[:2], P, "all", workers=workers) for workers in (1, 3))
    assert one.ranked == several.ranked


def test_thresholds_never_change_what_is_found(in_the_room):
    """Whatever is accepted, automatic tries the same candidates and ranks the same."""
    rooms = [extract(noisy(world, T, 7), P) for world, T in _rooms()]
    for pair in (in_the_room[:2], rooms):
        found = verified(*pair)
        for changes in ({"confidence_accept": 1.0}, {"confidence_accept": 0.0, "confidence_review": 0.0}):
            other = verified(*pair, P.replace(value_threshold=99.0, **changes))
            assert (other.ranked, other.candidates, other.findings) == (found.ranked, found.candidates, found.findings)


def test_the_pose_does_not_depend_on_frames_or_order(in_the_room, matched):
    """Maps moved: the pose moves with them; maps swapped: the pose is inverted."""
    map_1, map_2, truth = in_the_room
    T_1, T_2 = Pose2(5.0, -3.0, 2.0), Pose2(-8.0, 1.0, -1.0)
    moved = verified(map_1.moved(T_1), map_2.moved(T_2))
    distance, angle = moved.T_1_2.distance(T_1 @ matched.T_1_2 @ T_2.inverse())
    assert distance < 0.02
    assert angle < 0.01
    swapped = verified(map_2, map_1)
    assert swapped.verdict is moved.verdict is Verdict.ACCEPTED
    assert swapped.T_1_2.distance(truth.inverse())[0] < 0.05


def test_other_thresholds_judge_the_same_match(matched):
    """judged() changes the verdict and the reasons alone, and can be taken back."""
    strict = matched.judged(P.replace(confidence_accept=1.0, confidence_review=1.0))
    assert strict.verdict is Verdict.REJECTED
    assert strict.ranked == matched.ranked
    assert matched.judged(P.replace(confidence_accept=1.0)).verdict is Verdict.REVIEW
    assert matched.judged(P.replace(value_threshold=999.0)).verdict is Verdict.REVIEW
    assert strict.judged(P) == matched


@pytest.mark.parametrize("heuristic", heuristics("verified"))
def test_every_heuristic_runs_on_evidence(in_the_room, heuristic):
    """All of the paper's heuristics and those beyond: scored, refined, and never accepted wrongly."""
    match = verified(*in_the_room[:2], heuristic=heuristic)
    assert match.mode == "verified"
    assert match.heuristic == heuristic
    assert (match.draws is not None) == (heuristic == "random")
    assert match.confidence == match.score
    assert all(c.evidence is not None and c.uncertainty is not None for c in match.ranked)
    assert match.verdict is not Verdict.ACCEPTED or is_right(match.T_1_2, in_the_room[2])
    if heuristic in ("all", "extremes", "random", "automatic"):
        assert match.verdict is Verdict.ACCEPTED


def test_integration_fuses_and_keeps_the_sights(in_the_room):
    """The fused map knows where both sensors stood, and can be integrated on evidence again."""
    map_1, map_2, _ = in_the_room
    integration = integrate(map_1, map_2, P, mode="verified")
    first, second = integration.map.sights
    assert tuple(first.T_map_sensor) == (0.0, 0.0, 0.0)
    assert tuple(second.T_map_sensor) == pytest.approx(tuple(integration.match.T_1_2))
    T_w_3 = Pose2(3.6, 2.8, -1.0)
    third = extract(noisy(simulated.room(), T_w_3, 9), P)
    match = verified(integration.map, third)
    assert match.verdict is Verdict.ACCEPTED
    assert is_right(match.T_1_2, HERE.inverse() @ T_w_3)


# --- hard and poor input --------------------------------------------------------------------------


def test_a_map_without_sights_is_for_a_person(in_the_room):
    """On either side: candidates and ranking are paper mode's, the verdict is at most review, and says why."""
    map_1, map_2, _ = in_the_room
    blind_1, blind_2 = (segment_map.take(range(len(segment_map))) for segment_map in (map_1, map_2))
    for one, other in ((blind_1, map_2), (map_1, blind_2), (blind_1, blind_2)):
        match, paper = verified(one, other), match_maps(one, other, P)
        assert match.ranked == paper.ranked
        assert paper.verdict is Verdict.ACCEPTED
        assert match.verdict is Verdict.REVIEW
        assert any("no lines of sight" in reason for reason in match.reasons)
        assert match.heuristic == AUTOMATIC
        assert match.confidence is None
        assert match.best.score is match.best.evidence is match.best.uncertainty is None
        assert verified(one, other, heuristic="extremes").best is not None
        assert Match.from_json(match.to_json()) == match
        assert match.judged(P.replace(value_threshold=999.0)).verdict is Verdict.REJECTED


def test_undirected_maps_are_recovered(in_the_room):
    """Directions and order lost, some segments turned round: the same pose, on evidence."""
    map_1, map_2, truth = in_the_room
    lost = []
    for segment_map in (map_1, map_2):
        coordinates = segment_map.coordinates[::-1].copy()
        coordinates[::2] = coordinates[::2][:, [2, 3, 0, 1]]
        lost.append(
            replace(segment_map, coordinates=coordinates, order=Order.NONE, directed=np.zeros(len(coordinates)))
        )
    for one, other in ((map_1, lost[1]), (lost[0], map_2), (lost[0], lost[1])):
        match = verified(one, other)
        assert match.verdict is Verdict.ACCEPTED
        assert is_right(match.T_1_2, truth)


BLIND = alone(LaserScan(np.full(180, np.nan), 0.0, DEGREE))
ONE_WALL = extract(LaserScan(2.0 / np.cos(np.linspace(-0.5, 0.5, 60)), -0.5, 1.0 / 59.0), P)


@pytest.mark.parametrize("heuristic", heuristics("verified"))
@pytest.mark.parametrize(
    ("map_1", "map_2", "told"),
    [
        (SegmentMap.empty(), ONE_WALL, "first map has no segments"),
        (ONE_WALL, BLIND, "second map has no segments"),
        (BLIND, BLIND, "first map has no segments"),
    ],
)
def test_nothing_to_match_is_said(map_1, map_2, told, heuristic):
    """No segments, with or without a scan: rejected, with the reason, and no candidate."""
    match = verified(map_1, map_2, heuristic=heuristic)
    assert match.verdict is Verdict.REJECTED
    assert told in match.reasons[0]
    assert match.T_1_2 is None
    assert match.score == 0.0
    assert Match.from_json(match.to_json()) == match


def test_one_wall_is_not_enough():
    """A single segment can be laid on another, but walls do not hold it: no acceptance; angles take two."""
    assert len(ONE_WALL) == 1
    match = verified(ONE_WALL, ONE_WALL)
    assert match.ranked
    assert match.verdict is not Verdict.ACCEPTED
    assert any("weakest direction" in reason for reason in match.reasons)
    assert "one segment" in verified(ONE_WALL, ONE_WALL, heuristic="all").reasons[0]


def test_worthless_candidates_are_counted_and_said():
    """Where only the best by value are judged and none has any, the reason is that, not a lack of angles."""
    corner = extract(noisy(simulated.room(), HERE, 1), P)
    large = replace(corner, coordinates=corner.coordinates * 7.0)
    narrow = P.replace(judged_candidates=1, segment_distance_threshold=0.001, point_distance_tolerance=1e-6)
    match = verified(corner, large, narrow, "consecutive")
    assert match.ranked == ()
    assert match.reasons == (f"None of {match.candidates} candidates brings any two segments together.",)
    cross, steps = (
        SegmentMap(np.array(rows), Order.BEAMS, sights=corner.sights)
        for rows in (
            [[-2.0, 0.0, 2.0, 0.0], [0.0, -2.0, 0.0, 2.0]],
            [[0.0, 0.0, 4.0, 0.0], [2.0, 1.0, 2.0, 5.0], [2.0, 1.0, 3.0, 8.0]],
        )
    )
    crossing = verified(cross, steps, P.replace(judged_candidates=1), "all")
    assert crossing.discarded == crossing.candidates == 2
    assert "discarded" in crossing.reasons[0]


def test_a_search_can_be_stopped(in_the_room):
    """Whatever check raises ends the search, at the first call as at the third."""
    for calls in (1, 3):
        left = iter(range(calls - 1))

        def stop(left=left):
            if next(left, None) is None:
                raise CancelledError("stopped")

        with pytest.raises(CancelledError):
            verified(*in_the_room[:2], P, "all" if calls == 1 else None, check=stop)


def test_an_unknown_heuristic_is_told(in_the_room):
    """The error lists what there is; automatic is not for paper mode."""
    with pytest.raises(ParameterError, match="extremes"):
        verified(*in_the_room[:2], heuristic="best")
    with pytest.raises(ParameterError):
        match_maps(*in_the_room[:2], P, AUTOMATIC, "paper")
    assert AUTOMATIC not in heuristics("paper")
    assert set(heuristics("paper")) < set(heuristics("verified"))


# --- the heuristic `extremes` ---------------------------------------------------------------------


def laid(map_1, map_2):
    """Every candidate of ``extremes``, plainly: each segment of map 2 laid on each of map 1."""
    rows = []
    for i, (x1, y1, x2, y2) in enumerate(map_1.coordinates):
        for j, other in enumerate(map_2.coordinates):
            ways = [other] if map_1.directed[i] and map_2.directed[j] else [other, other[[2, 3, 0, 1]]]
            for u1, v1, u2, v2 in ways:
                theta = math.atan2(y2 - y1, x2 - x1) - math.atan2(v2 - v1, u2 - u1)
                turn = Pose2(0.0, 0.0, theta)
                for share in (0.0, 0.5, 1.0):
                    target = np.array([x1 + share * (x2 - x1), y1 + share * (y2 - y1)])
                    shift = target - turn @ np.array([u1 + share * (u2 - u1), v1 + share * (v2 - v1)])
                    rows.append((i, j, *shift, turn.theta))
    return rows


@given(maps(most=5), maps(most=5))
@settings(deadline=None, max_examples=60)
def test_extremes_lays_every_segment_on_every_segment(map_1, map_2):
    """Start on start, end on end or middle on middle, headings equal; undirected ones both ways; nothing else."""
    found = Candidates.joined(list(candidates(map_1, map_2, "extremes", Parameters())))
    assert (found.angles_1[:, 0] == found.angles_1[:, 1]).all()
    ours = [(a[0], b[0], *pose) for a, b, pose in zip(found.angles_1, found.angles_2, found.poses, strict=True)]
    expected = laid(map_1, map_2)
    for row in ours:
        assert any(row[:2] == other[:2] and close(row[2:], other[2:]) for other in expected)
    for other in expected:  # the same pose may come from other segments first
        assert any(close(row[2:], other[2:]) for row in ours)


def close(one, other):
    distance, angle = Pose2(*one).distance(Pose2(*other))
    return distance < 1e-6 and angle < 1e-6
