"""Scans that nothing holds: where they stand in their log, and where they are placed."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from found import candidate, match, scans
from simulated import noisy, other_room, room

from segmap.consensus import sightings, voted
from segmap.graph import optimise
from segmap.holding import weakly_held
from segmap.links import Link, Pace
from segmap.mapping import _reconsider, _Task
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import LaserScan, ScanId
from segmap.segments import extract
from segmap.spreading import Crew
from segmap.strays import Stray, placed, strays

PARAMETERS = preset("verified")
PLACES = [Pose2(0.8 + 0.2 * i, 2.6 + 0.1 * i, 0.9 + 0.05 * i) for i in range(7)]
WALK = scans(*range(7))
PACE = {0: Pace(1.0, math.radians(20.0))}


@pytest.fixture(scope="module")
def walk():
    """Seven scans of a room and where they are in the frame of the first."""
    maps = {s: extract(noisy(other_room(), PLACES[s.scan], s.scan), PARAMETERS, 0, s.scan) for s in WALK}
    return maps, {s: PLACES[0].inverse() @ PLACES[s.scan] for s in WALK}


def stray_of(*own):
    """Some scans of the walk, away from all the others."""
    home = tuple(scan for scan in WALK if scan not in own)
    (stray,) = strays(WALK, [home, *([own] if len(own) > 1 else [])])
    return stray


def left_alone(stray, poses):
    """The poses once a stray has a frame of its own, or none."""
    first = poses[stray.scans[0]].inverse()
    alone = {scan: first @ poses[scan] for scan in stray.scans} if len(stray.scans) > 1 else {}
    return {scan: poses[scan] for scan in stray.home} | alone


def test_a_stray_stands_beside_a_larger_component_of_its_log():
    """Components and scans that hang on nothing; the largest first, each with its neighbours at home."""
    a, b, c, d, e, f, g = WALK
    other = ScanId(1, 0)
    found = strays([*WALK, other], [(a, b, e, f), (c, d)])
    assert found == [Stray((c, d), (a, b, e, f), b, e), Stray((g,), (a, b, e, f), f, None)]
    assert found[0].ends == ((b, c), (e, d))
    assert strays(WALK, [WALK]) == []
    assert strays([], []) == []


@pytest.mark.parametrize("own", [(0,), (3,), (6,), (2, 3, 4)])
def test_a_stray_is_placed_by_all_scans_around_it(walk, own):
    """At the begin of a log, in it, at its end; also several scans at once. Every link says where it is."""
    maps, poses = walk
    stray = stray_of(*(WALK[i] for i in own))
    matches = {}
    links = placed(stray, Crew(maps, PARAMETERS), left_alone(stray, poses), PACE, matches)
    assert {scan for link in links for scan in link.pair if scan in stray.scans} == set(stray.scans)
    assert all(link.first < link.second and link.pair in matches for link in links)
    for link in links:
        off, turn = link.T_1_2.distance(poses[link.first].inverse() @ poses[link.second])
        assert off < 0.15
        assert turn < math.radians(3.0)


def test_a_stray_that_cannot_have_got_there_is_not_placed(walk):
    """The robot would have had to go faster than it does."""
    maps, poses = walk
    stray = stray_of(WALK[3])
    slow = {0: Pace(0.05, math.radians(1.0))}
    assert placed(stray, Crew(maps, PARAMETERS), left_alone(stray, poses), slow, {}) == []


def blind():
    return LaserScan(np.full(180, np.nan), -math.pi / 2, math.pi / 180.0)


@pytest.mark.parametrize("scan", [blind(), noisy(room(), Pose2(3.0, 2.5, 0.3), 5)])
def test_what_saw_nothing_of_the_place_is_not_placed(walk, scan):
    """Neither a scan without returns nor one of another room."""
    maps, poses = walk
    strange = {**maps, WALK[3]: extract(scan, PARAMETERS, 0, 3)}
    stray = stray_of(WALK[3])
    assert placed(stray, Crew(strange, PARAMETERS), left_alone(stray, poses), PACE, {}) == []


def test_pairs_vote_whichever_scan_is_the_earlier(walk):
    """The transformation of two groups is the inverse of theirs the other way round."""
    maps, poses = walk
    early, late = ({scan: poses[scan] for scan in some} for some in (WALK[:2], WALK[4:6]))
    matches = Crew(maps, PARAMETERS).matches([(a, b) for a in early for b in late], "")
    seen = sightings(maps, WALK)
    forth, back = (voted(*groups, matches, seen, PARAMETERS) for groups in ((early, late), (late, early)))
    assert max(forth.T_1_2.distance(Pose2.identity())) < 0.1
    assert max(forth.T_1_2.inverse().distance(back.T_1_2)) < 0.1
    assert {vote.pair for vote in forth.votes} == {vote.pair for vote in back.votes}


def test_a_passer_by_does_not_cost_a_scan_its_place(walk, monkeypatch):
    """Something broad that all others see through: where pairs are of no clear opinion, their joint view is.

    Only between two neighbours: at the end of a log nobody knows how far the robot went.
    """
    monkeypatch.setattr("segmap.strays.voted", lambda *_: None)
    maps, poses = walk
    scan = noisy(other_room(), PLACES[3], 3)
    ranges = scan.ranges.copy()
    ranges[60:100] = np.minimum(ranges[60:100], 1.1)
    crowded = {**maps, WALK[3]: extract(LaserScan(ranges, scan.first_angle, scan.angle_step), PARAMETERS, 0, 3)}
    stray = stray_of(WALK[3])
    links = placed(stray, Crew(crowded, PARAMETERS), left_alone(stray, poses), PACE, {})
    assert len(links) >= 2
    for link in links:
        off, turn = link.T_1_2.distance(poses[link.first].inverse() @ poses[link.second])
        assert off < 0.3
        assert turn < math.radians(4.0)
    last = stray_of(WALK[6])
    assert placed(last, Crew(maps, PARAMETERS), left_alone(last, poses), PACE, {}) == []


def test_what_one_doubtful_step_holds_is_voted_on_again(walk):
    """Two scans that a doubtful step put 2 m off are where all scans around them say, and no longer in doubt."""
    maps, poses = walk
    own = WALK[5:]
    off = {scan: Pose2(2.0, 0.0, 0.0) @ poses[scan] if scan in own else poses[scan] for scan in WALK}
    firm = [*pairwise(WALK[:5]), *pairwise(own)]
    links = {(a, b): link_at(off[a].inverse() @ off[b], a, b, "accepted") for a, b in firm}
    wrong = WALK[4], WALK[5]
    links[wrong] = link_at(off[wrong[0]].inverse() @ off[wrong[1]], *wrong, "voted")
    task = _Task(Crew(maps, PARAMETERS), PACE)
    _reconsider(task, optimise([link.edge for link in links.values()]), links, {})
    after = optimise([link.edge for link in links.values()])
    assert max(after.poses[scan].distance(poses[scan])[0] for scan in WALK) < 0.15
    assert weakly_held([*links.values()], after.components) == {}


def link_at(T_1_2, first, second, why):
    """A link made by hand."""
    return replace(Link.of((first, second), match(candidate(T_1_2)), 0, "accepted"), why=why)
