"""The review queue, on made-up evidence."""

from __future__ import annotations

import pytest

from app.criterion import CRITERIA
from app.review import Flips, Outcome, Row, counts, flips, queue, row
from segmap.events import Decision
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.verdict import Findings, confidence
from segmap.visibility import Evidence

THRESHOLD = 4.0
PARAMETERS = Parameters(value_threshold=THRESHOLD)
VERIFIED = preset("verified")


def made(
    scan: int,
    value: float | None = None,
    *,
    verdict: str = "",
    failure: str = "",
    known: bool = True,
    threshold: float = THRESHOLD,
) -> Row:
    """The row of 0.scan with the scan after it; without a value: no transformation."""
    id = f"0.{scan}-0.{scan + 1}"
    outcome = Outcome("all", value or 0.0, None if value is None else (1.0, 2.0, 0.5), 10, None, 1.0, failure)
    decision = None
    if verdict:
        decision = Decision(
            integration=id, verdict=verdict, parameters="p", T_1_2=Pose2(1, 2, 0.5), value=5.0, who="Ada"
        )  # type: ignore[arg-type]
    return row(
        Row(id, ScanId(0, scan), ScanId(0, scan + 1), "matching"),
        "all",
        outcome if known else None,
        decision,
        PARAMETERS.replace(value_threshold=threshold),
    )


def verified(scan: int, gap: float, parameters: Parameters = VERIFIED, value: float = 6.0) -> Row:
    """A row of verified mode: the larger the gap to the nearest rival, the surer."""
    findings = Findings(8.0, gap, Evidence(8.5, 0.1, 0.1, 1.0, 1.0, 0.5), 0.02)
    outcome = Outcome("automatic", value, (1.0, 2.0, 0.5), confidence=confidence(findings), findings=findings)
    id = f"0.{scan}-0.{scan + 1}"
    return row(Row(id, ScanId(0, scan), ScanId(0, scan + 1), "matching"), "automatic", outcome, None, parameters)


def test_what_most_needs_a_person_comes_first() -> None:
    """Closest to the threshold first, then failed, nothing found, not ready, and last what is decided."""
    rows = [
        made(0, verdict="rejected"),
        made(1, verdict="accepted"),
        made(2, known=False),
        made(3),
        made(4, failure="no good"),
        made(5, 9.0),
        made(6, 4.1),
        made(7, 3.95),
        made(8, 0.5),
    ]
    ordered = queue(rows, "paper", PARAMETERS)
    assert [r.first.scan for r in ordered] == [7, 6, 8, 5, 4, 3, 2, 1, 0]
    states = ["pending"] * 4 + ["failed", "none", "matching", "accepted", "rejected"]
    assert [r.state for r in ordered] == states
    assert counts(rows) == {
        "total": 9,
        "pending": 4,
        **dict.fromkeys(("failed", "none", "matching", "accepted", "rejected"), 1),
    }


def test_scans_are_ordered_as_numbers() -> None:
    """Equal doubt: scan 9 before scan 10."""
    assert [r.first.scan for r in queue([made(10, 5.0), made(9, 5.0)], "paper", PARAMETERS)] == [9, 10]


def test_a_decision_shows_its_own_value() -> None:
    """The value accepted, beside what the program says of that pose; failures are still shown where undecided."""
    decided = made(0, 2.0, verdict="accepted")
    assert (decided.value, decided.above, decided.verdict, decided.who) == (5.0, False, "rejected", "Ada")
    assert made(0, failure="no good").reason == "no good"


def test_of_another_pose_than_the_one_decided_on_nothing_is_said() -> None:
    """The program's verdict and confidence stand only beside the pose they are about."""
    outcome = Outcome("all", 9.0, (1.0, 2.0, 0.4))
    decision = Decision(integration="0.0-0.1", verdict="accepted", parameters="p", T_1_2=Pose2(1, 2, 0.5), value=5.0)
    decided = row(Row("0.0-0.1", ScanId(0, 0), ScanId(0, 1), "matching"), "all", outcome, decision, PARAMETERS)
    assert (decided.state, decided.value) == ("accepted", 5.0)
    assert (decided.verdict, decided.above, decided.confidence, decided.score) == (None, None, None, None)


def test_exactly_the_threshold_is_not_above() -> None:
    """Valid means strictly above, for rows and for previews."""
    at = made(0, THRESHOLD)
    assert at.above is False
    lower, higher = (made(0, THRESHOLD, threshold=THRESHOLD + step) for step in (-1e-9, 1.0))
    assert flips([at], [lower]) == Flips((at.id,), ())
    assert flips([lower], [at]) == Flips((), (at.id,))
    assert flips([higher], [at]) == Flips((), ())
    decided = [made(2, 9.0, verdict="accepted", threshold=threshold) for threshold in (0.0, 100.0)]
    assert flips([made(1), decided[0]], [made(1, threshold=100.0), decided[1]]) == Flips((), ())


# --- verified mode --------------------------------------------------------------------------------


def test_what_the_program_leaves_to_a_person_comes_first() -> None:
    """In verified mode: the doubtful, the closest to accepting first; then the rest, the closest first."""
    rows = [verified(0, 4.0), verified(1, 0.0), verified(2, 1.0), verified(3, 0.5), verified(4, 2.0)]
    order = queue(rows, "verified", VERIFIED)
    doubts = [r.verdict != "review" for r in order]
    assert doubts == sorted(doubts)
    assert {r.verdict for r in rows} >= {"accepted", "review"}
    for doubtful in (True, False):
        gaps = [abs((r.confidence or 0.0) - 0.9) for r in order if (r.verdict == "review") is doubtful]
        assert gaps == sorted(gaps)


def test_a_verified_row_carries_verdict_confidence_and_score() -> None:
    """Above means that the verdict is accepted: sure enough, and worth enough as well."""
    sure = verified(0, 4.0)
    assert (sure.verdict, sure.above, sure.score) == ("accepted", True, 8.0)
    assert sure.confidence == pytest.approx(1.0, abs=0.1)
    worthless = verified(0, 4.0, value=0.1)
    assert (worthless.above, worthless.confidence) == (False, sure.confidence)


def test_one_criterion_for_each_mode() -> None:
    """The threshold lies on the value or on the confidence, and moving it flips by that."""
    paper, evidence = CRITERIA["paper"], CRITERIA["verified"]
    row_ = verified(0, 4.0)
    assert (paper.of(row_), evidence.of(row_)) == (6.0, row_.confidence)
    assert (paper.threshold(VERIFIED), evidence.threshold(VERIFIED)) == (0.5, 0.9)
    moved = evidence.moved(VERIFIED, 1.0)
    assert (moved.confidence_accept, moved.value_threshold) == (1.0, 0.5)
    assert flips([row_], [verified(0, 4.0, moved)]).would_fail == (row_.id,)
