"""A walkthrough shows the run that happened, in any order, as plain data."""

import json

import numpy as np
import pytest

from app.resources import samples_folder
from segmap.integration import integrate, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap, extract
from segmap.walkthrough import ALGORITHMS, walk_maps, walk_merge, walk_scans

WAYS = [("paper", name) for name in ("all", "consecutive", "random", "histogram")]
WAYS += [("verified", name) for name in (None, "extremes")]


@pytest.fixture(scope="module")
def scans():
    """Two neighbouring scans of the cluttered laboratory."""
    log = read_log(samples_folder() / "laboratory.log")
    return log[0], log[1]


@pytest.fixture(scope="module", params=WAYS, ids=lambda way: "-".join(map(str, way)))
def made(request, scans):
    """A walkthrough by each heuristic, in both modes."""
    mode, heuristic = request.param
    return walk_scans(*scans, preset("verified" if mode == "verified" else "default"), heuristic, mode)


def some(stage, most=60):
    """Numbers of steps: all of few, the first, the last, the marked and some of many."""
    even = range(0, stage.count, max(1, stage.count // most))
    return sorted({*even, stage.count - 1, *(mark.index for mark in stage.marks), *stage.stops[:20]})


def test_the_run_is_the_one_without_recording(made, scans):
    """What is walked through is what INTEGRATE gives by itself."""
    match = made.integration.match
    parameters = preset("verified" if match.mode == "verified" else "default")
    maps = [extract(scan, parameters) for scan in scans]
    plain = integrate(*maps, parameters, match.heuristic, match.mode).match
    assert plain.ranked == match.ranked
    assert len(made.found) == plain.candidates
    if match.mode == "paper" and plain.best is not None:
        assert made.found.best == plain.best.index
        assert made.found.values[made.found.best] == plain.value
        assert len(made.found.discarded) == plain.discarded


def test_every_step_is_plain_data_with_a_line_that_exists(made):
    """Each step can be sent, names a line of its stage's algorithm, and says something."""
    for stage in made.walk.stages:
        numbers = {line.number for line in ALGORITHMS[stage.algorithm].lines}
        json.dumps(stage.to_json(), allow_nan=False)
        for k in some(stage):
            told = stage.step(k).to_json()
            json.dumps(told, allow_nan=False)
            assert told["line"] in numbers, (stage.id, k)
            assert len(told["say"]) > 20
            assert all(shape.get("of", "first") in made.walk.base for shape in told["shapes"])


def test_forward_then_back_is_the_same_picture(made):
    """A step is the same whichever way one comes to it."""
    for stage in made.walk.stages:
        numbers = some(stage, most=15)
        forward = [stage.step(k).to_json() for k in numbers]
        assert [stage.step(k).to_json() for k in reversed(numbers)] == forward[::-1], stage.id


def test_the_best_candidate_is_marked(made):
    """One can jump to the moment the best was found, and the picture there has its pose and its value."""
    found = made.found
    stage = made.walk.stage("evaluation")
    (at,) = [mark.index for mark in stage.marks if mark.label == "the moment the best candidate was found"]
    step = stage.step(at)
    assert step.line == "21"
    assert ("value", f"{found.values[found.best]:.3f}", "m") in step.quantities
    pose = next(shape["pose"] for shape in step.shapes if shape.get("of") == "second")
    np.testing.assert_allclose(pose, found.held.poses[found.best], atol=1e-6)


def test_pair_by_pair_adds_up_to_the_value(made):
    """The last pair of a candidate says the value that the kernel gives it."""
    found = made.found
    alive = np.flatnonzero(found.values > 0.0)[:3]
    for k in alive.tolist():
        stage = made.walk.stage(f"pairs:{k + 1}")
        told = {name: value for name, value, _ in stage.step(stage.count - 1).quantities}
        assert told["value so far"] == f"{found.values[k]:.3f}"
    assert made.walk.stage("pairs:0") is None
    assert made.walk.stage(f"pairs:{len(found) + 1}") is None
    assert made.walk.stage("pairs:x") is None


def test_a_discarded_candidate_says_which_segments_cross(scans):
    """The reason is there in words, with the crossing marked, and pair by pair as well."""
    made = walk_scans(*scans, heuristic="all")
    found = made.found
    assert len(found.discarded)
    k = int(found.discarded[0])
    step = made.walk.stage("evaluation").step(k + 1)
    assert step.line == "7"
    assert "cross" in step.say
    assert any(shape.get("mark") == "cross" for shape in step.shapes)
    pairs = made.walk.stage(f"pairs:{k + 1}")
    assert "7" in {pairs.step(mark.index).line for mark in pairs.marks}
    assert pairs.step(pairs.count - 1).line == "7", "nothing is compared after the pair that discards it"
    assert "will be discarded" in pairs.step(0).say
    assert pairs.step(0).quantities == (("value", "discarded", ""),)
    assert {pairs.step(k).line for k in range(1, pairs.count - 1)} <= {"10", "14", "16", "18"}


def test_verified_mode_says_what_chooses(scans):
    """The value does not choose; the result names the candidate, and its value before and after refinement."""
    made = walk_scans(*scans, preset("verified"), None, "verified", names=("0.0", "0.1"))
    best, found = made.integration.match.best, made.found
    assert "the value does not choose" in made.walk.stage("evaluation").about
    assert "Scan 0.0 of the log" in made.walk.stage("points-1").step(0).say
    last = made.walk.stage("result").step(made.walk.stage("result").count - 1).say
    assert f"candidate {best.index + 1}, refined: its value was {found.values[best.index]:.3f} m" in last
    assert f"now its value is {best.value:.3f} m" in last
    assert f"{best.evidence.contradicted:.2f} m contradicted, {best.evidence.shadowed:.2f} m shadowed" in last
    assert "are seen by both" not in last


def test_lines_of_sight_tell_their_weights(scans):
    """Each kind says how many metres it is, how they count and what the score loses by it; together they are it."""
    parameters = preset("verified").replace(unseen_weight=0.3)
    stage = walk_scans(*scans, parameters, None, "verified").walk.stage("sight")
    parts = [{name: float(value) for name, value, _ in stage.step(k).quantities} for k in range(5)]
    assert abs(sum(part["part of the score"] for part in parts[1:]) - parts[0]["score"]) < 0.003
    assert all(colour in stage.step(0).say for colour in ("Green", "Red", "Orange", "Grey"))
    assert "they count 0.3 times, so the score loses" in stage.step(4).say
    for k, part in enumerate(parts[1:], start=1):
        said = stage.step(k).say
        assert "nothing is" in said or f"{abs(part['part of the score']):.2f} m" in said


def test_a_polyline_says_how_far_its_farthest_segment_lies(made):
    """Greedy ends when no segment is far, or when those still far were used; then it says how far they are."""
    stage = made.walk.stage("polylines")
    for step in map(stage.step, range(stage.count)):
        if "is done" in step.say:
            (far,) = [float(value) for name, value, _ in step.quantities if name.startswith("farthest")]
            assert ("was used already" in step.say) == (far > 0.05)


def test_laid_candidates_lie_as_they_say(scans):
    """Under a candidate of starts the starts coincide, and so for ends and middles."""
    made = walk_scans(*scans, preset("verified"), "extremes", "verified")
    found, stage = made.found, made.walk.stage("candidates")
    shares = {"start on start": 0.0, "end on end": 1.0, "middle on middle": 0.5}
    for k in range(0, len(found), 37):
        (share,) = [share for words, share in shares.items() if words in stage.step(k + 1).say]
        (i, _), (j, _) = found.pairs(k)
        one, other = found.map_1.coordinates[i], found.map_2.moved(found.pose(k)).coordinates[j]
        at = [ends[:2] + share * (ends[2:] - ends[:2]) for ends in (one, other)]
        np.testing.assert_allclose(*at, atol=1e-9)


def test_points_end_as_the_segments_of_the_scan(made):
    """Bend by bend the polylines become the segments, each bend through the farthest point."""
    stage = made.walk.stage("points-1")
    last = stage.step(stage.count - 1)
    assert ("segments", str(len(made.walk.base["first"])), "") in last.quantities
    for k in range(2, stage.count - 1):
        step = stage.step(k)
        (distance,) = [float(value) for name, value, _ in step.quantities if name.startswith("farthest")]
        assert (distance > 0.03 - 5e-4) if step.line in "34" else distance <= 0.03 + 5e-4


def test_chains_end_as_those_of_the_match(made):
    """After the last pair there are as many chains as the match has."""
    match = made.integration.match
    stage = made.walk.stage("chains")
    assert ("chains so far", str(len(match.chains)), "") in stage.step(stage.count - 1).quantities


def test_every_pair_left_out_says_why():
    """Consecutive and histogram give a reason for each pair of segments they do not take."""
    room = SegmentMap(
        np.array([[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 3.9, 3.05], [3.9, 3.05, 0, 3], [0, 3, -1, 2.0]]), "beams"
    )
    for heuristic, words in (("consecutive", ("shorter than", "follow each other")), ("histogram", ("bucket",))):
        walk = walk_maps(room, room.moved(Pose2(0.3, 0.1, 0.4)), Parameters(), heuristic).walk
        said = " ".join(walk.stage("angles-1").step(k).say for k in range(11))
        assert all(word in said for word in words)
        assert "not asked for" not in said


def test_nothing_to_see_is_said():
    """Two maps without a candidate give a walkthrough that ends in a verdict with its reason."""
    empty = SegmentMap.empty()
    walk = walk_maps(empty, empty).walk
    assert [stage.id for stage in walk.stages][-1] == "result"
    last = walk.stages[-1]
    assert "no segments" in last.step(last.count - 1).say


def test_the_pivot_method_is_entered_where_it_integrated():
    """Its maps grow, but INTEGRATE is called on two neighbours alone: told, and gone into, is that call."""
    log, parameters = read_log(samples_folder() / "hall.log"), preset("verified")
    maps = {ScanId(0, k): extract(log[k], parameters, 0, k) for k in range(4)}
    made = walk_merge(maps, parameters, None, "verified")
    step = made.walk.stage("pivot").step(2)
    match = match_maps(maps[ScanId(0, 1)], maps[ScanId(0, 2)], parameters, None, "verified")
    assert f"saw scan 1 and scan 2 alone, and gave them a value of {match.value:.2f} m" in step.say
    entered = made.enter(step.enter["node"])
    assert entered.walk.title == "scan 1 with scan 2"
    assert "INTEGRATE gave it" in made.walk.stage("sequential").step(2).say
    assert (
        "the map of scans 0 to 1 with scan 2"
        in made.enter(made.walk.stage("sequential").step(2).enter["node"]).walk.title
    )


def test_what_could_not_be_joined_is_told():
    """Scans of two rooms end in two maps: the plan says of which scans, and which of them the picture shows."""
    parameters = preset("verified")
    near, far = (read_log(samples_folder() / name) for name in ("hall.log", "laboratory.log"))
    scans = [near[0], near[1], far[40], far[41]]
    maps = {ScanId(0, k): extract(scan, parameters, 0, k) for k, scan in enumerate(scans)}
    made = walk_merge(maps, parameters, None, "verified")
    assert "2 maps are left, of scans 0 to 1 and of scans 2 to 3; the picture shows the first" in (
        made.walk.stage("pivot").step(0).say
    )
    assert "the numbers are of all" in made.walk.stage("comparison").step(2).say
