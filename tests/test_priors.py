"""A prior on the pose: it chooses among what the maps say, and never silences them."""

import math
from dataclasses import replace

import numpy as np
import pytest
import real_pairs
import simulated
from hypothesis import given, settings
from hypothesis import strategies as st
from worlds import poses

from segmap.benchmark import is_right
from segmap.errors import ParameterError
from segmap.integration import heuristics, integrate, match_maps
from segmap.parameters import preset
from segmap.pose import Pose2, wrap
from segmap.priors import GATE, PosePrior
from segmap.simulate import World
from segmap.verdict import Verdict

P = preset("verified")
HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)
TRUTH = HERE.inverse() @ THERE


@pytest.fixture(scope="module")
def in_the_room():
    """Two scans of a furnished room, and their true pose."""
    return simulated.pair(simulated.room(), HERE, THERE, P, seed=3)


@pytest.fixture(scope="module")
def in_a_box():
    """Two scans of an empty room of 7 by 4 m, looking the same way, and their true pose: half a turn fits as well."""
    box = World.build("box", [(0.0, 0.0, 7.0, 4.0)])
    return simulated.pair(box, Pose2(3.0, 2.2, 0.3), Pose2(3.8, 1.7, 0.6), P, seed=2)


def matched(pair, prior, mode="verified", heuristic=None):
    return match_maps(*pair[:2], P, heuristic, mode, prior=prior)


def near(T, x=0.3, theta=0.14):
    return PosePrior.with_deviations(T, x, x, theta)


def moved(T, x, y, theta=0.0):
    return Pose2(T.x + x, T.y + y, T.theta + theta)


# --- laws -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["paper", "verified"])
def test_a_huge_covariance_changes_nothing(in_the_room, in_a_box, mode):
    """The same candidates, ranking, findings and verdict as without a prior, to the last bit."""
    for pair in (in_the_room, in_a_box):
        for heuristic in heuristics(mode):
            with_prior, without = (matched(pair, prior, mode, heuristic) for prior in (near(TRUTH, 1e5, 1e5), None))
            assert replace(with_prior, milliseconds=0.0) == replace(without, milliseconds=0.0)


def test_in_paper_mode_only_what_it_admits_is_evaluated(in_the_room):
    """The candidates within the gate, with the values and in the order they have without it."""
    prior = near(TRUTH, 0.2, 0.1)
    everything, admitted = (
        match_maps(*in_the_room[:2], P.replace(ranked_candidates=10000), "all", "paper", prior=p) for p in (None, prior)
    )
    inside = [c for c in everything.ranked if prior.admits(np.array([tuple(c.T_1_2)]))[0]]
    assert 0 < admitted.candidates < everything.candidates
    assert [(c.T_1_2, c.value) for c in admitted.ranked] == [(c.T_1_2, c.value) for c in inside]


def test_ranked_candidates_lie_in_the_gate(in_a_box):
    """In verified mode too, but for what no wall holds."""
    prior = near(in_a_box[2])
    match = matched(in_a_box, prior)
    for candidate in match.ranked:
        held = np.array(candidate.uncertainty.covariance)
        assert prior.distances(np.array([tuple(candidate.T_1_2)]), held)[0] <= GATE + 1e-9


def test_rivals_elsewhere_do_not_count(in_a_box):
    """An empty room fits itself half a turn round: for a person without a prior, settled by one, either way."""
    truth = in_a_box[2]
    without = matched(in_a_box, None)
    assert without.verdict is not Verdict.ACCEPTED
    assert any("rival" in reason for reason in without.reasons)
    settled = matched(in_a_box, near(truth))
    assert is_right(settled.T_1_2, truth)
    assert not any("rival" in reason for reason in settled.reasons)
    assert settled.findings.gap > without.findings.gap


def test_a_prior_adds_nothing_to_the_score(in_the_room):
    """Right but for its width: pose, value, score and confidence are what the maps say."""
    without, with_prior = matched(in_the_room, None), matched(in_the_room, near(moved(TRUTH, 0.4, -0.3), 0.5, 0.3))
    assert with_prior.T_1_2.distance(without.T_1_2)[0] < 0.01
    assert with_prior.best.score == pytest.approx(without.best.score, abs=0.2)
    assert with_prior.verdict is without.verdict is Verdict.ACCEPTED


@pytest.mark.parametrize(("x", "y", "turn"), [(2.5, 0.0, 0.0), (0.0, -3.0, 0.5), (0.0, 0.0, math.pi), (9.0, 9.0, 1.0)])
def test_a_wrong_prior_is_reported(in_the_room, x, y, turn):
    """Never accepted: rejected or for a person, and the reasons name the prior."""
    match = matched(in_the_room, near(moved(TRUTH, x, y, turn)))
    assert match.verdict is not Verdict.ACCEPTED
    assert any("prior" in reason for reason in match.reasons)
    paper = matched(in_the_room, near(moved(TRUTH, x, y, turn), 0.05, 0.02), "paper", "consecutive")
    assert paper.T_1_2 is None or prior_is_far(paper.T_1_2)


def prior_is_far(T):
    return T.distance(TRUTH)[0] > 0.5 or T.distance(TRUTH)[1] > 0.3


def test_wrong_priors_are_not_accepted_on_real_pairs(benchmarks, datasets):
    """Off by 3 m, where the maps know better: one pair of each kind of each log."""
    for log, pair in real_pairs.some(benchmarks, datasets, each=1, kinds=("consecutive", "wide")):
        found = real_pairs.maps(pair, log, P)
        wrong = match_maps(*found, P, mode="verified", prior=near(moved(pair.truth, 2.4, -1.8)))
        assert wrong.verdict is not Verdict.ACCEPTED
        right = match_maps(*found, P, mode="verified", prior=near(moved(pair.truth, 0.2, -0.1, 0.05)))
        assert is_right(right.T_1_2, pair.truth)


def test_what_no_wall_holds_lies_where_the_prior_has_it():
    """Along a bare corridor: there as the prior says and as firm, across it as the walls say."""
    map_1, map_2, truth = simulated.pair(
        simulated.corridor(), Pose2(100.0, 1.0, 0.0), Pose2(101.0, 1.2, 0.1), P, 10, 12.0
    )
    match = match_maps(map_1, map_2, P, mode="verified", prior=near(moved(truth, 0.0, 0.03), 0.08, 0.05))
    assert is_right(match.T_1_2, truth)
    assert abs(match.T_1_2.x - truth.x) < 0.15
    assert abs(match.T_1_2.y - truth.y) < 0.03
    assert match.best.uncertainty.weakest < 0.1
    assert not any("weakest direction" in reason for reason in match.reasons)
    loose = match_maps(map_1, map_2, P, mode="verified")
    assert loose.best.uncertainty.weakest > 0.15


def test_the_mean_of_a_narrow_prior_is_a_candidate(in_the_room):
    """Where the heuristic has none nearby, the mean is refined: one more candidate, and the pose is found."""
    few = P.replace(segment_length_percentage=95.0)
    without = match_maps(*in_the_room[:2], few, "consecutive", "verified")
    match = match_maps(*in_the_room[:2], few, "consecutive", "verified", prior=near(moved(TRUTH, 0.1, 0.1), 0.2, 0.1))
    assert match.candidates == without.candidates + 1
    assert is_right(match.T_1_2, TRUTH)
    assert match.best.index == 0


def test_integrate_takes_a_prior(in_the_room):
    """And fuses under the pose it leads to."""
    integration = integrate(*in_the_room[:2], P, mode="verified", prior=near(TRUTH))
    assert is_right(integration.match.T_1_2, TRUTH)
    assert integration.map is not None
    assert integrate(*in_the_room[:2], P, prior=near(Pose2(90.0, 0.0, 0.0))).map is None


# --- the prior itself -----------------------------------------------------------------------------


@given(poses, st.floats(0.01, 10.0), st.floats(0.01, 10.0), st.floats(0.01, 3.0), poses)
@settings(deadline=None, max_examples=100)
def test_distances_are_those_of_the_normal_distribution(mean, x, y, theta, other):
    """Each variable by its deviation, the angle the short way round; less with uncertain poses."""
    prior = PosePrior.with_deviations(mean, x, y, theta)
    off = ((other.x - mean.x) / x, (other.y - mean.y) / y, wrap(other.theta - mean.theta) / theta)
    place = np.array([tuple(other)])
    assert prior.distances(place)[0] == pytest.approx(sum(d * d for d in off), rel=1e-6, abs=1e-9)
    assert prior.distances(place, np.eye(3))[0] <= prior.distances(place)[0] + 1e-9
    assert prior.admits(np.array([tuple(mean)]))[0]


def test_the_gate_holds_what_it_says():
    """Of poses drawn from a prior with correlations, 99.9 % are admitted."""
    generator = np.random.default_rng(1)
    root = np.array([[0.5, 0.0, 0.0], [0.3, 0.2, 0.0], [0.1, -0.1, 0.05]])
    prior = PosePrior(Pose2(1.0, 2.0, 0.5), (root @ root.T).tolist())
    drawn = np.array([1.0, 2.0, 0.5]) + generator.standard_normal((40000, 3)) @ root.T
    assert prior.admits(drawn).mean() == pytest.approx(0.999, abs=0.0006)


def test_combining_is_the_mean_of_both_by_their_firmness():
    """Equally firm: half-way and twice as firm; across the seam of angles the short way."""
    prior = PosePrior.with_deviations(Pose2(0.0, 0.0, 3.1), 0.2, 0.2, 0.2)
    pose, covariance = prior.combined(Pose2(1.0, 2.0, -3.1), 0.04 * np.eye(3))
    assert tuple(pose)[:2] == pytest.approx((0.5, 1.0))
    assert abs(pose.theta) == pytest.approx(math.pi)
    assert covariance == pytest.approx(0.02 * np.eye(3))


@pytest.mark.parametrize(
    "covariance",
    [
        ((1.0, 0.0), (0.0, 1.0)),
        ((1.0, 0.5, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ((math.nan, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((1e30, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ],
)
def test_what_is_no_covariance_is_refused(covariance):
    """Wrong shape, not symmetric, not positive, not finite, absurd."""
    with pytest.raises(ParameterError, match="covariance"):
        PosePrior(Pose2.identity(), covariance)


def test_deviations_are_positive():
    """Zero, negative, infinite: refused; so is a mean that is no pose."""
    for bad in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ParameterError, match="positive"):
            PosePrior.with_deviations(Pose2.identity(), bad, 1.0, 1.0)
    with pytest.raises(ParameterError, match="mean"):
        PosePrior.with_deviations(Pose2(math.inf, 0.0, 0.0), 1.0, 1.0, 1.0)
