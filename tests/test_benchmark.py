"""The pair benchmark: what counts as right, as among the first three, as a failure; times; the brute-force twin."""

import math
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from segmap import benchmark
from segmap.benchmark import (
    NEGATIVE,
    RIVALS,
    Outcome,
    Pair,
    PairSet,
    brute_force,
    first_rivals,
    is_right,
    run_pairs,
    score,
)
from segmap.integration import MODES, Candidate, Match, Verdict, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import SegmentMap, extract

ROOT = Path(__file__).resolve().parents[1]
VERIFIED = preset("verified")
SAME = {"x": 0.0, "y": 0.0, "theta": 0.0}


@pytest.fixture(scope="module")
def office():
    return read_log(ROOT / "sample_logs" / "office.log")


def a_match(*poses: Pose2, verdict: Verdict = Verdict.ACCEPTED) -> Match:
    """A match with these candidates, best first."""
    ranked = tuple(Candidate(T, 9.0 - k, (0, 1), (0, 1), k) for k, T in enumerate(poses))
    return Match("paper", "all", (2, 2), ranked, len(poses), 0, None, (), verdict, ("because",), 1.0)


def an_outcome(pair: Pair, match: Match, **times: float) -> Outcome:
    refused = pair.kind == NEGATIVE and match.verdict is not Verdict.ACCEPTED
    rivals = first_rivals(match, Parameters())
    cost = {"milliseconds": 1.0, "cpu_milliseconds": 1.0, **times}
    return Outcome(pair, match, refused or is_right(match.T_1_2, pair.truth), rivals=rivals, **cost)


def a_pair(kind: str = "wide") -> Pair:
    return Pair(kind=kind, i=0, j=1, **SAME)


def off(metres: float) -> Pose2:
    return Pose2(metres, 0.0, 0.0)


# --- rivals ---------------------------------------------------------------------------------------


def test_rivals_are_the_first_distinct_ones():
    """A pose within the rival distance and angle of a better one is no rival of its own."""
    near, far, turned = off(0.1), off(2.0), Pose2(0.0, 0.0, 1.0)
    match = a_match(off(0.0), near, far, Pose2(2.0, 0.1, 0.05), turned, off(5.0))
    assert [rival.T_1_2 for rival in first_rivals(match, Parameters())] == [off(0.0), far, turned]
    assert len(first_rivals(match, Parameters(), most=4)) == 4
    assert first_rivals(a_match(), Parameters()) == ()


def test_the_ranked_candidates_of_verified_mode_are_distinct_already(office):
    """There, the rivals are the first ones as they stand."""
    match = match_maps(extract(office[0], VERIFIED), extract(office[2], VERIFIED), VERIFIED, mode="verified")
    assert first_rivals(match, VERIFIED) == match.ranked[:RIVALS]


@pytest.mark.parametrize(("place", "among"), [(0, True), (1, True), (2, True), (3, False)])
def test_a_person_is_shown_three(place, among):
    """The right pose counts as shown at the first, second and third place, not at the fourth."""
    poses = [off(3.0 * k) for k in range(1, 4)]
    poses.insert(place, off(0.0))
    outcome = an_outcome(a_pair(), a_match(*poses))
    assert outcome.among_first is among
    assert outcome.right is (place == 0)


# --- what went wrong ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "poses", "verdict", "fault"),
    [
        ("wide", [off(0.0)], Verdict.ACCEPTED, ""),
        ("wide", [off(0.0)], Verdict.REVIEW, ""),
        ("wide", [off(0.0)], Verdict.REJECTED, "right, but rejected"),
        ("wide", [off(1.0), off(0.0)], Verdict.REVIEW, "wrong, review"),
        ("wide", [off(1.0)], Verdict.REVIEW, "wrong, review, not among the first 3"),
        ("wide", [off(1.0)], Verdict.ACCEPTED, "accepted and wrong, not among the first 3"),
        ("wide", [], Verdict.REJECTED, "wrong, rejected, not among the first 3"),
        (NEGATIVE, [off(1.0)], Verdict.ACCEPTED, "accepted without a common wall"),
        (NEGATIVE, [off(1.0)], Verdict.REVIEW, ""),
        (NEGATIVE, [off(0.0)], Verdict.REJECTED, ""),
    ],
)
def test_what_is_a_failure(kind, poses, verdict, fault):
    """A wrong pose, a right one refused, an acceptance where nothing is in common; asking a person is none."""
    assert an_outcome(a_pair(kind), a_match(*poses, verdict=verdict)).fault == fault


def test_right_is_within_both_limits():
    """0.25 m and 5 degrees, both included; nothing is right without a truth."""
    truth = Pose2(1.0, 2.0, 3.0)
    assert is_right(Pose2(1.249, 2.0, 3.0 + math.radians(4.99)), truth)
    assert not is_right(Pose2(1.251, 2.0, 3.0), truth)
    assert not is_right(Pose2(1.0, 2.0, 3.0 + math.radians(5.01)), truth)
    assert not is_right(truth, None)
    assert not is_right(None, truth)


# --- scores ---------------------------------------------------------------------------------------


def test_scores_by_hand():
    """Shares by kind; what cannot be known of a kind is None; the ratio is the median of the pairs that have one."""
    right, second, wrong = a_match(off(0.0)), a_match(off(1.0), off(0.0)), a_match(off(1.0))
    refused = a_match(off(0.0), verdict=Verdict.REJECTED)
    outcomes = [
        an_outcome(a_pair(), right, milliseconds=10.0, cpu_milliseconds=2.0),
        an_outcome(a_pair(), second, milliseconds=20.0, cpu_milliseconds=4.0),
        an_outcome(a_pair(), wrong, milliseconds=30.0, cpu_milliseconds=6.0),
        an_outcome(a_pair(), refused, milliseconds=40.0, cpu_milliseconds=8.0),
        an_outcome(a_pair(NEGATIVE), refused),
    ]
    twins = [(8.0, True), (40.0, True), (18.0, False)]
    outcomes[:3] = [
        replace(one, brute_milliseconds=ms, brute_right=found)
        for one, (ms, found) in zip(outcomes, twins, strict=False)
    ]
    kinds = score("log", outcomes).kinds
    wide, negative = kinds["wide"], kinds[NEGATIVE]
    assert (wide.success, wide.among_first_three) == (0.5, 0.75)
    assert (wide.median_ms, wide.median_cpu_ms) == (25.0, 5.0)
    assert wide.brute_force_ratio == 4.0
    assert wide.brute_force_success == pytest.approx(2 / 3)
    assert (wide.accepted_right, wide.accepted_wrong, wide.rejected) == (0.25, 0.5, 0.25)
    assert (negative.success, negative.among_first_three, negative.brute_force_ratio) == (1.0, None, None)


def test_of_repeats_the_median_counts(office, monkeypatch):
    """One slow run among three leaves no mark, neither by the clock nor by the processor."""
    ticks = {
        "perf_counter": cycle([0.0, 2.0, 10.0, 19.0, 20.0, 21.0]),
        "thread_time": cycle([0.0, 1.0, 1.0, 4.0, 4.0, 6.0]),
    }
    clock = type("clock", (), {name: staticmethod(lambda held=held: next(held)) for name, held in ticks.items()})
    monkeypatch.setattr(benchmark, "time", clock)
    pairs = PairSet(log="office", pairs=(Pair(kind="wide", i=0, j=0, **SAME),))
    (outcome,) = run_pairs(pairs, office, mode="paper", heuristic="consecutive", repeats=3)
    assert (outcome.milliseconds, outcome.cpu_milliseconds) == (2000.0, 2000.0)


def test_progress_is_told_pair_by_pair(office):
    """How many of how many."""
    told = []
    pairs = PairSet(log="office", pairs=tuple(Pair(kind=NEGATIVE, i=i, j=30) for i in range(3)))
    run_pairs(pairs, office, heuristic="consecutive", progress=lambda *done: told.append(done))
    assert told == [(1, 3), (2, 3), (3, 3)]


# --- the brute-force twin -------------------------------------------------------------------------


def test_the_paper_s_search_finds_what_brute_force_finds(office):
    """The best of all candidates is the same pose, to the last bit."""
    for i, j in ((0, 1), (3, 5), (10, 12), (0, 30)):
        maps = extract(office[i], VERIFIED), extract(office[j], VERIFIED)
        assert brute_force(*maps, VERIFIED) == match_maps(*maps, VERIFIED, "all", "paper").T_1_2


def test_verified_brute_force_is_right_where_the_scans_are_one():
    """A scan is found in itself moved; where there are no angles there is nothing."""
    hall = read_log(ROOT / "sample_logs" / "hall.log")
    first = extract(hall[4], VERIFIED)
    found = brute_force(first, first, VERIFIED, "verified")
    assert is_right(found, Pose2.identity())
    for mode in MODES:
        assert brute_force(SegmentMap.empty(), first, VERIFIED, mode) is None


def test_brute_force_runs_on_as_many_pairs_of_each_kind_as_asked_for(office):
    """Evenly spread over the kind, the first and the last included; the others have none."""
    pairs = tuple(Pair(kind=kind, i=0, j=k, **SAME) for k in range(5) for kind in ("wide", NEGATIVE))
    outcomes = run_pairs(PairSet(log="office", pairs=pairs), office, mode="paper", heuristic="consecutive", brute=3)
    chosen = [(one.pair.kind, one.pair.j) for one in outcomes if one.brute_milliseconds is not None]
    assert sorted(chosen) == [(kind, j) for kind in sorted(("wide", NEGATIVE)) for j in (0, 2, 4)]
    assert outcomes[0].brute_right is True
    assert outcomes[1].brute_right is None


# --- pair sets ------------------------------------------------------------------------------------


def test_overlap_is_read_where_it_is_written():
    """A set may say how much its pairs overlap."""
    text = '{"log": "a", "pairs": [{"kind": "wide", "i": 0, "j": 1, "overlap": 0.6}, {"kind": "wide", "i": 0, "j": 1}]}'
    assert [pair.overlap for pair in PairSet.from_json(text).pairs] == [0.6, None]


def test_real_pairs_have_their_right_pose_among_the_first_three(benchmarks, datasets):
    """Of twenty wide pairs of a real log at most one is neither best nor among the rivals shown."""
    held = PairSet.from_json((benchmarks / "pairs" / "fr079.json").read_bytes())
    some = tuple(pair for pair in held.pairs if pair.kind == "wide")[:20]
    outcomes = run_pairs(PairSet(log=held.log, pairs=some), read_log(datasets / held.log), VERIFIED, mode="verified")
    assert np.sum([outcome.among_first for outcome in outcomes]) >= 19
    assert all(outcome.among_first for outcome in outcomes if outcome.right)
