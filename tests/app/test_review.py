"""The review queue, on made-up evidence."""

from __future__ import annotations

from app.review import Outcome, Row, counts, flips, queue, row
from segmap.events import Decision
from segmap.pose import Pose2
from segmap.scans import ScanId

THRESHOLD = 4.0


def made(scan: int, value: float | None = None, *, verdict: str = "", failure: str = "", known: bool = True) -> Row:
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
        THRESHOLD,
    )


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
    ordered = queue(rows, THRESHOLD)
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
    assert [r.first.scan for r in queue([made(10, 5.0), made(9, 5.0)], THRESHOLD)] == [9, 10]


def test_a_decision_shows_its_own_value() -> None:
    """The value accepted, not the best of the heuristic in use; failures are still shown where undecided."""
    decided = made(0, 2.0, verdict="accepted")
    assert (decided.value, decided.above, decided.who) == (5.0, True, "Ada")
    assert made(0, failure="no good").reason == "no good"


def test_exactly_the_threshold_is_not_above() -> None:
    """Valid means strictly above, for rows and for previews."""
    at = made(0, THRESHOLD)
    assert at.above is False
    assert flips([at], THRESHOLD, THRESHOLD - 1e-9).would_pass == (at.id,)
    assert flips([at], THRESHOLD + 1.0, THRESHOLD).would_pass == ()
    assert flips([at], THRESHOLD - 1.0, THRESHOLD).would_fail == (at.id,)
    assert flips([made(1), made(2, 9.0, verdict="accepted")], 0.0, 100.0).would_fail == ()
