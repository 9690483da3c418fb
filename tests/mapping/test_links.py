"""What the matches of a log agree on."""

import math
from itertools import pairwise

import numpy as np
import pytest
from found import candidate, match, scans
from simulated import noisy, other_room

from segmap.consensus import voted
from segmap.integration import Verdict
from segmap.links import Link, Pace, agreed, links_by_scan, pace_of, placed_from, steps_between
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.segments import extract
from segmap.visibility import sighting

STEP = Pose2(0.6, 0.02, 0.05)
WRONG = Pose2(4.0, 1.0, 2.0)
REVIEW = {"verdict": Verdict.REVIEW, "confidence": 0.6}


def chain(count, *pairs_apart):
    """Accepted matches of a robot that goes on in equal steps, for pairs of scans so far apart."""
    sequence = scans(*range(count))
    poses = [Pose2.identity()]
    for _ in range(count - 1):
        poses.append(poses[-1] @ STEP)
    matches = {
        (sequence[i], sequence[i + apart]): match(candidate(poses[i].inverse() @ poses[i + apart]))
        for apart in pairs_apart
        for i in range(count - apart)
    }
    return sequence, poses, matches


def test_the_pace_is_that_of_most_steps():
    """It allows what the robot does in a step, twice as much in two, and not what it never did."""
    _, _, matches = chain(20, 1, 2)
    pace = pace_of(matches)
    assert pace.allows(STEP)
    assert pace.allows(STEP @ STEP, 2)
    assert not pace.allows(WRONG)
    assert pace.reaches(Pose2(0.6, 0.0, 3.0))
    assert not pace.allows(Pose2(0.6, 0.0, 3.0))


def test_without_accepted_steps_there_is_no_pace():
    """Nothing is ruled out where nothing is known."""
    sequence, _, _ = chain(3, 1)
    doubtful = {pair: match(candidate(STEP), **REVIEW) for pair in pairwise(sequence)}
    assert pace_of(doubtful).allows(Pose2(100.0, 0.0, 3.0))


def test_what_is_accepted_and_in_pace_is_a_link():
    """Its pose, and a covariance no smaller than any pair deserves."""
    sequence, _, matches = chain(6, 1, 2)
    links = agreed(sequence, matches, pace_of(matches))
    assert set(links) == set(matches)
    assert {link.why for link in links.values()} == {"accepted"}
    assert np.sqrt(np.diag(links[sequence[0], sequence[1]].edge.covariance)).min() >= math.radians(0.4)


def test_a_triangle_saves_a_doubtful_match_and_picks_its_candidate():
    """Two links lead where its third candidate lies: that one is taken, not the best."""
    sequence, poses, matches = chain(8, 1, 2)
    pair = sequence[2], sequence[4]
    true = poses[2].inverse() @ poses[4]
    matches[pair] = match(
        candidate(WRONG, 14.0), candidate(Pose2(-2.0, 0.0, 1.0), 13.0), candidate(true, 12.0), **REVIEW
    )
    links = agreed(sequence, matches, pace_of(matches))
    assert (links[pair].why, links[pair].rank) == ("agreed", 2)
    assert true == links[pair].T_1_2


def test_one_accepted_match_against_many_is_left_out():
    """What others across the same steps contradict is no link, however sure its verdict was."""
    sequence, _, matches = chain(10, 1, 2, 3)
    wrong = sequence[4], sequence[6]
    matches[wrong] = match(candidate(Pose2(-0.8, -0.9, 0.1)))
    pace = pace_of(matches)
    assert pace.allows(matches[wrong].ranked[0].T_1_2, 2)
    links = agreed(sequence, matches, pace)
    assert set(matches) - set(links) == {wrong}


@pytest.mark.parametrize(("second", "taken"), [(WRONG, True), (Pose2(0.5, -0.7, 0.1), False)])
def test_the_only_candidate_in_pace_is_taken(second, taken):
    """A rival elsewhere does not matter; one that the robot could have reached as well does."""
    sequence, _, matches = chain(12, 1)
    pair = sequence[5], sequence[6]
    matches[pair] = match(candidate(STEP, 14.0), candidate(second, 13.5), **REVIEW)
    links = agreed(sequence, matches, pace_of(matches))
    assert (pair in links) is taken


def test_groups_are_placed_by_links_and_only_within():
    """From one scan over links to others; scans outside the group are no way."""
    sequence, poses, matches = chain(5, 1)
    near = links_by_scan(Link.of(pair, found, 0, "accepted") for pair, found in matches.items())
    placed = placed_from(sequence[1], near, sequence)
    for scan, pose in zip(sequence, poses, strict=True):
        assert placed[scan].distance(poses[1].inverse() @ pose)[0] < 1e-9
    assert set(placed_from(sequence[0], near, [sequence[0], *sequence[2:]])) == {sequence[0]}


def test_steps_are_counted_in_the_log():
    """Keyframes may be several scans apart."""
    assert steps_between(tuple(scans(3, 11))) == 8


def test_votes_find_what_no_pair_is_sure_of():
    """Of candidates that all lead elsewhere, the transformation wins that the lines of sight of all pairs support."""
    parameters = preset("verified")
    T_w = [Pose2(0.6 + 0.3 * i, 2.8, 1.0 + 0.1 * i) for i in range(6)]
    world = other_room()
    sequence = scans(*range(6))
    seen = {
        scan: sighting(extract(noisy(world, T, seed), parameters))
        for seed, (scan, T) in enumerate(zip(sequence, T_w, strict=True))
    }
    first, second = sequence[:3], sequence[3:]
    group_1 = {scan: T_w[0].inverse() @ T_w[scan.scan] for scan in first}
    group_2 = {scan: T_w[3].inverse() @ T_w[scan.scan] for scan in second}
    matches = {}
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            true = T_w[a.scan].inverse() @ T_w[b.scan]
            elsewhere = Pose2(3.0 * i - 2.0, 2.0 * j, 1.0 + i + 0.3 * j)
            matches[a, b] = match(candidate(elsewhere, 9.0), candidate(true, 8.0), **REVIEW)
    found = voted(group_1, group_2, matches, seen, parameters)
    assert found.clear
    assert found.T_1_2.distance(T_w[0].inverse() @ T_w[3])[0] < 0.05
    assert len(found.votes) == 9
    assert {vote.rank for vote in found.votes} == {1}
    assert not voted(group_1, group_2, matches, seen, parameters, lambda T: T.x > 1.0 + 0.9).clear
    assert voted(group_1, group_2, {}, seen, parameters) is None


def test_an_unbounded_pace_allows_everything():
    """Logs of which nothing is known are not held to anything."""
    assert Pace(math.inf, math.inf).allows(Pose2(1e6, 0.0, -math.pi))
