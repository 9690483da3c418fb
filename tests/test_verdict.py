"""The verdict: what speaks for an integration can only help it, and the reasons say what was weighed."""

import math
from dataclasses import replace

import pytest
import real_pairs
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from segmap.benchmark import NEGATIVE, is_right
from segmap.integration import match_maps
from segmap.parameters import Parameters, preset
from segmap.verdict import (
    CALIBRATION,
    Findings,
    Verdict,
    clear,
    confidence,
    features,
    findings,
    judge,
    judge_evidence,
    judge_value,
    told,
)
from segmap.visibility import Evidence

P = preset("verified")
CLEAR = Findings(score=15.0, gap=12.0, evidence=Evidence(18.0, 0.2, 0.8, 6.0, 3.0, 2.0), weakest=0.02)
"""found the way most right poses are"""
RANK = {Verdict.REJECTED: 0, Verdict.REVIEW: 1, Verdict.ACCEPTED: 2}
quick = settings(deadline=None, max_examples=150)
metres = st.floats(0.0, 40.0)


@given(number=st.floats(0.0, 1.0), limit=st.sampled_from([0.1, 0.5, 0.9]), inclusive=st.booleans())
def test_no_number_is_rounded_across_its_limit(number, limit, inclusive):
    """What is told of a number is on the side of the limit that the number is on."""
    assume(abs(number - limit) > 1e-8 or number == limit)
    read = float(told(number, limit, 2, inclusive=inclusive))
    assert (read >= limit) == (number >= limit) if inclusive else (read > limit) == (number > limit)


@st.composite
def evidences(draw):
    """Any metres; off three walls there is no more than off two, and off two no more than is supported."""
    supported, *others = (draw(metres) for _ in range(4))
    off_two = draw(st.floats(0.0, 1.0)) * supported
    return Evidence(supported, *others, off_two, draw(st.floats(0.0, 1.0)) * off_two)


@st.composite
def found(draw):
    """What may be found of a best candidate: a gap up to the score, perhaps a rival that nothing refutes."""
    score = draw(st.floats(-20.0, 40.0))
    gap = draw(st.one_of(st.just(score), st.floats(0.0, 1.0).map(lambda share: share * max(score, 0.0))))
    unrefuted = draw(st.sampled_from([0.0, max(0.0, score - gap)]))
    return Findings(score, gap, draw(evidences()), draw(st.floats(0.0, 0.5)), unrefuted)


def verdict(some, value=5.0, parameters=P):
    return judge_evidence(value, some, parameters)[0]


def reasons(some, value=5.0, parameters=P):
    return " ".join(judge_evidence(value, some, parameters)[1])


# --- confidence -----------------------------------------------------------------------------------


@given(found(), st.floats(0.0, 10.0))
@quick
def test_confidence_grows_with_the_gap(some, more):
    """A larger gap, all else equal, never makes it less sure."""
    assert confidence(replace(some, gap=some.gap + more)) >= confidence(some)


@given(found(), evidences())
@quick
def test_confidence_grows_with_what_speaks_for_it(some, evidence):
    """Evidence that is as consistent, overlaps as much and is as much more than walls: never less sure."""
    one, other = some.evidence, evidence
    assume(all(getattr(one, name) <= getattr(other, name) for name in ("consistency", "overlap", "off_two")))
    assert confidence(replace(some, evidence=other)) >= confidence(some) - 1e-12


@given(found())
@quick
def test_confidence_is_a_probability(some):
    """In 0..1 whatever was found; every feature has a weight that counts for it."""
    assert 0.0 <= confidence(some) <= 1.0
    assert set(features(some)) == set(CALIBRATION) - {"intercept"}
    assert min(CALIBRATION[name] for name in features(some)) > 0.0
    assert all(math.isfinite(feature) and feature >= 0.0 for feature in features(some).values())


def test_confidence_knows_clear_cases():
    """Much support without a rival is nearly sure; none, or as much conflict, is nearly refused."""
    assert confidence(CLEAR) > 0.99
    assert confidence(Findings(0.0, 0.0, Evidence(0.0, 0.0, 0.0, 20.0), 0.5)) < 0.01
    assert confidence(Findings(1.0, 1.0, Evidence(5.0, 5.0, 1.0, 5.0), 0.05)) < 0.01


# --- verdicts -------------------------------------------------------------------------------------


@given(found(), metres, metres, st.floats(0.0, 20.0))
@quick
def test_more_in_favour_never_worsens_the_verdict(some, value, more_value, more):
    """More value, score and gap together, or a firmer hold: the same verdict or a better one."""
    before = RANK[verdict(some, value)]
    better = replace(some, score=some.score + more, gap=some.gap + more)
    assert RANK[verdict(better, value + more_value)] >= before
    assert RANK[verdict(replace(some, weakest=some.weakest / 2.0), value)] >= before
    assert RANK[verdict(replace(some, unrefuted=0.0), value)] >= before


@given(found(), metres, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@quick
def test_higher_thresholds_never_improve_the_verdict(some, value, one, other):
    """A stricter confidence to accept, to review, or value: the same verdict or a worse one."""
    lax, strict = sorted((one, other))
    for name in ("confidence_accept", "confidence_review", "value_threshold"):
        scale = 10.0 if name == "value_threshold" else 1.0
        ranks = [RANK[verdict(some, value, P.replace(**{name: scale * share}))] for share in (lax, strict)]
        assert ranks[1] <= ranks[0]


@pytest.mark.parametrize(
    ("changes", "value", "expected"),
    [
        ({}, 5.0, Verdict.ACCEPTED),
        ({"confidence_accept": 1.0}, 5.0, Verdict.REVIEW),
        ({"confidence_accept": 1.0, "confidence_review": 1.0}, 5.0, Verdict.REJECTED),
        ({"value_threshold": 5.0}, 5.0, Verdict.REVIEW),
        ({"value_threshold": 5.0, "confidence_accept": 1.0}, 5.0, Verdict.REJECTED),
    ],
)
def test_thresholds_move_verdicts_as_documented(changes, value, expected):
    """Sure and valuable: accepted; sure but not above the threshold of value: a person; neither: rejected."""
    assert verdict(CLEAR, value, P.replace(**changes)) is expected


@given(found(), metres)
@quick
def test_doubts_are_never_accepted(some, value):
    """A rival nearly as good, one that nothing refutes, or a loose pose: at most for review, and the reason said."""
    told = reasons(some, value)
    rival = some.score > 0.0 and (
        some.score - some.gap > 0.8 * some.score
        or some.unrefuted > 0.7 * some.score
        or (some.unrefuted > 0.2 * some.score and some.evidence.off_three <= 0.1)
    )
    if rival or some.weakest > P.rival_distance / 2.0:
        assert verdict(some, value) is not Verdict.ACCEPTED
    assert ("rival" in told) == rival
    assert ("weakest direction" in told) == (some.weakest > P.rival_distance / 2.0)


def test_a_small_gap_names_the_rival():
    """However much is supported, a rival close behind leaves the choice to a person, and is named first."""
    tied = replace(CLEAR, score=200.0, gap=7.0)
    assert confidence(tied) > P.confidence_accept
    assert verdict(tied) is Verdict.REVIEW
    sure, first, *_ = judge_evidence(5.0, tied, P)[1]
    assert "Confidence" in sure
    assert "rival" in first
    assert "7.00 m less" in first
    assert "rival" not in reasons(CLEAR)


def test_a_rival_that_nothing_refutes_counts_from_farther_away():
    """With three quarters of the score: refuted by lines of sight it is beaten, otherwise a person decides."""
    refuted = replace(CLEAR, score=20.0, gap=5.0)
    assert verdict(refuted) is Verdict.ACCEPTED
    assert verdict(replace(refuted, unrefuted=15.0)) is Verdict.REVIEW
    assert "nothing speaks against it" in reasons(replace(refuted, unrefuted=15.0))


def test_where_only_plain_walls_match_a_rival_counts_from_far_away():
    """Nothing off three walls: a quarter of the score is enough of a rival, if nothing speaks against it."""
    seen = replace(CLEAR.evidence, off_two=1.5, off_three=0.05)
    plain = replace(CLEAR, score=20.0, gap=15.0, evidence=seen)
    assert confidence(plain) > P.confidence_accept
    assert verdict(plain) is Verdict.ACCEPTED
    assert verdict(replace(plain, unrefuted=5.0)) is Verdict.REVIEW
    assert "Only plain walls match" in reasons(replace(plain, unrefuted=5.0))
    furnished = replace(plain, unrefuted=5.0, evidence=replace(seen, off_three=0.5))
    assert verdict(furnished) is Verdict.ACCEPTED


def test_what_a_prior_excludes_is_said_where_it_scores_more():
    """Less than the best: the prior decides. More: it may be wrong, and a person decides."""
    assert verdict(replace(CLEAR, excluded=14.0)) is Verdict.ACCEPTED
    assert verdict(replace(CLEAR, excluded=17.5)) is Verdict.REVIEW
    assert "2.50 m more: the prior may be wrong" in reasons(replace(CLEAR, excluded=17.5))


def test_without_lines_of_sight_value_is_not_enough():
    """Asked for but unknown: at most for a person; switched off: the paper's rule."""
    blind = Findings(5.0, 5.0, None, 0.0, blind=True)
    assert judge(5.0, blind, P)[0] is Verdict.REVIEW
    assert "no lines of sight" in " ".join(judge(5.0, blind, P)[1])
    assert judge(0.4, blind, P)[0] is Verdict.REJECTED
    assert judge(5.0, replace(blind, blind=False), P)[0] is Verdict.ACCEPTED
    assert confidence(blind) == 0.0
    assert features(blind) == {}


def test_a_verdict_by_value_still_doubts():
    """Confidence switched off: accepted above the threshold of value, but not with a rival or a loose pose."""
    by_value = P.replace(use_confidence=False)
    unsure = replace(CLEAR, evidence=Evidence(5.0, 4.0, 0.0, 9.0))
    assert judge(5.0, unsure, by_value) == judge_value(5.0, by_value)
    assert judge(0.4, unsure, by_value)[0] is Verdict.REJECTED
    for doubt in ({"gap": 1.0}, {"weakest": 0.3}, {"excluded": 99.0}):
        assert judge(5.0, replace(unsure, **doubt), by_value)[0] is Verdict.REVIEW
    assert judge(5.0, replace(unsure, gap=1.0), by_value.replace(use_rivals=False))[0] is Verdict.ACCEPTED


@given(found(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
@quick
def test_what_is_clear_does_not_depend_on_thresholds(some, accept, review):
    """Whether to look further is the same under any thresholds, so that they never change what is found."""
    moved = P.replace(confidence_accept=accept, confidence_review=review, value_threshold=99.0 * accept)
    assert clear(some, moved) == clear(some, P)
    assert not clear(some, P) or verdict(some) is Verdict.ACCEPTED


def test_no_rival_is_not_named():
    """Alone and with hardly any score, or with less than none, there is no rival to look at."""
    for score in (0.1, 0.0, -3.0):
        assert "rival" not in reasons(replace(CLEAR, score=score, gap=score))


def test_a_loose_pose_is_for_a_person():
    """Known worse along one direction than half the distance of rivals: review, and how loose is said."""
    loose = replace(CLEAR, weakest=0.3)
    assert verdict(loose) is Verdict.REVIEW
    assert "0.30 m" in reasons(loose)
    assert verdict(loose, parameters=P.replace(rival_distance=0.7)) is Verdict.ACCEPTED


def test_reasons_say_what_was_weighed():
    """Confidence, what both maps see, and the value: each with its number, each a sentence."""
    told = judge_evidence(5.0, CLEAR, P)[1]
    assert f"{confidence(CLEAR):.3f}" in told[0]
    assert "18.0 m are seen by both, 1.0 m contradict, 6.0 m are unseen." in told
    assert "5.00 m" in told[-1]
    assert all(not sentence[0].islower() and sentence.endswith(".") for sentence in told)


@given(st.floats(0.0, 50.0), st.floats(0.0, 50.0))
@quick
def test_value_alone_is_the_paper_s_rule(value, threshold):
    """Valid strictly above the threshold; without evidence that is the whole verdict."""
    parameters = Parameters(value_threshold=threshold)
    expected = Verdict.ACCEPTED if value > threshold else Verdict.REJECTED
    assert judge_value(value, parameters)[0] is expected
    assert judge(value, None, parameters) == judge_value(value, parameters)
    assert judge(value, CLEAR, parameters) == judge_evidence(value, CLEAR, parameters)


# --- findings -------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(-10.0, 40.0), evidences()), min_size=1, max_size=8), st.floats(0.0, 0.5))
@quick
def test_findings_compare_the_best_with_its_rivals(judged, weakest):
    """The gap is to the next score, or the score itself; unrefuted is the best rival that agrees as well."""
    judged = sorted(judged, key=lambda entry: -entry[0])
    (best, seen), rivals = judged[0], judged[1:]
    some = findings(judged, weakest)
    assert (some.score, some.evidence, some.weakest) == (best, seen, weakest)
    assert some.gap == (best - max(rivals[0][0], 0.0) if rivals else best)
    as_well = [score for score, evidence in rivals if evidence.agreement >= seen.agreement - 0.05]
    assert some.unrefuted == max([0.0, *as_well])


# --- on real pairs --------------------------------------------------------------------------------


def test_real_pairs_are_judged_rightly(benchmarks, datasets):
    """Four positive and four negative pairs of each log: at least 90 % right, nothing wrong accepted."""
    positives, right = 0, 0
    for log, pair in real_pairs.some(benchmarks, datasets, each=2, kinds=("consecutive", "wide")):
        match = match_maps(*real_pairs.maps(pair, log, P), P, mode="verified")
        correct = is_right(match.T_1_2, pair.truth)
        positives, right = positives + 1, right + correct
        assert correct or match.verdict is not Verdict.ACCEPTED
    assert positives == 20
    assert right >= 0.9 * positives
    for log, pair in real_pairs.some(benchmarks, datasets, each=4, kinds=(NEGATIVE,)):
        assert match_maps(*real_pairs.maps(pair, log, P), P, mode="verified").verdict is not Verdict.ACCEPTED
