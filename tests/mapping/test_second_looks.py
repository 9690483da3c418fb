"""Scans a few pairs misled: found by what all around them see together."""

import math
from itertools import combinations

import pytest
from found import candidate, match, scans
from simulated import noisy, other_room

from segmap.graph import optimise
from segmap.links import Link, Pace
from segmap.loops import Scene
from segmap.mapping import _look_again, _Task
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.second_looks import better_places
from segmap.segments import extract
from segmap.spreading import Crew

PARAMETERS = preset("verified")
PLACES = [Pose2(0.8 + 0.2 * i, 2.6 + 0.1 * i, 0.9 + 0.05 * i) for i in range(6)]
WALK = scans(*range(6))
TURNED = WALK[3]
ASKEW = Pose2(0.1, 0.0, math.radians(8.0))


@pytest.fixture(scope="module")
def walk():
    """Six scans of a room, where they are in the frame of the first, and the matches of all pairs."""
    maps = {s: extract(noisy(other_room(), PLACES[s.scan], s.scan), PARAMETERS, 0, s.scan) for s in WALK}
    poses = {s: PLACES[0].inverse() @ PLACES[s.scan] for s in WALK}
    return maps, poses, Crew(maps, PARAMETERS).matches(list(combinations(WALK, 2)), "")


def test_scans_that_lie_right_stay(walk):
    """Nobody knows better, with many matches, without any, and of nothing."""
    maps, poses, matches = walk
    assert list(better_places(maps, WALK, poses, matches, PARAMETERS)) == []
    assert list(better_places(maps, WALK, poses, {}, PARAMETERS)) == []
    assert list(better_places(maps, [], {}, matches, PARAMETERS)) == []
    assert list(better_places(maps, WALK[:1], poses, matches, PARAMETERS)) == []


def test_a_turned_scan_is_found_and_where_it_belongs(walk):
    """By the joint view of those around it; they stay."""
    maps, poses, matches = walk
    wrong = {**poses, TURNED: poses[TURNED] @ ASKEW}
    ((scan, T, around),) = better_places(maps, WALK, wrong, matches, PARAMETERS)
    assert scan == TURNED
    assert TURNED not in around
    off, turn = T.distance(poses[TURNED])
    assert off < 0.06
    assert turn < math.radians(1.5)


def test_what_turned_a_scan_no_longer_holds_it(walk):
    """The links that say where it is not are gone, those of the scans around it hold it."""
    maps, poses, matches = walk
    held = {**poses, TURNED: poses[TURNED] @ ASKEW}
    links = {
        (a, b): Link.of((a, b), match(candidate(held[a].inverse() @ held[b])), 0, "accepted")
        for a, b in combinations(WALK, 2)
    }
    task = _Task(Crew(maps, PARAMETERS), {0: Pace(1.0, 1.0)})
    _look_again(task, Scene(maps, WALK, PARAMETERS), links, matches)
    after = optimise([link.edge for link in links.values()]).poses
    assert after[TURNED].distance(poses[TURNED])[1] < math.radians(1.5)
    untouched = {pair for pair in links if TURNED not in pair}
    assert untouched == {pair for pair in combinations(WALK, 2) if TURNED not in pair}
