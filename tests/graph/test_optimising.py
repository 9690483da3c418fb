"""Poses out of edges: what is right must come out, what is wrong must be silenced."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from graphs import COVARIANCE, far_apart, ring, with_wrong
from hypothesis import given, settings
from hypothesis import strategies as st

from segmap.errors import CancelledError, GraphError
from segmap.graph import GATE, Edge, components, explain, optimise
from segmap.pose import Pose2
from segmap.scans import ScanId

RIGHT = 0.01, math.radians(0.1)
"""metres and radians; poses nearer than this are the same"""


def same(poses, others) -> bool:
    distance, angle = far_apart(poses, others)
    return distance < RIGHT[0] and angle < RIGHT[1]


def silenced(result) -> list[bool]:
    return [residual.silenced for residual in result.residuals]


@pytest.mark.parametrize("robust", [True, False])
@pytest.mark.parametrize("trusted", [True, False])
def test_what_is_consistent_comes_out_exactly(robust, trusted):
    """Edges without noise give the true poses, to the last digits."""
    truth, edges = ring(40, noise=0.0, trusted=trusted)
    result = optimise(edges, robust=robust)
    assert far_apart(result.poses, truth) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert max(residual.chi for residual in result.residuals) < 1e-6
    assert result.silenced == ()
    assert result.error == pytest.approx(0.0, abs=1e-9)


def test_closures_pull_drift_together():
    """With closures the poses are nearer to the truth than the neighbours' chain alone."""
    truth, edges = ring(200, seed=5)
    chain = optimise([edge for edge in edges if edge.trusted])
    assert far_apart(optimise(edges).poses, truth)[0] < 0.5 * far_apart(chain.poses, truth)[0]


@pytest.mark.parametrize("trusted", [True, False])
@pytest.mark.parametrize(("kind", "share"), [("random", 0.3), ("random", 0.6), ("shifted", 0.3), ("shifted", 0.5)])
def test_wrong_closures_are_silenced(trusted, kind, share):
    """Wrong closures, 30 % and more: exactly they are silenced, and the poses are those of the clean graph."""
    _, edges = ring(80, trusted=trusted)
    clean = optimise(edges)
    assert clean.silenced == ()
    mixed = with_wrong(edges, share, kind)
    result = optimise(mixed)
    assert silenced(result) == [i >= len(edges) for i in range(len(mixed))]
    assert same(result.poses, clean.poses)


def test_closures_of_a_drifted_chain_are_not_taken_for_wrong():
    """Right closures that the chain alone is metres away from count, although each alone looks wrong at first."""
    truth, edges = ring(300, seed=3, noise=1.0)
    ends = [edge for edge in edges if edge.trusted or edge.second.scan - edge.first.scan > 100]
    result = optimise(ends[: len(ends) - 40])
    assert result.silenced == ()
    assert far_apart(result.poses, {scan: truth[scan] for scan in result.poses})[0] < 0.5


def test_trusted_edges_are_never_silenced():
    """A wrong edge that is trusted counts, and what contradicts it is silenced."""
    _, edges = ring(40, trusted=False)
    wrong = Edge(ScanId(0, 3), ScanId(0, 30), Pose2(5.0, 5.0, 2.0), COVARIANCE, trusted=True)
    believed, doubted = optimise([*edges, wrong]), optimise([*edges, replace(wrong, trusted=False)])
    assert not believed.residuals[-1].silenced
    assert believed.silenced
    assert silenced(doubted) == [False] * len(edges) + [True]


@pytest.mark.parametrize("seed", range(3))
def test_who_claims_to_be_surer_than_all_others_is_not_believed_for_that(seed):
    """A wrong closure whose variances are a ten-thousandth of the others' is silenced, alone, without a first guess."""
    _, edges = ring(40, trusted=False, seed=seed, reach=1)
    kept = [edge for edge in edges if edge.second.scan - edge.first.scan == 1 or edge.first.scan % 4 == 0]
    sure = tuple(tuple(1e-4 * number for number in row) for row in COVARIANCE)
    wrong = [Edge(ScanId(0, a), ScanId(0, b), Pose2(0.5 + a, 2.0, 1.0), sure) for a, b in ((3, 17), (12, 30))]
    clean, result = optimise(kept), optimise([*kept, *wrong])
    assert silenced(result) == [False] * len(kept) + [True, True]
    assert same(result.poses, clean.poses)


def test_of_two_that_contradict_each_other_the_nearer_in_the_log_is_right():
    """A scan that hangs on one neighbour stays there, whatever a surer claim from far away says."""
    _, edges = ring(20)
    hanging = Edge(ScanId(0, 19), ScanId(0, 21), Pose2(0.7, 0.1, 0.0), COVARIANCE)
    sure = tuple(tuple(0.01 * number for number in row) for row in COVARIANCE)
    wrong = Edge(ScanId(0, 2), ScanId(0, 21), Pose2(30.0, 0.0, 0.0), sure)
    result = optimise([*edges, hanging, wrong])
    assert silenced(result) == [False] * (len(edges) + 1) + [True]
    assert (result.poses[ScanId(0, 19)].inverse() @ result.poses[ScanId(0, 21)]).distance(hanging.T_1_2)[0] < 1e-6


def test_where_a_log_is_in_two_pieces_most_edges_between_them_decide():
    """Also where one that is wrong joins scans nearer to each other in the log than those that are right."""
    _, edges = ring(60, trusted=False)
    gap = 30
    kept = [e for e in edges if not (e.first.scan < gap <= e.second.scan and e.second.scan - e.first.scan < 28)]
    across = [e for e in kept if e.first.scan < gap <= e.second.scan]
    others = [e for e in kept if e not in across]
    wrong = [Edge(ScanId(0, 25), ScanId(0, gap + i), Pose2(20.0 - i, 9.0, 1.0), COVARIANCE) for i in (1, 9)]
    clean, result = optimise([*others, *across[:6]]), optimise([*others, *across[:6], *wrong])
    assert silenced(result) == [False] * (len(others) + 6) + [True, True]
    assert same(result.poses, clean.poses)


def test_what_is_metres_off_says_nothing_however_little_it_claims_to_know():
    """A match that slid two metres along a corridor is within its own deviations; it is silenced, and moves nothing."""
    truth, edges = ring(40, trusted=False)
    loose = ((4.0, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 1e-4))
    T = truth[ScanId(0, 4)].inverse() @ truth[ScanId(0, 23)]
    slid = Edge(ScanId(0, 4), ScanId(0, 23), Pose2(T.x + 2.0, T.y, T.theta), loose)
    believed, doubted = optimise([*edges, slid]), optimise([*edges, slid], most=0.4)
    assert believed.silenced == ()
    assert silenced(doubted) == [False] * len(edges) + [True]
    assert far_apart(doubted.poses, optimise(edges).poses) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert (
        "more than 0.4 m are not believed, however little it claims to know" in explain(doubted, doubted.silenced[0])[0]
    )
    alone = Edge(ScanId(0, 4), ScanId(0, 99), Pose2(2.0, 0.0, 0.0), loose)
    assert optimise([*edges, alone], most=0.4).silenced == ()


def test_what_is_wrong_elsewhere_does_not_silence_what_would_count():
    """An edge just within the gate counts with wrong edges in the graph as it does without."""
    truth, edges = ring(40, noise=0.0, trusted=False)
    T = truth[ScanId(0, 5)].inverse() @ truth[ScanId(0, 25)]
    for off in (5.0, 5.2, 5.4, 5.6):
        odd = Edge(
            ScanId(0, 5), ScanId(0, 25), Pose2(T.x + off * math.sqrt(COVARIANCE[0][0]), T.y, T.theta), COVARIANCE
        )
        clean = optimise([*edges, odd])
        mixed = optimise([*with_wrong([*edges, odd], 0.1, "random")])
        assert mixed.residuals[len(edges)].silenced == clean.residuals[len(edges)].silenced
        assert same(mixed.poses, clean.poses)


def test_without_the_robust_kernel_everything_counts():
    """Plain least squares silences nothing, and wrong closures move the map."""
    _, edges = ring(40)
    mixed = with_wrong(edges, 0.1, "random")
    result = optimise(mixed, robust=False)
    assert result.silenced == ()
    assert all(residual.weight == 1.0 for residual in result.residuals)
    assert not same(result.poses, optimise(edges).poses)
    assert result.gate == math.inf


def test_the_gate_is_a_matter_of_choice():
    """An edge 8 standard deviations off is silenced at the default gate, and not at a wider one."""
    truth, edges = ring(40, noise=0.0)
    T = truth[ScanId(0, 5)].inverse() @ truth[ScanId(0, 25)]
    off = Edge(ScanId(0, 5), ScanId(0, 25), Pose2(T.x + 8.5 * math.sqrt(COVARIANCE[0][0]), T.y, T.theta), COVARIANCE)
    assert silenced(optimise([*edges, off]))[-1]
    assert not silenced(optimise([*edges, off], gate=12.0))[-1]


def test_what_hangs_by_one_edge_stays_where_that_puts_it():
    """An edge that nothing checks is exact, and never silenced, however odd it looks."""
    _, edges = ring(20)
    odd = Edge(ScanId(0, 4), ScanId(0, 99), Pose2(50.0, -3.0, 2.0), COVARIANCE)
    result = optimise([*edges, odd])
    T_4_99 = result.poses[ScanId(0, 4)].inverse() @ result.poses[ScanId(0, 99)]
    assert T_4_99.distance(odd.T_1_2) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert result.silenced == ()


@pytest.mark.parametrize("votes", [(3, 2), (2, 3), (1, 4)])
def test_of_contradicting_links_between_two_parts_the_majority_wins(votes):
    """Two rings joined by edges of two opinions: the more numerous opinion is kept, the other silenced."""
    (truth, left), (_, right) = ring(20, seed=1), ring(20, seed=2, log=1)
    opinions = Pose2(3.0, 1.0, 0.4), Pose2(-6.0, 2.0, -2.0)
    bridges = []
    for opinion, count in zip(opinions, votes, strict=True):
        for i in range(count):
            a, b = ScanId(0, 2 * i), ScanId(1, 3 * i)
            T_a_b = truth[a].inverse() @ opinion @ truth[ScanId(0, b.scan)]
            bridges.append(Edge(a, b, T_a_b, COVARIANCE))
    result = optimise([*left, *right, *bridges])
    assert len(result.components) == 1
    kept = [not residual.silenced for residual in result.residuals[-len(bridges) :]]
    first_wins = votes[0] > votes[1]
    assert kept == [first_wins] * votes[0] + [not first_wins] * votes[1]


def test_components_are_kept_apart():
    """Two components come out as each does alone, to the last bit, each in the frame of its first scan."""
    (_, left), (_, right) = ring(30, seed=1), ring(20, seed=2, log=1)
    right = with_wrong(right, 0.2, "random")
    both = optimise([*right, *left])
    assert [part[0] for part in both.components] == [ScanId(0, 0), ScanId(1, 0)]
    assert both.poses == {**optimise(left).poses, **optimise(right).poses}
    for part in both.components:
        assert both.poses[part[0]] == Pose2.identity()


def test_components_that_are_known_come_out_the_same():
    """What is taken from an earlier result is what would be found anew; what changed, or began elsewhere, is not."""
    (_, left), (_, right) = ring(30, seed=1), ring(20, seed=2, log=1)
    right = with_wrong(right, 0.2, "random")
    before, changed = optimise([*left, *right]), [*right, *left[:-1]]
    anew, found = optimise(changed), optimise(changed, known=before)
    assert [part is held for part, held in zip(found.parts, before.parts, strict=True)] == [False, True]
    assert (found.poses, found.residuals, found.components) == (anew.poses, anew.residuals, anew.components)
    assert [step.error for step in found.history] == [step.error for step in anew.history]
    for other in ({"gate": 4.0}, {"most": 0.4}, {"robust": False}):
        assert not {*optimise(changed, known=before, **other).parts} & {*before.parts}
    begun = optimise(changed, before.poses)
    assert not {*optimise(changed, known=begun).parts} & {*begun.parts}


def test_components_and_lonely_scans():
    """Scans that no edge holds are components of their own; edges alone say what hangs together."""
    edges = [Edge(ScanId(0, a), ScanId(0, b), Pose2.identity(), COVARIANCE) for a, b in ((5, 1), (1, 7), (2, 3))]
    parts = components(edges, [ScanId(0, 4), ScanId(0, 5)])
    assert [[scan.scan for scan in part] for part in parts] == [[1, 5, 7], [2, 3], [4]]
    assert components([]) == ()
    assert optimise([]).poses == {}


def test_the_same_every_time():
    """The result is deterministic, to the last bit, history included."""
    _, edges = ring(60)
    mixed = with_wrong(edges, 0.3, "random")
    one, other = optimise(mixed), optimise(mixed)
    assert one.poses == other.poses
    assert [step.error for step in one.history] == [step.error for step in other.history]


@pytest.mark.slow
@given(st.randoms(use_true_random=False))
@settings(max_examples=10)
def test_names_of_scans_and_order_of_edges_do_not_matter(chance):
    """With scans renamed, edges shuffled and some of them told from the other side the map is the same."""
    _, edges = ring(30)
    mixed = with_wrong(edges, 0.3, "random")
    scans = list(optimise(mixed).poses)
    names = dict(zip(scans, chance.sample([ScanId(2, i) for i in range(99)], len(scans)), strict=True))
    told = [edge.reversed() if chance.random() < 0.5 else edge for edge in mixed]
    renamed = [replace(edge, first=names[edge.first], second=names[edge.second]) for edge in told]
    chance.shuffle(renamed)
    expected, found = optimise(mixed), optimise(renamed)
    anchor = found.poses[names[scans[0]]].inverse()
    assert far_apart(expected.poses, {scan: anchor @ found.poses[names[scan]] for scan in scans}) == pytest.approx(
        (0.0, 0.0), abs=1e-6
    )


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0), st.floats(-3.0, 3.0))
@settings(max_examples=10)
def test_where_initial_poses_lie_does_not_matter(x, y, theta):
    """Initial poses moved together, anywhere, give the same poses."""
    truth, edges = ring(30)
    moved = {scan: Pose2(x, y, theta) @ pose for scan, pose in truth.items()}
    assert far_apart(optimise(edges, moved).poses, optimise(edges).poses) == pytest.approx((0.0, 0.0), abs=1e-7)


def test_bad_initial_poses_do_no_harm():
    """From random initial poses, and from poses for some scans only, the same map comes out."""
    truth, edges = ring(30)
    rng = np.random.default_rng(0)
    mixed, expected = with_wrong(edges, 0.2, "random"), optimise(edges).poses
    some = {scan: truth[scan] for scan in list(truth)[::3]}
    odd = {scan: Pose2(*rng.uniform(-9.0, 9.0, 2), rng.uniform(-3.0, 3.0)) for scan in truth}
    assert same(optimise(mixed, some).poses, expected)
    assert same(optimise(edges, odd, robust=False).poses, expected)


def test_a_right_edge_is_heard_twice():
    """Silencing costs an edge no more than the gate: where counting is cheaper for all, an edge counts."""
    _, edges = ring(60, trusted=False, seed=4)
    result = optimise(with_wrong(edges, 0.5, "random"))
    capped = sum(min(residual.chi**2, GATE**2) for residual in result.residuals)
    clean = optimise(edges, robust=False)
    assert capped <= sum(r.chi**2 for r in clean.residuals) + GATE**2 * len(result.silenced) + 1e-6


def test_history_tells_the_rounds():
    """The rounds are told: poses of every scan, and the error of the last is that of the result."""
    _, edges = ring(40)
    result = optimise(with_wrong(edges, 0.2, "random"))
    assert len(result.history) > 2
    last = result.history[-1]
    assert {step.component for step in result.history} == {0}
    assert last.poses.shape == (40, 3)
    assert last.silenced == len(result.silenced)
    assert last.error == pytest.approx(result.error + GATE**2 * len(result.silenced), rel=1e-6)


def test_it_can_be_stopped():
    """What ``check`` raises ends the work."""

    def stop() -> None:
        raise CancelledError("enough")

    with pytest.raises(CancelledError):
        optimise(ring(20)[1], check=stop)


def test_no_such_backend():
    """An unknown backend is refused with the known ones."""
    with pytest.raises(GraphError, match=r"'g2o'.*auto, scipy, gtsam"):
        optimise([], backend="g2o")
