"""What is said of an edge, and what accepting one would do."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from graphs import COVARIANCE, far_apart, ring, with_wrong

from segmap.graph import Edge, Ways, explain, loop_of, optimise, preview
from segmap.pose import Pose2
from segmap.scans import ScanId

WRONG = Edge(ScanId(0, 3), ScanId(0, 12), Pose2(9.0, 1.0, 1.0), COVARIANCE)


@pytest.fixture(scope="module")
def edges() -> list[Edge]:
    return ring(40)[1]


def test_a_silenced_edge_in_words(edges):
    """Metres, degrees and standard deviations are said, the gate, and the loop it closes."""
    result = optimise([*edges, WRONG])
    T_3_12 = result.poses[WRONG.first].inverse() @ result.poses[WRONG.second]
    left = WRONG.T_1_2.inverse() @ T_3_12
    first, second = explain(result, result.residuals[-1])
    assert first.startswith("You accepted 0.3-0.12, the optimiser silences it: it puts scan 0.12 ")
    assert f"{math.hypot(left.x, left.y):.2f} m and {math.degrees(abs(left.theta)):.1f} degrees" in first
    assert "more than 5 are not believed" in first
    assert second.startswith("It closes a loop of 4 scans (0.3 - 0.6 - 0.9 - 0.12), which misses itself by ")


@pytest.mark.parametrize(
    ("source", "said"), [("imported", "The imported graph holds"), ("manual", "You placed 0.3-0.12 by hand")]
)
def test_where_an_edge_comes_from_is_said(edges, source, said):
    """An imported edge was not accepted by a person, and a manual one not found by the program."""
    result = optimise([*edges, replace(WRONG, source=source)])
    assert explain(result, result.residuals[-1])[0].startswith(said)


def test_an_edge_that_agrees_in_words(edges):
    """Of an edge that fits it is said how well."""
    result = optimise(edges)
    first, second = explain(result, result.residuals[-1])
    assert "the graph agrees" in first
    assert "loop of" in second


def test_why_a_wrong_edge_is_kept(edges):
    """Far off and kept: because it is trusted, or because nothing checks it."""
    trusted = optimise([*edges, replace(WRONG, trusted=True)], gate=2.0)
    assert "keeps it because it is trusted" in explain(trusted, trusted.residuals[-1])[0]
    tail = Edge(ScanId(0, 5), ScanId(0, 77), Pose2(1.0, 2.0, 3.0), COVARIANCE)
    alone = optimise([*edges, tail])
    assert explain(alone, alone.residuals[-1])[1] == (
        "Nothing checks it: no other edge joins what lies on the two sides of 0.5-0.77."
    )


def test_a_loop_misses_by_what_composing_its_edges_gives():
    """The error of a loop is that of composed poses; a loop of exact edges misses by nothing."""
    _, edges = ring(30, noise=0.0)
    exact = loop_of(edges[0], Ways(edges))
    assert (exact.translation, exact.rotation, exact.chi) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    slid = replace(edges[0], T_1_2=edges[0].T_1_2 @ Pose2(0.3, 0.4, 0.1))
    loop = loop_of(slid, Ways([slid, *edges[1:]]))
    assert (loop.translation, loop.rotation) == pytest.approx((0.5, 0.1), abs=1e-9)
    assert loop.scans[0] == slid.first
    assert loop.scans[-1] == slid.second


def test_a_loop_takes_the_surest_way_and_never_the_edge_itself():
    """Of two ways the one whose variances sum to less is taken; an edge alone closes no loop."""
    a, b, c, d = (ScanId(0, i) for i in range(4))
    vague = tuple(tuple(100.0 * v for v in row) for row in COVARIANCE)
    edge = Edge(a, b, Pose2.identity(), COVARIANCE)
    direct = Edge(b, a, Pose2.identity(), vague)
    round_about = [Edge(p, q, Pose2.identity(), COVARIANCE) for p, q in ((a, c), (c, d), (d, b))]
    assert loop_of(edge, Ways([edge, direct, *round_about])).scans == (a, c, d, b)
    assert loop_of(edge, Ways([edge, direct])).scans == (a, b)
    assert loop_of(edge, Ways([edge])) is None


def test_the_loop_of_an_edge_is_as_unsure_as_its_edges_together():
    """Over many noisy rings the squared Mahalanobis distance of a loop is 3 on average."""
    squared = []
    for seed in range(80):
        _, edges = ring(12, seed=seed, noise=math.sqrt(3.0), reach=1)
        chain = [edge for edge in edges if edge.trusted]
        closing = next(edge for edge in edges if edge.second.scan - edge.first.scan == 6)
        squared.append(loop_of(closing, Ways(chain)).chi ** 2)
    assert sum(squared) / len(squared) == pytest.approx(3.0, abs=0.8)


# --- preview --------------------------------------------------------------------------------------


def test_preview_of_a_right_closure(edges):
    """A closure that fits moves little, contradicts nothing, and is not silenced."""
    shown = preview(edges[:-1], edges[-1])
    assert not shown.joins
    assert not shown.silenced
    assert shown.contradicts == ()
    assert shown.expected.chi < 5.0
    assert shown.loop is not None
    assert all(shift.translation < 0.05 for shift in shown.shifts)


def test_preview_of_a_wrong_closure(edges):
    """A wrong closure is told to be far off, to move scans, and to contradict edges that were accepted."""
    before = optimise(edges)
    shown = preview(edges, WRONG, before)
    assert shown.silenced
    assert shown.expected.chi > 5.0
    assert shown.shifts[0].translation > 0.5
    assert [shift.translation for shift in shown.shifts] == sorted((s.translation for s in shown.shifts), reverse=True)
    assert shown.contradicts
    assert all(residual.edge in edges for residual in shown.contradicts)
    said = " ".join(shown.sentences())
    for part in ("standard deviations", "Accepting it moves", "silences what was accepted before", "would silence"):
        assert part in said


def test_preview_tells_what_accepting_does(edges):
    """The shifts are those between the graphs without and with the candidate believed."""
    before, after = optimise(edges), optimise([*edges, replace(WRONG, trusted=True)])
    shown = preview(edges, WRONG, before)
    most = shown.shifts[0]
    assert before.poses[most.scan].distance(after.poses[most.scan])[0] == pytest.approx(most.translation, abs=1e-6)
    assert far_apart(shown.after.poses, after.poses) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("slide", [0.0, 0.05, 0.1, 0.15, 0.3, 3.0])
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_what_a_preview_says_of_the_candidate_is_what_the_optimiser_does(slide, share):
    """It is silenced exactly if it is once it is accepted, also where all agree and nothing is tried."""
    truth, edges = ring(30, trusted=False)
    held = with_wrong([*edges, *ring(12, log=1)[1]], share, "random") if share else edges
    T_3_21 = truth[ScanId(0, 3)].inverse() @ truth[ScanId(0, 21)]
    candidate = Edge(ScanId(0, 3), ScanId(0, 21), Pose2(T_3_21.x + slide, T_3_21.y, T_3_21.theta), COVARIANCE)
    before = optimise(held, most=0.4)
    shown = preview(held, candidate, before, most=0.4)
    accepted = optimise([*held, candidate], before.poses, most=0.4).residuals[-1]
    assert (shown.silenced, shown.expected.weight) == (accepted.silenced, accepted.weight)
    assert shown.silenced == (slide > 0.12)


def test_a_preview_leaves_other_components_as_they_are(edges):
    """They are the very same; also where the candidate is another pose of what is accepted already."""
    other = ring(20, log=1)[1]
    before = optimise([*other, *edges])
    shown = preview([*other, *edges], WRONG, before)
    assert shown.after.part_of(ScanId(1, 3)) is before.part_of(ScanId(1, 3))
    assert {shift.scan.log for shift in shown.shifts} == {0}
    again = preview([*other[1:], *edges], replace(other[0], T_1_2=Pose2(1.0, 1.0, 1.0)), before)
    assert again.after.part_of(ScanId(0, 3)) is before.part_of(ScanId(0, 3))
    assert again.after.part_of(ScanId(1, 3)) is not before.part_of(ScanId(1, 3))
    assert before.part_of(ScanId(9, 9)) is None


def test_preview_of_what_joins_two_components(edges):
    """An edge between components, or to a new scan, moves nothing within them, and says that nothing checks it."""
    other = ring(20, log=1)[1]
    joining = Edge(ScanId(0, 3), ScanId(1, 5), Pose2(4.0, 4.0, 2.0), COVARIANCE)
    shown = preview([*edges, *other], joining)
    assert shown.joins
    assert shown.expected is None
    assert shown.loop is None
    assert shown.shifts == ()
    assert len(shown.after.components) == 1
    assert "joins what was apart" in shown.sentences()[0]
    assert preview(edges, replace(joining, second=ScanId(3, 3))).joins
