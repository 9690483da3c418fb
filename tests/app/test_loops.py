"""Pairs beyond neighbours: searched, imported, asked for by hand; and the pose graph of what is accepted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from joblib.externals.loky.process_executor import TerminatedWorkerError

from app.claims import CLAIMED
from app.errors import UnknownError
from app.graph_layers import TIES
from app.resources import samples_folder
from app.searching import find_closures
from app.session import Session
from app.workbench import View
from segmap.errors import CancelledError, ProjectError
from segmap.events import Proposal
from segmap.integration import match_maps
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.store import Store

PATIENCE = 120.0
FAR, FARTHER = "0.0-0.3", "0.1-0.6"
Open = Callable[..., Session]


@pytest.fixture(scope="session")
def log_bytes() -> bytes:
    """Seven scans that all see the same place."""
    lines = (samples_folder() / "laboratory.log").read_bytes().splitlines(keepends=True)
    header = [line for line in lines if not line.startswith(b"FLASER")]
    return b"".join(header + [line for line in lines if line.startswith(b"FLASER")][:7])


def manual(*ids: str) -> list[Proposal]:
    return [Proposal(integration=id, kind="manual") for id in ids]


def accept_all(session: Session) -> None:
    session.decide([row.id for row in session.rows() if row.state == "pending"], "accepted")
    assert session.settle(PATIENCE)


def wrong(session: Session, integration: str) -> Proposal:
    """A claim half a metre beside where a match has it, by somebody who is very sure."""
    match = session.match(integration)
    assert match is not None
    assert match.T_1_2 is not None
    beside = Pose2(0.5, 0.3, 0.0) @ match.T_1_2
    sure = ((1e-4, 0.0, 0.0), (0.0, 1e-4, 0.0), (0.0, 0.0, 1e-5))
    return Proposal(integration=integration, kind="imported", T_1_2=beside, covariance=sure, source="other.g2o")


# --- the queue ------------------------------------------------------------------------------------


def test_any_two_scans_can_be_asked_for(session: Session, open_session: Open) -> None:
    """They are matched, shown and decided as neighbours are, undone in one step, and there again after a restart."""
    change = session.propose(manual(FAR, FARTHER), who="Ada")
    assert change.integrations == (FAR, FARTHER)
    assert session.settle(PATIENCE)
    assert {row.id: row.kind for row in session.rows()}[FAR] == "manual"
    assert session.row(FAR).value is not None
    assert session.progress.done == session.progress.total == 8
    session.decide([FAR], "accepted")
    assert session.propose(manual(FAR), again=False).integrations == ()
    session = open_session()
    assert session.settle(PATIENCE)
    assert (session.row(FAR).state, session.row(FARTHER).state) == ("accepted", "pending")
    session.undo()
    assert session.undo().state.can_redo == "proposed 2 pairs"
    assert FAR not in session.integrations
    assert len(session.rows()) == session.progress.total == 6
    with pytest.raises(UnknownError, match="any more"):
        session.clear([FAR])
    session.redo()
    assert session.integrations.index(FAR) == 1


def test_pairs_that_cannot_be_are_refused(session: Session) -> None:
    """Scans that are not there, a scan with itself, the later one first."""
    for id in ("0.0-0.99", "1.0-1.1"):
        with pytest.raises(ProjectError, match="no scan"):
            session.propose(manual(id))
    for id in ("0.3-0.3", "0.3-0.1", "nonsense"):
        with pytest.raises(ProjectError, match="names no integration"):
            manual(id)
    assert session.integrations[-1] == "0.5-0.6"


def test_a_claimed_pose_is_a_candidate_beside_our_match(session: Session) -> None:
    """The last one, with a value and evidence of its own; accepted, it is recorded with the covariance claimed."""
    session.propose(manual(FAR))
    assert session.settle(PATIENCE)
    claim = wrong(session, FAR)
    own = session.match(FAR)
    session.propose([claim])
    match = session.match(FAR)
    assert own is not None
    assert match is not None
    assert match.ranked[:-1] == own.ranked
    assert (match.ranked[-1].T_1_2, match.ranked[-1].index) == (claim.T_1_2, CLAIMED)
    assert match.ranked[-1].value < match.value
    change = session.decide([FAR], "accepted", candidate=len(match.ranked) - 1)
    decision = change.state.decisions[FAR]
    assert (decision.T_1_2, decision.candidate, decision.covariance) == (claim.T_1_2, None, claim.covariance)


def test_decisions_say_how_well_their_pose_is_known(session: Session) -> None:
    """The covariance is in the history: the map can be made again without any match."""
    match = session.match(FIRST)
    assert match is not None
    assert match.best is not None
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    decision = session.decide([FIRST], "accepted").state.decisions[FIRST]
    assert decision.covariance is not None
    assert 0.02**2 <= decision.covariance[0][0] < 0.2**2


FIRST = "0.0-0.1"


# --- the graph ------------------------------------------------------------------------------------


def test_residuals_are_told_once_a_loop_is_closed(session: Session) -> None:
    """Every row whose scans hang together says how far it is from the graph; what is accepted, in deviations too."""
    accept_all(session)
    assert session.row(FIRST).residual == pytest.approx(0.0, abs=1e-9)
    session.propose(manual(FAR, FARTHER))
    assert session.settle(PATIENCE)
    pending = session.row(FAR)
    assert pending.residual is not None
    assert pending.residual < 0.2
    assert pending.chi is None
    told = session.loops.preview(FAR)
    assert told.loop is not None
    assert told.loop.scans == tuple(ScanId(0, i) for i in range(4))
    assert not told.joins
    session.decide([FAR], "accepted")
    assert session.settle(PATIENCE)
    closed = session.row(FAR)
    assert closed.chi is not None
    assert closed.residual is not None
    assert 0.0 < closed.residual < pending.residual
    assert not closed.silenced
    session.undo()
    assert session.settle(PATIENCE)
    assert session.row(FAR).chi is None


def test_the_map_is_where_the_graph_has_it(session: Session, project_file: Path) -> None:
    """A closed loop moves the scans of the merged map to the optimised poses, and a replay gives the same map."""
    accept_all(session)
    before = session.merged(PATIENCE)
    session.propose(manual(FAR))
    assert session.settle(PATIENCE)
    session.decide([FAR], "accepted")
    after = session.merged(PATIENCE)
    assert session.settle(PATIENCE)
    poses = session.loops.graph.optimised.poses
    for scan, pose in after.components[0].poses.items():
        assert max(pose.distance(poses[scan])) < 1e-9
    assert after.hash != before.hash
    again = Session("again", Store.open(project_file))
    assert again.merged(PATIENCE).hash == after.hash
    again.close()
    session.undo()
    assert session.merged(PATIENCE).hash == before.hash


def test_an_accepted_closure_that_contradicts_is_silenced_and_told(session: Session) -> None:
    """You accepted it, the optimiser silences it: in the preview, on the row and in the graph; the map stays."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    accept_all(session)
    session.propose(manual(FAR, FARTHER))
    assert session.settle(PATIENCE)
    session.decide([FAR, FARTHER], "accepted")
    before = session.merged(PATIENCE)
    assert session.settle(PATIENCE)
    claim = replace_id(wrong(session, FAR), "0.0-0.5", session)
    session.propose([claim])
    assert session.settle(PATIENCE)
    match = session.match("0.0-0.5")
    assert match is not None
    rank = len(match.ranked) - 1
    assert session.loops.preview("0.0-0.5", rank=rank).silenced
    session.decide(["0.0-0.5"], "accepted", candidate=rank)
    assert session.settle(PATIENCE)
    row = session.row("0.0-0.5")
    assert row.silenced
    assert row.chi is not None
    assert row.chi > 5.0
    told = session.loops.graph.to_json()["silenced"]
    assert [one["id"] for one in told] == ["0.0-0.5"]
    assert "the optimiser silences it" in told[0]["sentence"]
    for scan, pose in session.components()[0].poses.items():
        assert pose.distance(before.components[0].poses[scan])[0] < 0.01


def replace_id(claim: Proposal, integration: str, session: Session) -> Proposal:
    """A claim half a metre beside where the graph has another pair."""
    poses = session.loops.graph.optimised.poses
    T = Pose2(0.5, 0.3, 0.0) @ poses[ScanId(0, 0)].inverse() @ poses[ScanId(0, 5)]
    return claim.model_copy(update={"integration": integration, "T_1_2": T})


def test_the_graph_opens_in_gtsam(session: Session, project_file: Path, tmp_path: Path, run: Any) -> None:
    """What is accepted and believed, with its covariances and time stamps beside it: gtsam sees the same errors."""
    gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'segmap[graph]'")
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    accept_all(session)
    session.propose(manual(FAR, FARTHER))
    assert session.settle(PATIENCE)
    accept_all(session)
    session.propose([replace_id(wrong(session, FAR), "0.0-0.5", session)])
    assert session.settle(PATIENCE)
    match = session.match("0.0-0.5")
    assert match is not None
    session.decide(["0.0-0.5"], "accepted", candidate=len(match.ranked) - 1)
    assert session.settle(PATIENCE)
    graph = session.loops.graph
    assert [one.edge.name for one in graph.optimised.silenced] == ["0.0-0.5"]
    target = tmp_path / "curated.g2o"
    assert run("export", project_file, "--to", "g2o", "--out", target)[0] == 0
    theirs, values = gtsam.readG2o(str(target), False)
    assert (theirs.size(), values.size()) == (8, 7)
    for scan, pose in graph.optimised.poses.items():
        found = values.atPose2(scan.scan)
        assert (found.x(), found.y(), found.theta()) == pytest.approx(tuple(pose), abs=1e-9)
    errors = sorted(2.0 * theirs.at(i).error(values) for i in range(theirs.size()))
    believed = [one for one in graph.optimised.residuals if not one.silenced]
    assert errors == pytest.approx(sorted(one.chi**2 for one in believed), rel=1e-6, abs=1e-9)
    assert "1 accepted integrations that the others contradict" in target.read_text()
    stamps = (tmp_path / "curated.times.csv").read_text().splitlines()
    assert stamps[0] == "id,log,scan,time"
    assert [row.split(",")[3] for row in stamps[1:]] == [f"{session.scan(scan).time:.6f}" for scan in session.scan_ids]


def test_the_strength_of_a_component_is_told(session: Session) -> None:
    """A chain is all bridges; a closure takes them away from the scans it goes round."""
    accept_all(session)
    (chain,) = session.loops.graph.to_json()["strengths"]
    assert chain["bridges"] == [f"0.{i}-0.{i + 1}" for i in range(6)]
    session.propose(manual(FAR))
    assert session.settle(PATIENCE)
    session.decide([FAR], "accepted")
    assert session.settle(PATIENCE)
    (closed,) = session.loops.graph.to_json()["strengths"]
    assert closed["bridges"] == [f"0.{i}-0.{i + 1}" for i in range(3, 6)]
    assert closed["edges"] == 7


# --- the search -----------------------------------------------------------------------------------


def test_a_search_proposes_and_decides_nothing(open_session: Open, finder: Any) -> None:
    """What it finds are rows like others, matched already; again it finds nothing new; one undo takes all away."""
    session = open_session(search_workers=1, find=finder)
    session.configure({}, mode="verified")
    heard: list[Any] = []
    session.subscribe(heard.append)
    assert session.settle(PATIENCE)
    asked = len(finder.asked)
    session.loops.start()
    assert session.settle(PATIENCE)
    closures = [row for row in session.rows() if row.kind == "closure"]
    assert closures
    assert all(row.state == "pending" and row.confidence is not None for row in closures)
    assert len(finder.asked) == asked
    assert any(event["type"] == "search" and event["running"] for event in heard)
    assert f"{len(closures)} " in session.loops.progress.message
    assert not session.state.decisions
    revision = session.state.revision
    session.loops.start()
    assert session.settle(PATIENCE)
    assert session.state.revision == revision
    assert "0 are new" in session.loops.progress.message
    session.undo()
    assert all(row.kind == "neighbour" for row in session.rows())


def test_a_search_can_be_stopped(open_session: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is proposed then, it says so, and another can begin."""
    session = open_session(search_workers=1)
    assert session.settle(PATIENCE)
    started: list[int] = []

    def endless(maps: Any, parameters: Any, *, workers: int, progress: Any, check: Any, **_: Any) -> Any:
        started.append(workers)
        progress("tracking", 1, 7)
        while True:
            check()

    monkeypatch.setattr("app.searching.map_scans", endless)
    session.loops.start()
    session.loops.start()
    while not started:
        assert session.loops.progress.running
    session.loops.cancel()
    assert session.loops.settle(PATIENCE)
    assert started == [1]
    assert "was stopped" in session.loops.progress.message
    assert not session.state.proposals
    monkeypatch.undo()
    session.loops.start()
    assert session.loops.settle(PATIENCE)
    assert session.state.proposals


def test_a_search_that_was_stopped_goes_on_where_it_was(open_session: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it matched is in the project file, also for another program; nothing of it is matched twice, and the
    same is proposed as by a search that nobody stopped.
    """
    matched: list[int] = []
    stop_at = 9

    def counted(*maps: Any, **options: Any) -> Any:
        if len(matched) == stop_at:
            raise CancelledError("The work was stopped.")
        matched.append(1)
        return match_maps(*maps, **options)

    for module in ("keyframes", "spreading"):
        monkeypatch.setattr(f"segmap.{module}.match_maps", counted)
    session = open_session(search_workers=1)
    session.loops.start()
    assert session.loops.settle(PATIENCE)
    assert "What it matched is kept" in session.loops.progress.message
    stop_at = -1
    session = open_session(search_workers=1)
    session.loops.start()
    assert session.loops.settle(PATIENCE)
    total = len(matched)
    found = find_closures(session.state, session.scan_ids, session.extractor, workers=1)
    assert len(matched) == 2 * total
    assert session.state.proposals == {closure.integration: closure.proposal for closure in found.closures}


def test_what_the_search_matched_is_shown_also_while_matching_is_stopped(open_session: Open, finder: Any) -> None:
    """Whoever asks for a pair gets it at once."""
    session = open_session(search_workers=1, find=finder)
    session.cancel()
    session.configure({}, mode="verified")
    session.cancel()
    session.loops.start()
    assert session.loops.settle(PATIENCE)
    asked = len(finder.asked)
    session.request(FIRST)
    assert session.row(FIRST).state == "pending"
    assert len(finder.asked) == asked


def test_where_the_search_takes_another_candidate_that_one_is_decided_on(session: Session) -> None:
    """It is shown first, accepted unless another is asked for, and left to a person."""
    session.configure({}, mode="verified")
    session.propose(manual(FAR))
    assert session.settle(PATIENCE)
    match = session.match(FAR)
    assert match is not None
    other = match.ranked[1].T_1_2
    session.undo()
    session.propose([Proposal(integration=FAR, kind="closure", T_1_2=other, source="loop search")])
    assert session.settle(PATIENCE)
    assert (session.row(FAR).verdict, session.row(FAR).above) == ("review", False)
    view = View(session)
    view.select(FAR)
    assert view.snapshot()["candidate"] == session.suggested(FAR) == 1
    view.close()
    assert other == session.decide([FAR], "accepted").state.decisions[FAR].T_1_2
    assert session.decide([FAR], "accepted", candidate=0).state.decisions[FAR].T_1_2 == match.T_1_2


def test_a_search_that_fails_says_why(open_session: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a sentence; the session goes on."""
    session = open_session()

    for error, words in (
        (ProjectError("there is no moon tonight."), "failed: there is no moon tonight."),
        (TerminatedWorkerError("killed"), "ended from outside"),
        (ValueError("a bug"), "ValueError"),
    ):
        monkeypatch.setattr("app.searching.map_scans", Mock(side_effect=error))
        session.loops.start()
        assert session.loops.settle(PATIENCE)
        assert words in session.loops.progress.message
    assert session.settle(PATIENCE)


# --- over HTTP ------------------------------------------------------------------------------------


def g2o(*edges: tuple[int, int, Pose2]) -> bytes:
    """A pose graph of seven vertices."""
    vertices = [f"VERTEX_SE2 {i} {i} 0 0" for i in range(7)]
    lines = [f"EDGE_SE2 {a} {b} {T.x} {T.y} {T.theta} 400 0 0 400 0 1000" for a, b, T in edges]
    return "\n".join([*vertices, *lines, ""]).encode()


def test_a_pose_graph_is_imported_over_http(client: Any, project: str) -> None:
    """Its loop edges are rows with the pose they claim, told beside our match; edges of neighbours are left out."""
    url = f"/api/projects/{project}"
    graph = g2o((0, 1, Pose2(1.0, 0.0, 0.0)), (3, 0, Pose2(-1.0, 0.25, 0.1)), (2, 6, Pose2(2.0, 0.0, 0.0)))
    answer = client.post(f"{url}/graph", files={"file": ("other.g2o", graph)}).json()
    assert (answer["edges"], answer["loops"], answer["pairs"], answer["new"]) == (3, 2, 2, 2)
    client.settle(project)
    detail = client.get(f"{url}/integrations/{FAR}").json()
    assert (detail["row"]["kind"], detail["row"]["state"]) == ("imported", "pending")
    claimed = detail["match"]["ranked"][detail["claimed"]]["T_1_2"]
    T_0_3 = Pose2(-1.0, 0.25, 0.1).inverse()
    assert (claimed["x"], claimed["y"], claimed["theta"]) == pytest.approx(tuple(T_0_3))
    assert detail["told"][0].startswith("Imported from other.g2o; our own match is ")
    again = client.post(f"{url}/graph", files={"file": ("other.g2o", graph)}).json()
    assert again["new"] == 0
    assert client.post(f"{url}/undo", json={}).json()["undone"] == "proposed 2 imported edges"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"nothing of a graph", "holds no pose graph"),
        (g2o((0, 1, Pose2(1.0, 0.0, 0.0))), "none of these joins"),
        (b"VERTEX_SE2 900 0 0 0\nEDGE_SE2 900 950 1 0 0 1 0 0 1 0 1\n", "neither times nor ids tell"),
    ],
)
def test_a_pose_graph_that_says_nothing_is_refused(client: Any, project: str, content: bytes, words: str) -> None:
    """With what is wrong and what to do."""
    answer = client.post(f"/api/projects/{project}/graph", files={"file": ("x.g2o", content)})
    assert answer.status_code == 400, answer.text
    assert words in answer.json()["error"]["message"]


def test_pairs_and_previews_over_http(client: Any, project: str) -> None:
    """A pair asked for is matched; its preview says what accepting it would do."""
    url = f"/api/projects/{project}"
    made = client.post(f"{url}/pairs", json={"integrations": [FAR], "who": "Ada"}).json()
    assert [row["id"] for row in made["rows"]] == [FAR]
    session = client.settle(project)
    told = client.get(f"{url}/integrations/{FAR}/preview").json()
    assert told["joins"]
    assert told["residual"] is None
    accept_neighbours = [row.id for row in session.rows() if row.kind == "neighbour"]
    client.post(f"{url}/decisions", json={"integrations": accept_neighbours, "verdict": "accepted"})
    client.settle(project)
    told = client.get(f"{url}/integrations/{FAR}/preview?candidate=0").json()
    assert not told["joins"]
    assert told["loop"] == ["0.0", "0.1", "0.2", "0.3"]
    assert told["loop_error"] < 0.3
    assert any("closes a loop" in sentence for sentence in told["sentences"])
    assert client.get(f"{url}/integrations/{FAR}/preview?candidate=9999").status_code == 400
    unmatched = client.get(f"{url}/integrations/{FAR}/preview?heuristic=histogram")
    assert (unmatched.status_code, unmatched.json()) == (200, None)
    graph = client.get(url).json()["graph"]
    assert (graph["edges"], len(graph["strengths"]), graph["silenced"]) == (6, 1, [])
    for wrong_pair in ("0.0-0.99", "0.3-0.0", "x"):
        assert client.post(f"{url}/pairs", json={"integrations": [wrong_pair]}).status_code == 400


def test_the_search_over_http(client: Any, project: str) -> None:
    """Start, see how far it is, and find what it proposed."""
    url = f"/api/projects/{project}"
    client.session(project).loops._workers = 1
    assert client.post(f"{url}/loops", json={"action": "start"}).json()["running"]
    session = client.settle(project)
    assert any(row.kind == "closure" for row in session.rows())
    search = client.get(url).json()["search"]
    assert not search["running"]
    assert "1 loop closure is proposed, for 1 revisit" in search["message"]
    assert client.post(f"{url}/loops", json={"action": "cancel"}).json() == search
    assert client.post(f"{url}/loops", json={"action": "dance"}).status_code == 422


# --- the scene ------------------------------------------------------------------------------------


def test_a_click_on_a_line_of_the_map_selects_its_integration(session: Session) -> None:
    """Accepted ones are drawn by how far off they are, closures to be decided dashed; both can be clicked."""
    accept_all(session)
    session.propose(manual(FAR, FARTHER))
    assert session.settle(PATIENCE)
    session.decide([FAR], "accepted")
    assert session.settle(PATIENCE)
    view = View(session)
    view.set_stage("map")
    view.switch_layer("map", on=False)
    drawn = {drawable.name: drawable for drawable in view.picture().drawables if drawable.source == TIES}
    assert {"edges/0", "closures"} <= set(drawn)
    places = view.content().places
    for integration in (FARTHER, FAR):
        first, second = (places[ScanId(0, int(name[2:]))] for name in integration.split("-"))
        for share in np.linspace(0.1, 0.9, 33):  # where no other line is nearer
            view.pick(first.x + share * (second.x - first.x), first.y + share * (second.y - first.y), 0.05)
            if view.looks.integration == integration:
                break
        assert view.looks.integration == integration
        assert view.looks.stage == "map"
        assert any(d.name == "edges/selected" for d in view.picture().drawables)
    view.close()


def test_a_view_leaves_a_pair_that_is_taken_out_of_the_queue(session: Session) -> None:
    """Another person's undo does not leave it looking at nothing."""
    view = View(session)
    session.propose(manual(FAR))
    assert session.settle(PATIENCE)
    view.select(FAR)
    session.undo()
    assert view.looks.integration in session.integrations
    assert view.snapshot()["row"]["id"] == view.looks.integration
    view.close()
