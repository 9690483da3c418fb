"""Laying the second scan by hand: dragged, or by its walls; judged, kept, decided on, undone, replayed, exported."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from app.errors import RequestError, UnknownError
from app.scene import Scene, markup
from app.scene.gizmo import Gizmo
from app.session import Session
from app.workbench import View
from segmap.errors import MapError
from segmap.evaluation import matching_values
from segmap.events import IntegrationId
from segmap.integration import match_maps
from segmap.placing import REACH
from segmap.pose import Pose2

PATIENCE = 120.0
AWAY = Pose2(0.12, -0.1, math.radians(3.0))
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(params=["paper", "verified"])
def verified(request: pytest.FixtureRequest, session: Session) -> Session:
    """The project in either mode, matched."""
    session.configure({}, mode=request.param)
    assert session.settle(PATIENCE)
    return session


@pytest.fixture
def view(verified: Session) -> Iterator[View]:
    now = iter(range(10**6))
    view = View(verified, who="Ann", clock=lambda: float(next(now)) * 10.0)
    yield view
    view.close()


def here(view: View) -> str:
    assert view.looks.integration is not None
    return view.looks.integration


def pose(shown: dict[str, Any]) -> Pose2:
    return Pose2(*(shown["pose"][name] for name in ("x", "y", "theta")))


def test_held_it_says_what_it_is_worth_and_let_go_it_settles(view: View, verified: Session) -> None:
    """While it is dragged nothing is kept; let go near the best candidate, it comes to rest on it, as a candidate."""
    best, revision = pose(view.snapshot()), verified.state.revision
    view.set_nudging(True)
    told = []
    for share in (1.0, 0.5):
        view.hold(best @ Pose2(share * AWAY.x, share * AWAY.y, share * AWAY.theta))
        shown = view.snapshot()
        assert (shown["held"], shown["candidate"], verified.state.revision) == (True, None, revision)
        told.append(shown["value"])
        assert told[-1] == pytest.approx(value_at(verified, here(view), pose(shown)))
        assert "held by hand" in markup.value(shown)
    assert told[0] != told[1]
    view.let_go()
    shown = view.snapshot()
    assert (shown["held"], shown["candidate"] is None, verified.state.revision) == (False, False, revision + 1)
    shift, turn = pose(shown).distance(best)
    assert shift < 0.05
    assert turn < math.radians(1.5)
    assert (shown["undo"], shown["evidence"] is None) == (f"laid {here(view)} by hand", verified.state.mode == "paper")
    view.undo()
    assert (view.snapshot()["origin"], view.snapshot()["candidate"]) == ("found", 0)
    assert not verified.state.proposals


def value_at(session: Session, integration: str, T_1_2: Pose2) -> float:
    """The value of a pose, from the library."""
    maps = [session.segment_map(scan) for scan in IntegrationId.parse(integration)]
    return float(matching_values(maps[0], maps[1], T_1_2, session.state.parameters)[1].sum())


def test_a_nudge_is_an_integration_like_any_other(
    view: View, verified: Session, open_session: Callable[..., Session], run: Run, tmp_path: Any
) -> None:
    """Accepted with its evidence, the same map bit for bit when replayed and when opened again, and in every export."""
    pair = here(view)
    view.set_nudging(True)
    view.hold(pose(view.snapshot()) @ Pose2(0.5 * REACH[0], 0.2, 0.05))
    view.let_go()
    laid = pose(view.snapshot())
    view.set_reason("glass wall")
    view.accept(pair)
    made = verified.state.decisions[pair]
    assert (made.verdict, made.T_1_2, made.origin, made.candidate) == ("accepted", laid, "nudged", None)
    assert (made.who, made.reason) == ("Ann", "glass wall")
    assert made.grounds is not None
    assert (made.grounds.score is None) == (verified.state.mode == "paper")
    assert made.grounds.candidates
    assert verified.row(pair).origin == "nudged"
    hashed = verified.merged(PATIENCE).hash
    path = verified._store.path
    view.close()
    again = open_session()
    assert again.merged(PATIENCE).hash == hashed
    assert again.state.proposals[pair].nudge is not None
    assert run("replay", path)[:2] == (0, f"{hashed}\n")
    file = tmp_path / "map.geojson"
    assert run("export", path, "--to", "geojson", "--out", file)[0] == 0
    assert {name for one in json.loads(file.read_text())["features"] for name in one["properties"]["integrations"]} == {
        pair
    }


def test_two_pairs_of_segments_lay_it(view: View, verified: Session) -> None:
    """Clicked one after the other; a second click on the same scan corrects, the last can be taken back."""
    candidate = verified.match(here(view)).best  # type: ignore[union-attr]
    maps = [verified.segment_map(scan) for scan in IntegrationId.parse(here(view))]
    pairs, values = matching_values(maps[0], maps[1], candidate.T_1_2, verified.state.parameters)
    first = max(range(len(pairs)), key=lambda k: values[k])
    headings = maps[0].headings[pairs[:, 0]]
    across = max(range(len(pairs)), key=lambda k: values[k] * abs(math.sin(headings[k] - headings[first])))
    (a, c), (b, d) = pairs[first].tolist(), pairs[across].tolist()
    view.set_stage("segments")
    view.act("toggle_nudging")
    for action in (
        {"source": "first", "segment": 0},
        {"source": "first", "segment": a},
        {"source": "second", "segment": c},
        {"source": "second", "segment": 0},
        None,
        {"source": "second", "segment": d},
    ):
        shown = view.act("lay", action)
        assert shown["messages"]
        assert not verified.state.proposals
    assert [pick["segment"] for pick in shown["laying"]] == [a, c, d]
    assert any(drawable.name == "laying/2" for drawable in view.picture().drawables)
    shown = view.act("lay", {"source": "first", "segment": b})
    nudge = verified.state.proposals[here(view)].nudge
    assert nudge is not None
    assert nudge.ties == ((a, c), (b, d))
    assert (shown["stage"], shown["laying"]) == ("candidate", [])
    assert max(pose(shown).distance(nudge.T_1_2)) < 1e-9
    shift, turn = pose(shown).distance(candidate.T_1_2)
    assert shift < 0.1
    assert turn < math.radians(2.0)


def test_what_is_proposed_anew_keeps_what_was_laid_by_hand(client: Any, project: str) -> None:
    """Over the API too: a pose or walls, not both; an import on the same pair leaves the nudge."""
    session, url = client.session(project), f"/api/projects/{project}"
    made = client.post(f"{url}/nudges", json={"integration": "0.1-0.2", "pose": [0.1, 0.0, 0.0], "who": "Bo"})
    assert made.status_code == 200, made.text
    detail = client.get(f"{url}/integrations/0.1-0.2").json()
    rank = detail["nudged"]
    assert rank == len(detail["match"]["ranked"]) - 1
    body = {"integrations": ["0.1-0.2"], "verdict": "accepted", "candidate": rank}
    assert client.post(f"{url}/decisions", json=body).json()["rows"][0]["origin"] == "nudged"
    for wrong in ({}, {"pose": [0, 0, 0], "ties": [[0, 0]]}, {"ties": [[999, 0]]}, {"pose": [1e6, 0, 0]}):
        assert client.post(f"{url}/nudges", json={"integration": "0.1-0.2", **wrong}).status_code == 400
    assert client.post(f"{url}/nudges", json={"integration": "0.1-0.99", "pose": [0, 0, 0]}).status_code == 404
    held = session.state.proposals["0.1-0.2"].nudge
    session.propose([session.state.proposals["0.1-0.2"].model_copy(update={"T_1_2": AWAY, "nudge": None})])
    assert session.state.proposals["0.1-0.2"].nudge == held
    assert session.state.proposals["0.1-0.2"].T_1_2 == AWAY
    assert [c.index for c in session.match("0.1-0.2").ranked[-2:]] == [-1, -2]


def test_where_nothing_is_found_a_person_can_lay_it(open_session: Callable[..., Session]) -> None:
    """Beside each other they stand until they are laid; then there is a candidate, which can be accepted."""

    def nothing(*maps: Any, **options: Any) -> Any:
        return replace(match_maps(*maps, **options), ranked=(), chains=())

    session = open_session(find=nothing)
    assert session.settle(PATIENCE)
    view = View(session)
    try:
        pair = here(view)
        assert (session.row(pair).state, view.snapshot()["candidates"]) == ("none", 0)
        view.set_nudging(True)
        view.hold(Pose2(0.1, 0.0, 0.0))
        assert view.snapshot()["held"]
        assert view.picture().drawables
        view.let_go()
        shown = view.snapshot()
        assert (shown["candidates"], shown["candidate"], shown["origin"]) == (1, 0, "nudged")
        view.accept()
        assert session.state.decisions[pair].origin == "nudged"
        assert session.row(pair).state == "accepted"
    finally:
        view.close()


@pytest.mark.parametrize(
    ("action", "value", "error"),
    [
        ("hold", {"x": 1.0}, RequestError),
        ("hold", {"x": math.nan, "y": 0.0, "theta": 0.0}, RequestError),
        ("hold", [1, 2, 3], RequestError),
        ("set_nudging", 1, RequestError),
        ("lay", {"source": "map", "segment": 0}, RequestError),
        ("lay", {"source": "first", "segment": True}, RequestError),
        ("select", "8.8-8.9", UnknownError),
    ],
)
def test_nonsense_moves_nothing(view: View, action: str, value: Any, error: type[Exception]) -> None:
    """With a sentence, and the view stays what it is."""
    view.set_nudging(True)
    before = view.looks
    with pytest.raises(error, match=r"\.$"):
        view.act(action, value)
    assert view.looks is before


def test_segments_that_are_not_there_lay_nothing(view: View, verified: Session) -> None:
    """As when the parameters changed between two clicks."""
    view.set_nudging(True)
    for source in ("first", "second", "first"):
        view.act("lay", {"source": source, "segment": 900})
    with pytest.raises(MapError):
        view.act("lay", {"source": "second", "segment": 0})
    assert not verified.state.proposals


def test_another_pair_ends_it(view: View) -> None:
    """What is held, or half laid, is let go of without a trace."""
    view.set_nudging(True)
    view.hold(Pose2(1.0, 1.0, 0.0))
    view.next()
    assert (view.looks.nudging, view.looks.held, view.looks.laying) == (False, None, ())
    view.hold(Pose2(1.0, 1.0, 0.0))
    assert view.looks.held is None
    view.let_go()
    assert "undo" in view.snapshot()


def test_the_gizmo_speaks_for_the_hand(view: View, verified: Session) -> None:
    """Its movements are followed in their order, the last one counts, and it waits where the map came to rest."""
    scene = Scene(view)
    try:
        gizmo: Gizmo = scene._gizmo
        view.act("toggle_nudging")
        until(lambda: gizmo._handle.visible)
        best = pose(view.snapshot())
        run_moves(gizmo, [best @ Pose2(0.02 * k, 0.0, 0.0) for k in range(5)])
        until(lambda: bool(verified.state.proposals) and not view.snapshot()["held"])
        assert len(verified.state.proposals) == 1
        rest = pose(view.snapshot())
        until(lambda: gizmo._handle.position[:2] == pytest.approx([rest.x, rest.y]))
        view.act("toggle_nudging")
        until(lambda: not gizmo._handle.visible)
    finally:
        scene.close()


def run_moves(gizmo: Gizmo, poses: list[Pose2]) -> None:
    """What viser tells of a drag."""
    for place, T_1_2 in enumerate(poses):
        wxyz = (math.cos(T_1_2.theta / 2.0), 0.0, 0.0, math.sin(T_1_2.theta / 2.0))
        target = SimpleNamespace(position=(T_1_2.x, T_1_2.y, 0.0), wxyz=wxyz)
        phase = "start" if place == 0 else "end" if place == len(poses) - 1 else "update"
        moved = gizmo._moved(SimpleNamespace(target=target, phase=phase))  # type: ignore[arg-type]
        with pytest.raises(StopIteration):
            moved.send(None)


def until(true: Callable[[], bool]) -> None:
    """Wait until something becomes true."""
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)
