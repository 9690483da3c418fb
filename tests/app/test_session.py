"""An open project: matching, deciding, and the merged map that follows."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.errors import RequestError, UnknownError
from app.session import Session
from segmap.errors import ConflictError, ParameterError, ProjectError, ScanError
from segmap.events import SetHeuristic
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.store import Store

PATIENCE = 120.0
FIRST, SECOND, THIRD = "0.0-0.1", "0.1-0.2", "0.2-0.3"
Open = Callable[..., Session]


class Ear:
    """Listens to a session."""

    def __init__(self, session: Session) -> None:
        self.events: list[Any] = []
        self._changed = threading.Condition()
        self.stop = session.subscribe(self._hear)

    def _hear(self, event: Any) -> None:
        with self._changed:
            self.events.append(event)
            self._changed.notify_all()

    def of(self, kind: str) -> list[Any]:
        return [event for event in self.events if event["type"] == kind]

    def wait(self, kind: str, count: int = 1) -> Any:
        with self._changed:
            assert self._changed.wait_for(lambda: len(self.of(kind)) >= count, PATIENCE)
            return self.of(kind)[count - 1]


def states(session: Session) -> dict[str, str]:
    return {row.id: row.state for row in session.rows()}


# --- what there is --------------------------------------------------------------------------------


def test_integrations_are_the_consecutive_scans_of_each_log(tmp_path: Path, log_bytes: bytes) -> None:
    """The last scan of one log and the first of the next make no pair."""
    with Store.create(tmp_path / "two.segmap", "Two") as store:
        store.add_log("a.log", log_bytes, scans=3)
        store.add_log("b.log", log_bytes, scans=2)
    session = Session("two", Store.open(tmp_path / "two.segmap"))
    session.close()
    assert session.integrations == ("0.0-0.1", "0.1-0.2", "1.0-1.1")
    assert session.scan_ids[-1] == ScanId(1, 1)


def test_scans_and_segments_are_there_before_any_match(open_session: Open, finder: Any) -> None:
    """The first picture waits for no search."""
    finder.hold()
    session = open_session(find=finder)
    assert len(session.scan(ScanId(0, 6))) == 180
    assert len(session.segment_map(ScanId(0, 6))) > 2
    assert session.segment_map(ScanId(0, 6)) is session.segment_map(ScanId(0, 6))


def test_unknown_scans_and_integrations_are_told(session: Session) -> None:
    """Each with an error of its own, never an internal one."""
    with pytest.raises(ScanError):
        session.scan(ScanId(0, 7))
    with pytest.raises(UnknownError):
        session.scan(ScanId(1, 0))
    for unknown in ("0.0-0.2", "0.6-0.7", "nonsense", ""):
        with pytest.raises(UnknownError):
            session.row(unknown)


# --- matching -------------------------------------------------------------------------------------


def test_all_pairs_are_matched_in_the_background(open_session: Open, finder: Any) -> None:
    """Every pair gets a match, told one by one, with progress to the end."""
    finder.hold()
    session = open_session(find=finder)
    ear = Ear(session)
    assert session.match(FIRST) is None
    assert session.row(FIRST).state == "matching"
    finder.go()
    assert session.settle(PATIENCE)
    assert {event["integration"] for event in ear.of("match")} == set(session.integrations)
    assert (session.progress.done, session.progress.total, session.progress.running) == (6, 6, 0)
    match = session.match(FIRST)
    assert match is not None
    assert match.value == session.row(FIRST).value


def test_a_restart_computes_nothing_again(open_session: Open, finder: Any) -> None:
    """What was found is kept in the project file."""
    first = open_session()
    assert first.settle(PATIENCE)
    found = {name: first.match(name) for name in first.integrations}
    again = open_session(find=finder)
    assert again.settle(PATIENCE)
    assert finder.asked == []
    assert {name: again.match(name) for name in again.integrations} == found


def test_a_lost_cache_is_only_time_lost(open_session: Open, project_file: Path) -> None:
    """Without the cache, or with nonsense in it, matches are computed again."""
    values = [row.value for row in _settled(open_session()).rows()]
    with Store.open(project_file) as store:
        keys = [key for (key,) in store._connection.execute("SELECT key FROM results").fetchall()]
        store.put_results({key.partition(" ")[2]: "nonsense" for key in keys})
    assert [row.value for row in _settled(open_session()).rows()] == values
    with Store.open(project_file) as store:
        store.drop_results()
    assert [row.value for row in _settled(open_session()).rows()] == values


def _settled(session: Session) -> Session:
    assert session.settle(PATIENCE)
    return session


def test_what_is_asked_for_comes_first(open_session: Open, finder: Any) -> None:
    """The pair and the heuristic somebody looks at overtake the queue."""
    finder.hold()
    session = open_session(find=finder)
    finder.wait_until_asked()
    session.request("0.5-0.6")
    session.request("0.3-0.4", "histogram")
    finder.go()
    assert session.settle(PATIENCE)
    assert finder.asked[:3] == [(0, "all"), (3, "histogram"), (5, "all")]
    assert session.match("0.3-0.4", "histogram") is not None
    assert session.progress.done == 6


def test_cancel_really_stops(open_session: Open, finder: Any) -> None:
    """After cancel the search has ended in the middle and no other begins; resume does the rest."""
    finder.hold()
    session = open_session(find=finder)
    finder.wait_until_asked()
    session.cancel()
    assert session.settle(PATIENCE)
    assert (finder.stopped, len(finder.asked), session.progress.cancelled) == (1, 1, True)
    assert session.progress.running == 0
    finder.go()
    session.resume()
    assert session.settle(PATIENCE)
    assert session.progress.done == 6


def test_one_failing_pair_stops_nothing_else(open_session: Open, finder: Any, caplog: pytest.LogCaptureFixture) -> None:
    """A failure is that row's state; asked for again, the pair is tried again."""
    finder.failing = {1}
    session = _settled(open_session(find=finder))
    assert states(session)[SECOND] == "failed"
    assert "ValueError" in session.row(SECOND).reason
    assert sum(state == "pending" for state in states(session).values()) == 5
    with pytest.raises(ProjectError, match="cannot be accepted"):
        session.decide([SECOND], "accepted")
    finder.failing = set()
    session.request(SECOND)
    assert _settled(session).row(SECOND).state == "pending"
    assert session.progress.done == 6


def test_results_that_come_after_a_change_of_parameters_are_dropped(open_session: Open, finder: Any) -> None:
    """Only matches under the parameters in force are shown, whatever ends late."""
    release = threading.Event()

    def slow(map_1: Any, map_2: Any, parameters: Any, heuristic: str, mode: str, *, check: Any) -> Any:
        if parameters.split_tolerance != 0.05:
            assert release.wait(PATIENCE)  # does not look at check: it ends late, with a result
        return finder(map_1, map_2, parameters, heuristic, mode, check=lambda: None)

    session = open_session(find=slow)
    ear = Ear(session)
    session.set_parameters({"split_tolerance": 0.05})
    release.set()
    assert session.settle(PATIENCE)
    assert len(ear.of("match")) == 6
    fresh = _settled(open_session())
    assert fresh.state.parameters.split_tolerance == 0.05
    assert all(session.row(name).value == fresh.row(name).value for name in fresh.integrations)


def test_another_threshold_searches_nothing_again(open_session: Open, finder: Any) -> None:
    """The threshold judges what was found; the verdict and the rows follow it."""
    session = _settled(open_session(find=finder))
    finder.asked.clear()
    value = session.row(FIRST).value
    assert value is not None
    for threshold, above in ((value - 0.01, True), (value + 0.01, False)):
        session.set_parameters({"value_threshold": threshold})
        match = session.match(FIRST)
        assert match is not None
        assert (session.row(FIRST).above, match.verdict == "accepted") == (above, above)
    assert session.settle(PATIENCE)
    assert finder.asked == []


def test_parameters_of_one_heuristic_leave_the_others_alone(open_session: Open, finder: Any) -> None:
    """A change that cannot matter costs nothing, and coming back to earlier parameters costs nothing."""
    session = _settled(open_session(find=finder))
    session.request(FIRST, "histogram")
    assert session.settle(PATIENCE)
    finder.asked.clear()
    session.set_parameters({"histogram_slots": 36})
    assert session.settle(PATIENCE)
    assert finder.asked == []
    assert session.match(FIRST, "histogram") is None
    session.undo()
    assert session.match(FIRST, "histogram") is not None


def test_another_heuristic_for_all(session: Session) -> None:
    """The queue shows what the project's heuristic finds; decisions stay."""
    session.decide([FIRST], "accepted")
    session.set_heuristic("consecutive")
    assert session.settle(PATIENCE)
    assert session.row(SECOND).heuristic == "consecutive"
    assert (session.row(FIRST).state, session.row(FIRST).heuristic) == ("accepted", "all")


def test_the_mode_can_be_changed(session: Session) -> None:
    """Matches are those of the mode; its heuristic and threshold come with it, unless a person chose others."""
    before = session.row(FIRST)
    assert (session.state.mode, before.confidence) == ("paper", None)
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    state, row = session.state, session.row(FIRST)
    assert (state.mode, state.heuristic, state.parameters.value_threshold) == ("verified", "automatic", 0.5)
    match = session.match(FIRST)
    assert match is not None
    assert (row.heuristic, row.confidence, row.verdict) == ("automatic", match.confidence, match.verdict)
    session.configure({"value_threshold": 3.0}, heuristic="consecutive")
    session.configure({}, mode="paper")
    assert (session.state.heuristic, session.state.parameters.value_threshold) == ("consecutive", 3.0)
    with pytest.raises(ParameterError):
        session.match(FIRST, "automatic")
    for _ in range(5):
        session.undo()
    assert session.settle(PATIENCE)
    assert (session.state.mode, session.row(FIRST)) == ("paper", before)


def test_each_mode_keeps_what_it_found(open_session: Open, finder: Any) -> None:
    """Going to the other mode and back searches nothing twice."""
    session = _settled(open_session(find=finder))
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    finder.asked.clear()
    for mode in ("paper", "verified"):
        session.configure({}, mode=mode)
        assert session.settle(PATIENCE)
    assert finder.asked == []


def test_another_confidence_searches_nothing_again(open_session: Open, finder: Any) -> None:
    """In verified mode the threshold lies on the confidence; it judges what was found, and makes no other map."""
    session = open_session(find=finder)
    session.configure({}, mode="verified")
    session.decide([SECOND], "rejected")
    assert session.settle(PATIENCE)
    finder.asked.clear()
    sure = session.row(FIRST).confidence
    assert session.row(FIRST).above
    assert sure is not None
    assert sure < 1.0
    assert FIRST in session.preview_threshold(1.0).would_fail
    session.set_parameters({"confidence_accept": 1.0})
    row, match = session.row(FIRST), session.match(FIRST)
    assert match is not None
    assert (row.verdict, row.above, match.verdict) == ("review", False, "review")
    assert FIRST in session.preview_threshold(sure).would_pass
    with pytest.raises(ParameterError):
        session.preview_threshold(1.5)
    assert session.settle(PATIENCE)
    assert finder.asked == []


def test_a_mode_that_does_not_exist_opens_nothing(project_file: Path) -> None:
    """A project file that asks for it is refused with a sentence."""
    with Store.open(project_file) as store:
        store.append(SetHeuristic(mode="guess"))
        with pytest.raises(ParameterError, match="no mode 'guess'"):
            Session("seven", store)


def test_impossible_settings_change_nothing(session: Session) -> None:
    """All of a change, or nothing of it."""
    before = session.state
    with pytest.raises(ParameterError):
        session.set_parameters({"value_threshold": -1})
    with pytest.raises(ParameterError):
        session.set_heuristic("guess")
    with pytest.raises(ParameterError):
        session.configure({"value_threshold": 3.0}, preset_name="none such")
    with pytest.raises(ParameterError):
        session.match(FIRST, "guess")
    assert session.state == before


# --- deciding -------------------------------------------------------------------------------------


def test_a_decision_keeps_its_evidence(session: Session) -> None:
    """Pose, value, heuristic, mode, rank, parameters, who and why are those of the candidate accepted."""
    match = session.match(FIRST)
    assert match is not None
    session.decide([FIRST], "accepted", who="Ada", reason="looks right")
    decision = session.state.decisions[FIRST]
    assert (decision.T_1_2, decision.value, decision.candidate) == (match.T_1_2, match.value, 0)
    assert (decision.heuristic, decision.mode, decision.who, decision.reason) == ("all", "paper", "Ada", "looks right")
    assert decision.parameters == session.state.fingerprint


def test_another_candidate_and_another_heuristic(session: Session) -> None:
    """What is accepted is the candidate looked at, not the best of all."""
    for name in session.integrations[1:]:
        session.request(name, "random")
    assert session.settle(PATIENCE)
    match = session.match(FIRST)
    others = {name: session.match(name, "random") for name in session.integrations[1:]}
    second, other = next((name, found) for name, found in others.items() if found is not None and found.ranked)
    assert match is not None
    session.decide([FIRST], "accepted", candidate=2)
    session.decide([second], "accepted", heuristic="random")
    decisions = session.state.decisions
    assert (decisions[FIRST].T_1_2, decisions[FIRST].candidate) == (match.ranked[2].T_1_2, 2)
    assert (decisions[second].T_1_2, decisions[second].heuristic) == (other.T_1_2, "random")
    with pytest.raises(UnknownError):
        session.decide([FIRST], "accepted", candidate=10_000)


def test_what_has_no_transformation_cannot_be_accepted(open_session: Open, finder: Any) -> None:
    """Neither before it is matched nor when nothing was found; it can be rejected."""
    finder.hold()
    session = open_session(find=finder)
    with pytest.raises(ProjectError, match="not been matched"):
        session.decide([FIRST], "accepted")
    session.decide([FIRST], "rejected")
    assert session.row(FIRST).state == "rejected"
    with pytest.raises(RequestError):
        session.decide([SECOND], "perhaps")


def test_scans_too_poor_for_a_pair_are_a_result(open_session: Open) -> None:
    """No segments, no transformation: a row that says none, with the reason in the match."""
    session = open_session()
    session.set_parameters({"min_segment_length": 10.0})
    assert session.settle(PATIENCE)
    assert set(states(session).values()) == {"none"}
    match = session.match(FIRST)
    assert match is not None
    assert "an angle takes two" in match.reasons[0]
    with pytest.raises(ProjectError, match="found no transformation"):
        session.decide([FIRST], "accepted")
    session.decide([FIRST], "rejected")
    assert session.row(FIRST).state == "rejected"


def test_many_decisions_are_one_step(session: Session) -> None:
    """Bulk decisions are undone and redone in one go, also after a restart."""
    change = session.decide(session.integrations, "accepted")
    assert change.integrations == session.integrations
    undone = session.undo("Ada")
    assert set(states(session).values()) == {"pending"}
    assert undone.integrations == session.integrations
    session.redo()
    assert set(states(session).values()) == {"accepted"}


def test_undo_after_a_restart(open_session: Open) -> None:
    """What was decided before a restart is there, and can be undone and redone."""
    _settled(open_session()).decide([FIRST], "rejected")
    session = open_session()
    assert session.row(FIRST).state == "rejected"
    session.undo()
    assert session.row(FIRST).state == "pending"
    session.redo()
    assert session.row(FIRST).state == "rejected"
    session.clear([FIRST])
    assert session.row(FIRST).state == "pending"
    with pytest.raises(ProjectError, match="nothing to redo"):
        session.redo()


def test_a_second_click_changes_nothing(session: Session) -> None:
    """The same decision again, even on the same old revision, is no second step and no conflict."""
    revision = session.state.revision
    first = session.decide([FIRST], "accepted", expected_revision=revision)
    second = session.decide([FIRST], "accepted", expected_revision=revision)
    assert (second.state.revision, second.integrations) == (first.state.revision, ())


def test_the_second_of_two_conflicting_decisions_is_told(session: Session) -> None:
    """Somebody who decides on an old picture learns that it is old; decisions on other pairs do not disturb."""
    revision = session.state.revision
    session.decide([FIRST], "accepted", who="Ada", expected_revision=revision)
    session.decide([SECOND], "accepted", who="Bob", expected_revision=revision)
    with pytest.raises(ConflictError, match="Ada"):
        session.decide([FIRST], "rejected", who="Bob", expected_revision=revision)
    assert session.row(FIRST).state == "accepted"


def test_everybody_hears_of_a_decision(session: Session, caplog: pytest.LogCaptureFixture) -> None:
    """With the rows it changed; a listener that fails harms nobody, one that left hears nothing."""

    def failing(event: Any) -> None:
        raise ValueError("no good")

    session.subscribe(failing)
    ear, gone = Ear(session), Ear(session)
    gone.stop()
    session.decide([FIRST], "accepted", who="Ada")
    event = ear.of("decision")[0]
    assert (event["integrations"], event["rows"][0]["state"], event["rows"][0]["who"]) == ((FIRST,), "accepted", "Ada")
    assert event["undo"] == f"accepted {FIRST}"
    assert gone.events == []


# --- the queue ------------------------------------------------------------------------------------


def test_the_threshold_can_be_tried(session: Session) -> None:
    """The preview names exactly the undecided integrations that then flip."""
    values = {row.id: row.value for row in session.rows()}
    ordered = sorted(values, key=lambda name: values[name] or 0.0)
    low, high = (values[ordered[1]] or 0.0) + 1e-6, (values[ordered[4]] or 0.0) + 1e-6
    session.set_parameters({"value_threshold": high})
    assert set(session.preview_threshold(low).would_pass) == set(ordered[2:5])
    assert session.preview_threshold(low).would_fail == ()
    session.decide([ordered[2]], "rejected")
    session.set_parameters({"value_threshold": low})
    assert set(session.preview_threshold(high).would_fail) == set(ordered[3:5])


# --- the merged map -------------------------------------------------------------------------------


def test_the_map_holds_what_is_accepted(session: Session) -> None:
    """Accepted pairs that share a scan form one component; what is not accepted is not in it."""
    ear = Ear(session)
    session.decide([FIRST, SECOND, "0.4-0.5"], "accepted")
    merged = session.merged(PATIENCE)
    parts = [tuple(str(scan) for scan in part.scans) for part in merged.components]
    assert parts == [("0.0", "0.1", "0.2"), ("0.4", "0.5")]
    assert ear.wait("map")["hash"] == merged.hash
    decision = session.state.decisions[FIRST]
    assert decision.T_1_2 is not None
    assert merged.components[0].poses[ScanId(0, 0)] == Pose2.identity()
    assert merged.components[0].poses[ScanId(0, 1)].distance(decision.T_1_2) == pytest.approx((0.0, 0.0))
    session.undo()
    assert session.merged(PATIENCE).components == ()


def test_opening_a_project_twice_gives_the_same_map(open_session: Open) -> None:
    """However the decisions came about, one by one or all at once, replay gives the same hash."""
    session = _settled(open_session())
    for name in reversed(session.integrations):
        session.decide([name], "accepted")
    first = session.merged(PATIENCE).hash
    assert first
    assert open_session().merged(PATIENCE).hash == first
    assert open_session().merged(PATIENCE).hash == first


def test_decisions_hold_under_other_parameters(session: Session) -> None:
    """The pose accepted stays; the map is fused again with the new parameters, not with the threshold."""
    session.decide(session.integrations, "accepted")
    poses = {name: decision.T_1_2 for name, decision in session.state.decisions.items()}
    first = session.merged(PATIENCE)
    session.set_parameters({"value_threshold": 50.0})
    assert session.merged(PATIENCE).hash == first.hash
    session.set_parameters({"fusion_tolerance": 0.05, "split_tolerance": 0.06})
    assert session.merged(PATIENCE).hash != first.hash
    assert {name: decision.T_1_2 for name, decision in session.state.decisions.items()} == poses


def test_a_picture_is_kept_for_the_list(session: Session) -> None:
    """The map's picture is in the project as soon as there is a map, and goes with it."""
    assert session.picture == ""
    session.decide([FIRST], "accepted")
    session.merged(PATIENCE)
    assert session.picture.startswith("<svg")
    session.undo()
    session.merged(PATIENCE)
    assert session.picture == ""
