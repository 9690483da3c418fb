"""Which pairs are worth matching, and which of their matches close a loop."""

import math
from itertools import pairwise

import pytest
from found import candidate, match, scans
from simulated import noisy, other_room

from segmap.integration import Verdict
from segmap.links import Link, Pace
from segmap.loops import Gate, Promise, Scene, across, agreement, borne_out, closure, in_pace, promising, proposals
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.segments import extract

REVIEW = {"verdict": Verdict.REVIEW, "confidence": 0.95}
HERE = Pose2(1.0, 0.5, 0.3)
PLACES = [Pose2(0.8 + 0.2 * i, 2.6 + 0.1 * i, 0.9 + 0.05 * i) for i in range(9)]


@pytest.fixture(scope="module")
def walk():
    """Nine scans of a room in one frame, their maps and the links that lead along them."""
    parameters = preset("verified")
    sequence = scans(*range(9))
    maps = {s: extract(noisy(other_room(), PLACES[s.scan], s.scan), parameters, 0, s.scan) for s in sequence}
    poses = {s: PLACES[0].inverse() @ PLACES[s.scan] for s in sequence}
    links = [
        Link.of((a, b), match(candidate(poses[a].inverse() @ poses[b])), 0, "accepted") for a, b in pairwise(sequence)
    ]
    return Scene(maps, sequence, parameters), sequence, poses, links


@pytest.mark.parametrize(("around", "off", "allowed"), [(0.0, 0.4, True), (0.0, 0.7, False), (40.0, 1.5, True)])
def test_the_gate_grows_with_the_way_around_the_loop(around, off, allowed):
    """After 40 m a closure may be a metre and a half off, at once it may not."""
    assert Gate(HERE, around).allows(Pose2(HERE.x + off, HERE.y, HERE.theta)) is allowed


def test_what_sees_the_same_place_is_promising(walk):
    """Of all pairs those that should share enough, spread, without what was tried; most promising first."""
    scene, sequence, poses, links = walk
    found = promising(scene, poses, [sequence], links, set())
    assert found
    overlaps = [promise.overlap for promise in found]
    assert overlaps == sorted(overlaps, reverse=True)
    taken = [(p.pair[0].scan, p.pair[1].scan) for p in found]
    assert all(max(abs(a - c), abs(b - d)) > 1 for a, b in taken for c, d in taken if (a, b) != (c, d))
    tried = {found[0].pair}
    assert found[0].pair not in {p.pair for p in promising(scene, poses, [sequence], links, tried)}
    first = found[0]
    way = sum(math.hypot(link.T_1_2.x, link.T_1_2.y) for link in links[first.pair[0].scan : first.pair[1].scan])
    assert first.gate.around == pytest.approx(way, abs=0.3)
    halves = promising(scene, poses, [sequence[:4], sequence[4:]], links, set())
    assert not any(p.pair[0] in sequence[:4] and p.pair[1] in sequence[4:] for p in halves)


def test_a_closure_lies_in_the_gate():
    """Accepted and in the gate: a closure. Accepted elsewhere: none, whatever else lies in the gate."""
    promise = Promise(tuple(scans(3, 90)), 0.8, Gate(HERE, 5.0))
    assert closure(promise, match(candidate(HERE))).T_1_2 == HERE
    assert closure(promise, match(candidate(Pose2(5.0, 5.0, 1.0)), candidate(HERE, 11.0))) is None
    assert closure(promise, match()) is None


def test_the_only_likely_candidate_in_the_gate_closes_the_loop():
    """What a person would have to decide on is decided by where it should lie, unless two lie there."""
    promise = Promise(tuple(scans(3, 90)), 0.8, Gate(HERE, 5.0))
    elsewhere, beside = Pose2(6.0, 0.0, 2.0), Pose2(1.3, 0.5, 0.3)
    found = closure(promise, match(candidate(elsewhere, 14.0), candidate(HERE, 13.5), **REVIEW))
    assert (found.rank, found.why) == (1, "closed")
    assert closure(promise, match(candidate(HERE, 14.0), candidate(beside, 13.5), **REVIEW)) is None
    assert closure(promise, match(candidate(HERE, 0.5, contradicted=3.0), **REVIEW)) is None


def test_proposals_come_in_the_order_of_how_many_say_so():
    """Accepted matches between two components, turned into one frame, whichever scan comes first."""
    part, other = scans(0, 2, 9), scans(4, 5, 6)
    poses = {scan: Pose2(0.5 * scan.scan, 0.0, 0.1) for scan in (*part, *other)}
    T = Pose2(3.0, -1.0, 1.2)
    matches = {
        (a, b): match(candidate(poses[a].inverse() @ T @ poses[b]))
        for a, b in ((part[0], other[0]), (part[1], other[1]))
    }
    matches[other[2], part[2]] = match(candidate(poses[other[2]].inverse() @ T.inverse() @ poses[part[2]]))
    matches[part[0], other[2]] = match(candidate(Pose2(9.0, 9.0, -1.0)))
    matches[part[1], other[2]] = match(candidate(Pose2(-9.0, 9.0, -1.0)), **REVIEW)
    first, *others = proposals(poses, part, other, matches)
    assert first.distance(T)[0] < 1e-9
    assert len(others) == 1


def test_a_proposal_is_borne_out_by_the_pairs_it_predicts(walk):
    """Pairs across that should see the same place are asked; half of them at least must close."""
    scene, sequence, poses, _ = walk
    part, other = sequence[:5], sequence[5:]
    true = Pose2.identity()
    promises = across(scene, poses, part, other, true)
    assert {p.pair[0] for p in promises} <= set(part)
    right = {p.pair: match(candidate(p.gate.T_1_2)) for p in promises}
    wrong = {p.pair: match(candidate(Pose2(8.0, 0.0, 0.0))) for p in promises}
    assert len(borne_out(promises, right)) == len(promises) >= 3
    assert borne_out(promises, wrong) == []
    assert borne_out(promises[:2], right) == []


def test_lines_of_sight_across_two_components_agree_only_where_they_lie_right(walk):
    """Turned round in the room they contradict each other."""
    scene, sequence, poses, _ = walk
    part, other = sequence[:5], sequence[5:]
    assert agreement(scene, poses, part, other, Pose2.identity()) > 0.9
    turned = Pose2(0.0, 0.0, 0.5)
    assert agreement(scene, poses, part, other, turned) < 0.65


def test_components_of_one_log_lie_where_its_robot_could_go():
    """A step from one to the other is a step; between logs nothing is known."""
    part, other = scans(0, 1), scans(2, 3)
    poses = dict.fromkeys((*part, *other), Pose2.identity())
    paces = {0: Pace(1.0, 1.0)}
    assert in_pace(poses, part, other, Pose2(0.9, 0.0, 3.0), paces)
    assert not in_pace(poses, part, other, Pose2(1.5, 0.0, 0.0), paces)
    elsewhere = scans(2, 3, log=1)
    poses.update(dict.fromkeys(elsewhere, Pose2.identity()))
    assert in_pace(poses, part, elsewhere, Pose2(50.0, 0.0, 0.0), paces)
