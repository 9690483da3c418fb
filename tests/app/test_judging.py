"""Deciding in a view: who and why, what is skipped, what two people do at once, the order a page lists; trials."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from clocks import Clock

from app.drawing import draw
from app.errors import RequestError
from app.judging import REACTION_SECONDS
from app.session import Session
from app.workbench import View
from segmap.errors import ConflictError, ParameterError, ProjectError
from segmap.integration import match_maps
from segmap.segments import extract

PATIENCE = 120.0


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def view(session: Session, clock: Clock) -> Iterator[View]:
    view = View(session, clock=clock)
    yield view
    view.close()


def here(view: View) -> str:
    assert view.looks.integration is not None
    return view.looks.integration


def test_who_and_why_go_with_the_decision_and_the_next_has_no_reason(view: View, session: Session) -> None:
    """Both are in the history, with parameters, version, revision and the evidence; the name stays, the reason not."""
    pair = here(view)
    view.act("set_who", "  Ann ")
    view.act("set_reason", "a door was opened")
    shown = view.act("reject", {"integration": pair, "revision": session.state.revision})
    made = session.state.decisions[pair]
    assert (made.who, made.reason, made.revision) == ("Ann", "a door was opened", made.seq - 1)
    assert made.version
    assert made.parameters == session.state.fingerprint
    assert made.grounds is not None
    assert (made.grounds.verdict, made.grounds.candidates) == (
        session.match(pair).verdict,  # type: ignore[union-attr]
        session.match(pair).candidates,  # type: ignore[union-attr]
    )
    assert (shown["who"], shown["reason"]) == ("Ann", "")
    other = here(view)
    view.act("reject", {"integration": other, "who": "Bob"})
    assert session.state.decisions[other].who == "Bob"


def test_verified_grounds_are_the_match_s(session: Session) -> None:
    """Confidence, score and the metres of each kind; of a rival what was seen, and no verdict."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    match = session.match("0.1-0.2")
    assert match is not None
    for rank, candidate in enumerate(match.ranked[:2]):
        session.decide(["0.1-0.2"], "accepted", candidate=rank)
        grounds = session.state.decisions["0.1-0.2"].grounds
        assert grounds is not None
        assert candidate.evidence is not None
        assert grounds.score == pytest.approx(candidate.score)
        assert grounds.contradicted == pytest.approx(candidate.evidence.contradicted)
        assert grounds.confidence == (match.confidence if rank == 0 else None)
        assert session.row("0.1-0.2").contradicted == pytest.approx(candidate.evidence.contradicted)


def test_what_is_skipped_comes_back_when_the_others_are_done(
    view: View, session: Session, clock: Clock, open_session: Callable[..., Session]
) -> None:
    """It waits at the end of those that wait, over a restart too; deciding on it ends that."""
    skipped = here(view)
    view.skip()
    assert session.row(skipped).later
    waiting = [row.id for row in session.rows() if row.state == "pending"]
    assert waiting[-1] == skipped
    for _ in waiting[:-1]:
        assert here(view) != skipped
        clock.now += 10.0
        view.reject()
    assert here(view) == skipped
    assert not session.state.decisions.get(skipped)
    view.close()
    again = open_session()
    assert again.row(skipped).later
    again.decide([skipped], "rejected")
    assert not again.row(skipped).later
    again.undo()
    assert not again.row(skipped).later


def test_a_click_that_crosses_another_ones_decision_is_told(view: View, session: Session, clock: Clock) -> None:
    """Too soon after it to have seen it; later it is a decision like any other. Our own steps are no news."""
    pair = here(view)
    session.decide([pair], "rejected", who="Bob")
    assert any(f"Bob rejected {pair}" in text for text in view.snapshot()["messages"])
    with pytest.raises(ConflictError, match="Bob"):
        view.accept()
    assert session.state.decisions[pair].verdict == "rejected"
    clock.now += 2.0 * REACTION_SECONDS
    view.accept()
    assert session.state.decisions[pair].verdict == "accepted"
    view.undo()
    assert not any("Bob" in text or "Somebody" in text for text in view.snapshot()["messages"])


def test_a_page_that_shows_an_older_revision_is_told(view: View, session: Session, clock: Clock) -> None:
    """The revision it shows is the one that counts, however long ago the other decision was."""
    pair, seen = here(view), session.state.revision
    session.decide([pair], "rejected", who="Bob")
    clock.now += 60.0
    with pytest.raises(ConflictError, match="Bob rejected"):
        view.act("accept", {"integration": pair, "revision": seen})
    with pytest.raises(ConflictError, match="Bob rejected"):
        view.act("decide_many", {"integrations": [pair], "verdict": "accepted", "revision": seen})


def test_many_at_once_are_one_step(view: View, session: Session) -> None:
    """Accepted, and decided again; one undo each; it is said what was done."""
    ids = [row.id for row in session.rows()][:4]
    shown = view.act("decide_many", {"integrations": ids, "verdict": "accepted"})
    assert shown["messages"][0] == "Accepted: 4 integrations."
    assert {id for id, made in session.state.decisions.items() if made.verdict == "accepted"} == set(ids)
    view.act("decide_many", {"integrations": ids, "verdict": "undecided"})
    assert not session.state.decisions
    view.undo()
    view.undo()
    assert not session.state.decisions
    assert session.state.can_undo is None


def test_steps_follow_what_the_page_lists(view: View, session: Session, clock: Clock) -> None:
    """Next, previous and where a decision goes on to: in the order listed, and nowhere else."""
    ids = sorted(row.id for row in session.rows())
    listed = [ids[4], ids[0], ids[2]]
    view.act("set_order", listed)
    view.select(listed[0])
    seen = []
    for _ in range(4):
        seen.append(here(view))
        view.next()
    assert seen == [*listed, listed[0]]
    view.select(listed[0])
    for _ in listed:
        clock.now += 10.0
        view.reject(here(view))
    assert set(session.state.decisions) == set(listed)
    assert any("3 that are not listed do" in text for text in view.snapshot()["messages"])
    view.act("set_order", None)
    clock.now += 10.0
    view.skip()
    assert here(view) not in listed


@pytest.mark.parametrize(
    ("action", "value"),
    [
        ("accept", {"integration": 3}),
        ("accept", {"integration": "0.0-0.1", "revision": "2"}),
        ("accept", {"integration": "0.0-0.1", "who": 2}),
        ("decide_many", ["0.0-0.1"]),
        ("decide_many", {"integrations": ["0.0-0.1"], "verdict": "maybe"}),
        ("decide_many", {"integrations": [1], "verdict": "accepted"}),
        ("set_order", "0.0-0.1"),
        ("set_order", [1]),
        ("set_who", None),
        ("set_reason", 3),
        ("try_parameters", "seed"),
        ("try_parameters", {"nonsense": 1}),
    ],
)
def test_nonsense_is_refused(view: View, session: Session, action: str, value: Any) -> None:
    """With a sentence; nothing is decided."""
    with pytest.raises((RequestError, ParameterError), match=r"\.$"):
        view.act(action, value)
    assert not session.state.decisions


# --- parameters on trial --------------------------------------------------------------------------


def test_parameters_on_trial_are_shown_and_nothing_else(view: View, session: Session) -> None:
    """What is drawn and told is what the library makes of them; the project, and other views, keep theirs."""
    revision, before, pair = session.state.revision, view.snapshot(), here(view)
    shown = view.act("try_parameters", {"split_tolerance": 0.06})
    parameters = session.state.parameters.replace(split_tolerance=0.06)
    first, second = session.row(pair).first, session.row(pair).second
    maps = [extract(session.scan(scan), parameters, scan.log, scan.scan) for scan in (first, second)]
    match = match_maps(maps[0], maps[1], parameters, "all", "paper")
    assert shown["value"] == pytest.approx(match.value)
    assert shown["trial"]["segments"] == [len(one) for one in maps]
    drawn = next(d for d in draw(view.content()).drawables if d.path == "/first/segments")
    assert np.allclose(drawn.points[:, :, :2].reshape(-1, 4), maps[0].coordinates, atol=1e-5)
    for step in (view.accept, lambda: view.set_nudging(True)):
        with pytest.raises(ProjectError, match="on trial"):
            step()
    assert session.state.revision == revision
    again = view.act("try_parameters", None)
    assert (again["value"], again["trial"]) == (before["value"], None)


def test_another_pair_is_shown_with_the_project_s_parameters(view: View) -> None:
    """A trial is about one pair."""
    view.act("try_parameters", {"split_tolerance": 0.06})
    view.next()
    assert view.snapshot()["trial"] is None


def test_the_newest_trial_wins(view: View, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """One at work stops when the next begins, and its result is dropped."""
    entered, stopped = threading.Event(), []

    def slow(*maps: Any, check: Callable[[], None], **_: Any) -> Any:
        entered.set()
        if not stopped:
            stopped.append(True)
            while True:
                check()
        return match_maps(maps[0], maps[1], maps[2], "all", "paper")

    monkeypatch.setattr("app.trying.match_maps", lambda *a, check, **k: slow(*a[:3], check=check, **k))
    thread = threading.Thread(target=lambda: view.try_parameters({"min_segment_length": 0.3}))
    thread.start()
    assert entered.wait(PATIENCE)
    view.try_parameters({"min_segment_length": 0.5})
    thread.join(PATIENCE)
    assert not thread.is_alive()
    assert view.looks.trial is not None
    assert view.looks.trial.parameters.min_segment_length == 0.5


def test_the_value_is_explained_by_chain_and_segment_and_either_can_be_marked(client: Any, project: str) -> None:
    """Chains and pairs sum to the value; a chain of the list is marked in the scene, a segment says its chain."""
    view = client.post(f"/api/projects/{project}/views").json()["id"]
    told = client.get(f"/api/views/{view}/explanation").json()
    shown = client.get(f"/api/views/{view}").json()
    assert sum(chain["value"] for chain in told["chains"]) == pytest.approx(shown["value"], rel=1e-6)
    for chain, listed in zip(shown["chains"], told["chains"], strict=True):
        assert (chain["number"], chain["colour"]) == (listed["number"], listed["colour"])
        assert {tuple(one[:2]) for one in chain["pairs"]} == {(p["first"], p["second"]) for p in listed["pairs"]}
    marked = client.post(
        f"/api/views/{view}", json={"action": "set_picked", "value": {"source": "chain", "segment": 1}}
    )
    assert marked.json()["picked"]["chain"]["number"] == 2
    segment = told["chains"][1]["first"][0]
    value = {"source": "first", "segment": segment}
    picked = client.post(f"/api/views/{view}", json={"action": "set_picked", "value": value}).json()["picked"]
    assert picked["chain"]["number"] == 2
    detail = client.get(f"/api/views/{view}/detail").json()
    assert detail["row"]["id"] == shown["integration"]
    assert len(detail["match"]["ranked"]) == shown["candidates"]
