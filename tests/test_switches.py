"""Every extra of verified mode can be switched off, one by one; with all of them off it is paper mode."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import real_pairs
import simulated
from hypothesis import given, settings
from worlds import maps

from segmap.integration import AUTOMATIC, Match, heuristics, match_maps
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.verdict import Verdict
from segmap.verification import views
from segmap.visibility import look, score

P = preset("verified")
SWITCHES = ("use_sights", "use_refinement", "use_rivals", "use_confidence")
ALL_OFF = dict.fromkeys(SWITCHES, False)
HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)


@pytest.fixture(scope="module")
def in_the_room():
    """Two scans of a furnished room, with noise, and their true pose."""
    return simulated.pair(simulated.room(), HERE, THERE, P, seed=3)


def verified(pair, heuristic="all", **changes):
    return match_maps(*pair[:2], P.replace(**changes), heuristic, "verified")


def the_same(match, paper):
    """Whether two matches say the same of the same, mode and time apart."""
    return replace(match, mode="", milliseconds=0.0) == replace(paper, mode="", milliseconds=0.0)


@pytest.mark.parametrize("heuristic", heuristics("paper"))
def test_all_off_is_paper_mode(in_the_room, heuristic):
    """Ranking, values, chains, verdict and reasons to the last bit, with every heuristic of the paper."""
    for changes in ({}, {"value_threshold": 99.0}, {"good_enough": 1.0}, {"ranked_candidates": 7}):
        match = verified(in_the_room, heuristic, **ALL_OFF, **changes)
        paper = match_maps(*in_the_room[:2], P.replace(**changes), heuristic, "paper")
        assert the_same(match, paper)
        assert match.ranked[0].value == paper.ranked[0].value


@given(maps(most=5), maps(most=5))
@settings(deadline=None, max_examples=40)
def test_all_off_is_paper_mode_on_any_maps(map_1, map_2):
    """Without scans, undirected, empty: the same, reasons included."""
    off = P.replace(**ALL_OFF)
    assert the_same(match_maps(map_1, map_2, off, "all", "verified"), match_maps(map_1, map_2, off, "all", "paper"))


def test_all_off_is_paper_mode_on_real_pairs(benchmarks, datasets):
    """One pair of each kind of each log."""
    off = P.replace(**ALL_OFF)
    for log, pair in real_pairs.some(benchmarks, datasets, each=1):
        found = real_pairs.maps(pair, log, P)
        assert the_same(match_maps(*found, off, "all", "verified"), match_maps(*found, off, "all", "paper"))


def test_automatic_with_all_off_is_the_papers_default(in_the_room):
    """There is no evidence to stop on: all candidates, by value."""
    match = verified(in_the_room, AUTOMATIC, **ALL_OFF)
    assert match.ranked == match_maps(*in_the_room[:2], P, "all", "paper").ranked


@pytest.mark.parametrize("on", list(itertools.product((False, True), repeat=4)), ids=str)
def test_any_of_them_can_be_on(in_the_room, on):
    """Each of the sixteen ways finds the pose of a furnished room, tells what it knows, and survives JSON."""
    switches = dict(zip(SWITCHES, on, strict=True))
    match = verified(in_the_room, "extremes" if any(on[:3]) else "all", **switches)
    sights, refinement, rivals, confidence = on
    assert match.T_1_2.distance(in_the_room[2])[0] < (0.05 if refinement else 0.5)
    assert (match.confidence is not None) == (sights and confidence)
    assert all((candidate.evidence is not None) == sights for candidate in match.ranked)
    assert all((candidate.score is not None) == sights for candidate in match.ranked)
    assert all((candidate.uncertainty is not None) == refinement for candidate in match.ranked)
    merits = [candidate.score if sights else candidate.value for candidate in match.ranked]
    assert merits == sorted(merits, reverse=True)
    if rivals:
        for one, other in itertools.combinations(match.ranked, 2):
            distance, angle = one.T_1_2.distance(other.T_1_2)
            assert distance >= P.rival_distance or angle >= P.rival_angle
    assert Match.from_json(match.to_json()) == match


def test_without_sights_values_rank(in_the_room):
    """The best of what is refined has at least the value of the best that is not; crossing ones are left out."""
    refined = verified(in_the_room, use_sights=False)
    paper = match_maps(*in_the_room[:2], P, "all", "paper")
    assert refined.value > 0.9 * paper.value
    assert refined.findings.evidence is None
    assert refined.verdict is Verdict.ACCEPTED
    assert verified(in_the_room, use_sights=False, value_threshold=99.0).verdict is Verdict.REJECTED


def test_without_refinement_candidates_stay_where_they_are(in_the_room):
    """Every ranked pose is that of a candidate, ranked by its lines of sight; nothing is said of firmness."""
    match = verified(in_the_room, "extremes", use_refinement=False)
    seen = views(*in_the_room[:2], P)
    totals = look(*seen.seen, np.array([tuple(c.T_1_2) for c in match.ranked]), P)
    assert [c.score for c in match.ranked] == pytest.approx(score(totals, P).tolist())
    assert not any("weakest direction" in reason for reason in match.reasons)
    refined = verified(in_the_room, "extremes")
    assert refined.best.score > match.best.score


def test_without_rivals_nothing_is_ambiguous():
    """A corridor of equal doors: as good elsewhere, but nobody asked."""
    bare = simulated.pair(simulated.corridor(), Pose2(100.0, 1.0, 0.05), Pose2(101.0, 1.1, 0.2), P, 10, 12.0)
    assert any("rival" in reason for reason in verified(bare, "extremes").reasons)
    alone = verified(bare, "extremes", use_rivals=False)
    assert not any("rival" in reason for reason in alone.reasons)
    assert alone.findings.gap == alone.findings.score


def test_without_confidence_the_value_decides(in_the_room):
    """Above the threshold accepted, below rejected, whatever lines of sight say; none is reported."""
    assert verified(in_the_room, "extremes", use_confidence=False).verdict is Verdict.ACCEPTED
    low = verified(in_the_room, "extremes", use_confidence=False, value_threshold=99.0)
    assert low.verdict is Verdict.REJECTED
    assert low.confidence is None
    assert low.score == low.value
