"""What one view looks at, and what its buttons do; the session behind it is a real one."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import clocks
import numpy as np
import pytest

from app.actions import ACTIONS
from app.drawing import LAYERS, STAGES, draw
from app.errors import RequestError, UnknownError
from app.scene import markup
from app.session import Session
from app.workbench import DOUBLE_CLICK_SECONDS, View
from segmap.candidates import PAPER_HEURISTICS as HEURISTICS
from segmap.errors import ConflictError, ProjectError, SegmapError

PATIENCE = 120.0


class Clock(clocks.Clock):
    """One that waits, too."""

    def wait(self) -> None:
        """As long as a person takes to look."""
        self.now += 2.0 * DOUBLE_CLICK_SECONDS


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def view(session: Session, clock: Clock) -> Iterator[View]:
    """A view of seven scans, all matched."""
    view = View(session, who="Ann", clock=clock)
    yield view
    view.close()


class Ear:
    """Hears what a view tells."""

    def __init__(self, view: View) -> None:
        self.events: list[Any] = []
        self._changed = threading.Condition()
        self.stop = view.subscribe(self._hear)

    def _hear(self, event: Any) -> None:
        with self._changed:
            self.events.append(event)
            self._changed.notify_all()

    def wait_for(self, true: Callable[[Any], bool]) -> Any:
        with self._changed:
            assert self._changed.wait_for(lambda: any(map(true, self.events)), PATIENCE)
            return next(filter(true, self.events))


def pending(session: Session) -> list[str]:
    return [row.id for row in session.rows() if row.state == "pending"]


def here(view: View) -> str:
    assert view.looks.integration is not None
    return view.looks.integration


# --- choosing -------------------------------------------------------------------------------------


def test_a_view_begins_with_the_pair_that_most_needs_a_person(view: View, session: Session) -> None:
    """The first of the queue, its best candidate, in 2D."""
    shown = view.snapshot()
    assert shown["integration"] == session.rows()[0].id
    assert (shown["candidate"], shown["dimension"], shown["heuristic"]) == (0, 2, "all")
    assert shown["above"] == (shown["value"] > shown["threshold"])


def test_next_and_previous_go_round_the_queue(view: View, session: Session) -> None:
    """As many steps as there are pairs come back; one back undoes one on."""
    order = [row.id for row in session.rows()]
    seen = []
    for _ in order:
        seen.append(here(view))
        view.next()
    assert seen == order
    assert here(view) == order[0]
    view.previous()
    assert here(view) == order[-1]


def test_candidates_are_stepped_through_by_value_and_end(view: View) -> None:
    """Values fall, and beyond the ends the last one stays."""
    view.previous_candidate()
    values = []
    for _ in range(view.snapshot()["candidates"] + 2):
        values.append(view.snapshot()["value"])
        view.next_candidate()
    assert values == sorted(values, reverse=True)
    assert view.snapshot()["candidate"] == view.snapshot()["candidates"] - 1
    view.set_candidate(-5)
    assert view.snapshot()["candidate"] == 0


def test_in_verified_mode_the_evidence_is_told(view: View, session: Session) -> None:
    """Confidence and verdict of the best, evidence and weakest direction of the one shown; rivals are not judged."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    best = view.snapshot()
    match = session.match("0.0-0.1")
    assert match is not None
    assert (best["confidence"], best["verdict"], best["reasons"]) == (
        match.confidence,
        match.verdict,
        list(match.reasons),
    )
    assert (best["criterion"]["quantity"], best["threshold"], best["behind"]) == ("confidence", 0.9, 0.0)
    assert best["above"] == (match.verdict == "accepted")
    assert set(best["evidence"]) >= {"supported", "contradicted", "shadowed", "unseen", "agreement", "overlap"}
    assert best["uncertainty"]["weakest"] >= best["uncertainty"]["strongest"] > 0.0
    view.next_candidate()
    rival = view.snapshot()
    assert (rival["candidate"], rival["above"]) == (1, None)
    assert rival["behind"] == pytest.approx(best["score"] - rival["score"])
    assert rival["behind"] >= 0.0


def test_lines_of_sight_are_drawn_at_the_candidate(view: View, session: Session) -> None:
    """The picture's metres are those of the evidence, in both modes, for every candidate shown."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    view.set_stage("candidate")
    for _ in range(3):
        pair = view.content().pair
        assert pair is not None
        assert pair.candidate is not None
        assert pair.sights is not None
        assert pair.candidate.evidence is not None
        for name in ("supported", "contradicted", "shadowed", "unseen"):
            assert getattr(pair.sights.evidence, name) == pytest.approx(getattr(pair.candidate.evidence, name))
        told = next(layer for layer in view.snapshot()["layers"] if layer["name"] == "sights")
        assert told["visible"]
        assert f"supported {pair.sights.evidence.supported:.1f} m" in told["caption"]
        assert len(told["colours"]) == 4
        view.next_candidate()
    session.configure({}, mode="paper")
    assert session.settle(PATIENCE)
    assert any(drawable.layer == "sights" for drawable in view.picture().drawables)


def test_in_verified_mode_candidates_are_told_by_their_score(view: View, session: Session) -> None:
    """Rivals, and the space of poses, also where scores are negative; what lies on what is told for one segment too."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    view.set_stage("candidate")
    view.set_dimension(3)
    content = view.content()
    assert content.pair is not None
    ranked = content.pair.ranked
    told = {layer["name"]: layer["caption"] for layer in view.snapshot()["layers"]}
    assert f"by score, {ranked[-1].score:.2f} to {ranked[0].score:.2f} m" in told["candidates"]
    assert any(f"with {rival.score:.2f} m" in told["rivals"] for rival in ranked[1:])
    worthless = replace(content.pair, ranked=tuple(replace(c, score=-1.0 - c.index) for c in ranked))
    bars = [d for d in draw(replace(content, pair=worthless)).drawables if d.name == "candidates/bars"]
    assert all(np.isfinite(bar.points).all() for bar in bars)
    view.set_heuristic("extremes")
    assert session.settle(PATIENCE)
    assert "lays on each other" in next(x["caption"] for x in view.snapshot()["layers"] if x["name"] == "angle")
    assert "laid on segment" in markup.candidate(view.snapshot())


def test_a_heuristic_the_mode_does_not_have_is_left(view: View, session: Session) -> None:
    """The view goes back to the project's heuristic when the mode is changed."""
    session.configure({}, mode="verified")
    for heuristic in ("all", "consecutive", "random", "histogram", "extremes"):
        view.next_heuristic()
        assert view.snapshot()["heuristic"] == heuristic
    session.configure({}, mode="paper")
    assert view.snapshot()["heuristic"] == "all"
    assert [told["heuristic"] for told in view.snapshot()["heuristics"]] == list(HEURISTICS)


def test_heuristics_are_stepped_through_and_computed(view: View, session: Session) -> None:
    """Each one is computed when it is looked at, and then told with tries, time, value and pose."""
    ear = Ear(view)
    for heuristic in (*HEURISTICS[1:], HEURISTICS[0]):
        view.next_heuristic()
        assert view.snapshot()["heuristic"] == heuristic
        event = ear.wait_for(
            lambda e, h=heuristic: any(t["heuristic"] == h and t["tried"] is not None for t in e["heuristics"])
        )
        told = next(one for one in event["heuristics"] if one["heuristic"] == heuristic)
        assert told["milliseconds"] > 0.0
        assert (told["draws"] is not None) == (heuristic == "random")
    view.previous_heuristic()
    assert view.snapshot()["heuristic"] == HEURISTICS[-1]
    assert session.state.heuristic == "all"


def test_stages_end_and_layers_are_remembered_for_each(view: View) -> None:
    """The first and the last stage stay; what was switched in one stage is switched when one comes back."""
    view.set_stage(STAGES[0])
    view.previous_stage()
    assert view.looks.stage == STAGES[0]
    view.set_stage("candidate")
    view.toggle_layer("returns")
    switched = {layer["name"]: layer["visible"] for layer in view.snapshot()["layers"]}["returns"]
    view.set_stage("chains")
    view.set_stage("candidate")
    assert {layer["name"]: layer["visible"] for layer in view.snapshot()["layers"]}["returns"] == switched
    for _ in STAGES:
        view.next_stage()
    assert view.looks.stage == STAGES[-1]


def test_a_click_explains_a_segment_and_another_one_elsewhere_ends_it(view: View) -> None:
    """Picked by place, told with what it adds."""
    view.set_stage("segments")
    (x1, y1, x2, y2) = view.session.segment_map(view.session.scan_ids[0]).coordinates[0]
    view.select("0.0-0.1")
    view.pick((x1 + x2) / 2.0, (y1 + y2) / 2.0, 0.05)
    told = view.snapshot()["picked"]
    assert (told["source"], told["segment"]) == ("first", 0)
    view.pick(1e4, 1e4, 0.05)
    assert view.snapshot()["picked"] is None


# --- deciding -------------------------------------------------------------------------------------


def test_accepting_goes_on_and_undo_comes_back(view: View, session: Session, clock: Clock) -> None:
    """The next pending pair is shown; undo shows the pair again, undecided; redo decides it again."""
    first, second = pending(session)[:2]
    view.accept()
    assert session.state.decisions[first].verdict == "accepted"
    assert session.state.decisions[first].who == "Ann"
    assert here(view) == second
    assert first in view.snapshot()["undo"]
    view.undo()
    assert here(view) == first
    assert first not in session.state.decisions
    view.redo()
    assert session.state.decisions[first].verdict == "accepted"
    assert view.snapshot()["row"]["state"] == "accepted"


def test_what_is_accepted_is_the_candidate_shown(view: View, session: Session) -> None:
    """Its pose is stored, and shown again when the pair is looked at again."""
    pair = here(view)
    view.set_candidate(2)
    pose = view.snapshot()["pose"]
    view.accept()
    held = session.state.decisions[pair]
    assert held.T_1_2 is not None
    assert dict(zip(["x", "y", "theta"], held.T_1_2, strict=True)) == pose
    view.select(pair)
    assert view.snapshot()["candidate"] == 2
    view.set_candidate(0)
    assert any("another pose" in message for message in view.snapshot()["messages"])


def test_a_double_click_decides_once(view: View, session: Session, clock: Clock) -> None:
    """The second click was meant for the pair that has gone; a person who has looked can go on."""
    view.accept()
    view.accept()
    assert len(session.state.decisions) == 1
    clock.wait()
    view.accept()
    assert len(session.state.decisions) == 2


def test_a_decision_can_name_the_pair_it_is_meant_for(view: View, session: Session) -> None:
    """For another pair than the one shown it decides nothing."""
    shown, other = pending(session)[:2]
    view.reject(other)
    assert not session.state.decisions
    view.reject(shown)
    assert session.state.decisions[shown].verdict == "rejected"


def test_skip_leaves_it_undecided_and_goes_round(view: View, session: Session) -> None:
    """After as many skips as there are pending pairs the first is there again."""
    order = pending(session)
    for following in (*order[1:], order[0]):
        view.skip()
        assert here(view) == following
    assert not session.state.decisions


def test_when_nothing_is_left_it_says_so(view: View, session: Session, clock: Clock) -> None:
    """The last decision stays on its pair, and skipping stays too."""
    while pending(session):
        view.reject()
        clock.wait()
    last = here(view)
    assert any("No other pair" in message for message in view.snapshot()["messages"])
    view.skip()
    assert here(view) == last
    with pytest.raises(ProjectError, match="redo"):
        view.redo()


def test_the_second_of_two_conflicting_decisions_is_told(view: View, session: Session) -> None:
    """Somebody decided the pair while this view was looking at an older state."""
    pair = here(view)
    view._unsubscribe()  # as if the news was still on its way
    session.decide([pair], "rejected", who="Bob")
    with pytest.raises(ConflictError):
        view.accept()
    assert session.state.decisions[pair].who == "Bob"


def test_another_ones_decision_is_shown_at_once(view: View, session: Session) -> None:
    """The view stays where it is and shows the new state."""
    ear, pair = Ear(view), here(view)
    session.decide([pair], "rejected", who="Bob")
    event = ear.wait_for(lambda e: e["row"]["state"] == "rejected")
    assert (event["type"], event["integration"], event["row"]["who"]) == ("view", pair, "Bob")


# --- matches that come, fail, or never were -------------------------------------------------------


def test_a_match_that_arrives_is_shown(open_session: Callable[..., Session], finder: Any) -> None:
    """While it is computed the view says so; then it draws the candidate."""
    finder.hold()
    view = View(open_session(find=finder))
    assert any("being matched" in message for message in view.snapshot()["messages"])
    assert view.picture().drawables
    with pytest.raises(ProjectError, match="no transformation"):
        view.accept()
    ear = Ear(view)
    finder.go()
    event = ear.wait_for(lambda e: e["candidate"] is not None)
    assert event["value"] > 0.0


def test_a_match_that_fails_is_told_and_not_asked_for_again(open_session: Callable[..., Session], finder: Any) -> None:
    """Looking at it again and again does not compute it again."""
    finder.failing = {0}
    session = open_session(find=finder)
    view = View(session)
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    asked = len(finder.asked)
    for stage in STAGES:
        view.set_stage(stage)
    assert session.settle(PATIENCE)
    assert len(finder.asked) == asked
    assert view.snapshot()["row"]["state"] == "failed"


def test_changed_parameters_have_the_pair_matched_anew(view: View, session: Session) -> None:
    """What was found under the old ones is gone at once, and comes again."""
    ear = Ear(view)
    session.set_parameters({"split_tolerance": 0.05})
    ear.wait_for(lambda e: e["candidate"] is None)
    assert session.settle(PATIENCE)
    assert view.snapshot()["candidate"] == 0


def test_the_map_stage_says_why_it_is_empty_and_then_is_not(view: View, session: Session) -> None:
    """Nothing accepted: so it says; after a decision the map comes by itself."""
    view.set_stage("map")
    assert view.snapshot()["messages"] == ["Nothing is accepted yet: the merged map is empty."]
    ear = Ear(view)
    session.decide([here(view)], "accepted")
    ear.wait_for(lambda e: any(layer["name"] == "map" and "2 scans" in layer["caption"] for layer in e["layers"]))
    assert view.snapshot()["messages"] == [f"Somebody else accepted {here(view)}."]
    caption = next(layer["caption"] for layer in view.snapshot()["layers"] if layer["name"] == "map")
    assert "5 scans not placed" in caption


# --- what pages ask for ---------------------------------------------------------------------------


def test_every_action_can_be_asked_for_by_name(view: View, clock: Clock) -> None:
    """Each with a value it takes; each answers with a snapshot that is JSON."""
    values: dict[str, Any] = {
        "select": "0.1-0.2",
        "set_heuristic": "histogram",
        "set_stage": "fused",
        "toggle_layer": LAYERS[0],
        "set_theme": "dark",
        "set_candidate": 1,
        "set_dimension": 3,
        "set_picked": {"source": "first", "segment": 0},
        "set_colouring": "misfit",
        "set_compare": "given",
        "set_side": "over",
        "set_who": "Ann",
        "set_reason": "glass",
        "decide_many": {"integrations": ["0.1-0.2"], "verdict": "accepted"},
        "set_nudging": True,
        "hold": {"x": 0.0, "y": 0.0, "theta": 0.0},
        "lay": {"source": "first", "segment": 0},
    }
    deciding = ("accept", "reject", "undo", "redo")
    for action in (*deciding, *(name for name in ACTIONS if name not in deciding)):
        clock.wait()
        if action in ("toggle_component", "isolate"):
            assert view.session.settle(PATIENCE)
            values[action] = str(view.session.components()[0].scans[0])
        shown = view.act(action, values.get(action))
        assert json.loads(json.dumps(shown, allow_nan=False)) == shown


@pytest.mark.parametrize(
    ("action", "value"),
    [
        ("select", "9.9-9.10"),
        ("select", 3),
        ("select", None),
        ("set_stage", "nowhere"),
        ("set_candidate", "first"),
        ("set_candidate", True),
        ("set_dimension", 4),
        ("toggle_layer", "<script>"),
        ("set_theme", "pink"),
        ("set_heuristic", "guess"),
        ("accept", 1),
        ("set_picked", "first"),
        ("set_picked", {"source": 1}),
        ("__init__", None),
        ("close", None),
    ],
)
def test_what_makes_no_sense_is_refused(view: View, action: str, value: Any) -> None:
    """With a sentence, and nothing changes."""
    before = view.looks
    with pytest.raises((RequestError, UnknownError)) as caught:
        view.act(action, value)
    assert isinstance(caught.value, SegmapError)
    assert str(caught.value).endswith(".")
    assert view.looks is before


def test_many_hands_on_one_view_leave_it_whole(view: View, session: Session) -> None:
    """Actions of several threads come one after the other; the view ends at something that exists."""

    def play() -> None:
        for _ in range(10):
            view.next_candidate()
            view.next()
            view.next_stage()
            view.snapshot()
            view.picture()
            view.set_stage(STAGES[0])

    threads = [threading.Thread(target=play) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert here(view) in session.integrations


def test_a_snapshot_told_late_is_known_by_its_serial(view: View, session: Session) -> None:
    """The one with the greatest serial shows what is looked at now, in whichever order they arrive."""
    ear = Ear(view)
    first = view.snapshot()
    threads = [threading.Thread(target=lambda: [view.next() for _ in range(10)])]
    threads += [threading.Thread(target=lambda: [view.say("now") for _ in range(10)]) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    ear.stop()
    serials = [event["serial"] for event in ear.events]
    newest = max(ear.events, key=lambda event: event["serial"])
    assert len(set(serials)) == len(serials) == 40
    assert min(serials) > first["serial"]
    assert newest["integration"] == view.looks.integration


def test_a_closed_view_hears_nothing(view: View, session: Session) -> None:
    """After close, decisions elsewhere reach no subscriber of it."""
    ear = Ear(view)
    view.close()
    session.decide([here(view)], "rejected")
    assert ear.events == []
