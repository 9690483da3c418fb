"""The scene without a browser: what is sent, who is let in, and what the panel says and does."""

from __future__ import annotations

import logging
import math
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import viser
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from app.drawing import STAGES
from app.resources import static_folder
from app.scene import Scene, markup
from app.scene.camera import FIELD_OF_VIEW, stand
from app.scene.panel import HERE, HOTKEYS
from app.session import Session
from app.workbench import View
from segmap.errors import ProjectError

PATIENCE = 60.0
HOSTILE = "<img src=x onerror=alert(1)>&\"'"


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@pytest.fixture
def view(session: Session) -> Iterator[View]:
    view = View(session, clock=lambda: 0.0)
    yield view
    view.close()


@pytest.fixture
def scene(view: View) -> Iterator[Scene]:
    scene = Scene(view)
    yield scene
    scene.close()


def at_rest(scene: Scene) -> None:
    """Wait until what the view shows is drawn."""
    until(lambda: not scene._stale.is_set() and scene._panel._step.content == markup.step(scene._view.snapshot()))


class Wire:
    """What is sent to browsers from now on."""

    def __init__(self, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sent: list[Any] = []
        server = scene._server._websock_server
        original = server.queue_message

        def queue(message: Any) -> None:
            self.sent.append(message)
            original(message)

        monkeypatch.setattr(server, "queue_message", queue)

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.sent if type(message).__name__ == kind]


# --- what is sent ---------------------------------------------------------------------------------


def test_another_candidate_moves_one_frame(scene: Scene, view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    """Position and heading of the second map's frame; no map is sent again, and little else."""
    view.set_stage("candidate")
    until(lambda: "/first/angle/segments" in scene._nodes._held)
    view.toggle_layer("angle")
    view.toggle_layer("rivals")
    until(lambda: scene._nodes._held["/first/angle/segments"][1].visible is False)
    at_rest(scene)
    wire = Wire(scene, monkeypatch)
    view.next_candidate()
    pose = view.picture().T_1_2
    until(lambda: tuple(scene._nodes._frames["second"].position) == (pose.x, pose.y, 0.0))
    until(lambda: wire.of("GuiUpdateMessage") != [])
    assert {message.name for message in wire.of("SetPositionMessage")} == {"/second"}
    updated = {message.name for message in wire.of("SceneNodeUpdateMessage")}
    assert not updated & {"/first/segments", "/second/segments", "/first/returns", "/second/returns"}
    assert not wire.of("LineSegmentsMessage")


def test_what_is_drawn_is_what_the_picture_says(scene: Scene, view: View) -> None:
    """For every stage and dimension: the same nodes, points and colours; everything else is hidden."""
    for stage in STAGES:
        for dimension in (2, 3):
            view.set_stage(stage)
            view.set_dimension(dimension)
            wanted = {drawable.path: drawable for drawable in view.picture().drawables}
            until(lambda w=wanted: {p for p, (_, h) in scene._nodes._held.items() if h.visible} == set(w))
            for path, drawable in wanted.items():
                handle: Any = scene._nodes._held[path][1]
                if drawable.kind == "lines":
                    until(lambda h=handle, d=drawable: np.array_equal(h.points, d.points))
                    assert tuple(handle.colors) == drawable.colour


def test_points_are_dots_of_their_colour(scene: Scene, view: View) -> None:
    """One very short line for each point, where the point is."""
    view.set_stage("scans")
    wanted = next(d for d in view.picture().drawables if d.path == "/first/returns")
    until(lambda: "/first/returns" in scene._nodes._held)
    handle: Any = scene._nodes._held["/first/returns"][1]
    assert np.allclose(handle.points.mean(axis=1), wanted.points, atol=1e-5)
    assert np.ptp(handle.points, axis=1).max() < 0.01


def test_a_scene_opened_again_shows_the_same(scene: Scene, view: View) -> None:
    """It owns no truth."""
    view.set_stage("fused")
    view.set_candidate(1)
    again = Scene(view)
    try:
        for one in (scene, again):
            until(lambda s=one: "/first/fused/1" in s._nodes._held)
            at_rest(one)
        shown = [{p for p, (_, h) in one._nodes._held.items() if h.visible} for one in (scene, again)]
        assert shown[0] == shown[1]
    finally:
        again.close()


# --- who is let in --------------------------------------------------------------------------------


def test_nobody_but_the_proxy_is_let_in(scene: Scene) -> None:
    """Whoever finds the port is told nothing; with the pass the scene arrives."""
    protocol = [Subprotocol(f"viser-v{viser.__version__}")]
    url = f"ws://127.0.0.1:{scene.port}"
    for headers in ({}, {"X-Segmap-Pass": "guessed"}, {"Origin": "http://evil.example"}):
        with connect(url, subprotocols=protocol, additional_headers=headers, proxy=None) as socket:
            with pytest.raises(ConnectionClosed) as caught:
                socket.recv(timeout=PATIENCE)
            assert caught.value.rcvd is not None
            assert caught.value.rcvd.code == 1008
    with connect(url, subprotocols=protocol, additional_headers=scene.headers, proxy=None, max_size=None) as socket:
        assert socket.recv(timeout=PATIENCE)


def test_it_listens_on_the_loopback_only(scene: Scene) -> None:
    """At a port the system chose."""
    assert scene._server.get_host() == "127.0.0.1"
    assert scene.port > 0


def test_no_tunnel_leads_outside(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A page that asks viser to share the scene with the world, as its own button would, gets nothing."""
    opened: list[Any] = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *given, **_: opened.append(given))
    asked: list[bool] = []
    original = scene._server.request_share_url
    monkeypatch.setattr(scene._server, "request_share_url", lambda: (original(), asked.append(True))[0])
    message = viser._messages.ShareUrlRequest()
    for handler in scene._server._websock_server._incoming_handlers[type(message)]:
        handler(0, message)  # type: ignore[arg-type]
    until(lambda: bool(asked))
    assert opened == []


def test_it_prints_nothing(view: View, capfd: pytest.CaptureFixture[str]) -> None:
    """The command line's output is its own."""
    scene = Scene(view)
    scene.close()
    scene.close()
    told = capfd.readouterr()
    assert (told.out, told.err) == ("", "")


# --- the panel ------------------------------------------------------------------------------------


def click(handle: Any, value: Any = True) -> None:
    """As a browser does: set the value, then call whoever listens."""
    handle._impl.value = value
    for callback in handle._impl.update_cb:
        callback(SimpleNamespace(target=handle, client=object(), client_id=0))


def test_the_buttons_do_what_they_say(scene: Scene, view: View, session: Session) -> None:
    """Accept, stages, dimensions, fit and layers reach the view, and the panel follows."""
    first = view.looks.integration
    click(scene._panel._accept)
    assert session.state.decisions[str(first)].verdict == "accepted"
    click(scene._panel._stages, "fused")
    assert view.looks.stage == "fused"
    until(lambda: HERE + "fused" in scene._panel._stages.options)
    click(scene._panel._stages, HERE + "fused")
    assert view.looks.stage == "fused"
    click(scene._panel._dimensions, "3D")
    assert view.looks.dimension == 3
    click(scene._panel._dimensions, "Fit")
    assert view.looks.fits == 1
    click(scene._panel._layers["grid"], False)
    assert not any(layer.name == "grid" and layer.visible for layer in view.picture().layers)


def test_the_panel_following_the_view_does_not_answer_it(scene: Scene, view: View) -> None:
    """A checkbox set by the panel itself switches nothing."""
    view.toggle_layer("chains")
    until(lambda: scene._panel._layers["chains"].value is False)
    looks = view.looks
    view.toggle_layer("chains")
    until(lambda: scene._panel._layers["chains"].value is True)
    assert len(view.looks.switched) == len(looks.switched) == 1


def test_what_goes_wrong_is_said_and_nothing_stops(
    scene: Scene, view: View, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sentence for what can be expected, the log for what cannot; the next click works."""
    told: list[tuple[str, str]] = []
    client = SimpleNamespace(add_notification=lambda title, body, **_: told.append((title, body)))
    monkeypatch.setattr(scene._server, "get_clients", lambda: {0: client})
    with caplog.at_level(logging.ERROR):
        scene._do(lambda: (_ for _ in ()).throw(ProjectError("There is nothing to undo.")))
        assert not caplog.records
        scene._do(lambda: (_ for _ in ()).throw(ZeroDivisionError()))
        assert len(caplog.records) == 1
    assert told[0][1] == "There is nothing to undo."
    assert "log" in told[1][1]
    monkeypatch.undo()
    scene._do(view.next_stage)


def test_hotkeys_are_the_pages_and_none_is_the_cameras() -> None:
    """The same keys in the page and in the scene; W A S D Q E and the arrows are taken."""
    keys = [(f"Shift+{key}" if modifier else key, action) for _, key, modifier, action in HOTKEYS]
    assert len({key for key, _ in keys}) == len(keys)
    assert not {key for key, _ in keys} & set("WASDQE")
    page = re.findall(r'\["([^"]+)", "[^"]+", "([a-z_]+)"\]', (static_folder() / "js" / "keys.js").read_text())
    assert set(keys) <= set(page)


# --- what the panel says --------------------------------------------------------------------------


class Tags(HTMLParser):
    """Collects the tags and the text of some HTML."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: Any) -> None:  # noqa: ARG002 (HTMLParser's signature)
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


PARTS = (
    markup.step,
    markup.value,
    markup.messages,
    markup.candidate,
    markup.heuristics,
    markup.picked,
    markup.legend,
)


def read(html: str) -> Tags:
    tags = Tags()
    tags.feed(html)
    return tags


def test_names_from_files_and_people_stay_text(view: View) -> None:
    """Every text of a snapshot replaced by hostile HTML: no tag of it is made."""

    def spoil(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: spoil(held, name) for name, held in value.items()}
        if isinstance(value, list):
            return [spoil(held, key) for held in value]
        return HOSTILE if isinstance(value, str) and key not in ("theme", "state", "quantity") else value

    view.set_picked("first", 0)
    snapshot = spoil({**view.snapshot(), "messages": ["said"]})
    for part in PARTS:
        assert "img" not in read(part(snapshot)).tags
    assert HOSTILE in read(markup.step(snapshot)).text
    assert "img" not in read(markup.exports(HOSTILE)).tags


def test_value_and_threshold_are_told_in_words(view: View) -> None:
    """Not by colour alone; a value at the threshold is not above it."""
    snapshot = view.snapshot()
    assert "not above the threshold" in read(markup.value({**snapshot, "value": 3.0, "above": False})).text
    assert "2.50 m above the threshold" in read(markup.value({**snapshot, "value": 2.5, "above": True})).text
    assert "No value yet" in read(markup.value({**snapshot, "value": None})).text


def test_confidence_and_evidence_are_told_in_words(view: View, session: Session) -> None:
    """Confidence against its threshold, the evidence in metres, the weakest direction; a rival is called one."""
    session.configure({}, mode="verified")
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    snapshot = view.snapshot()
    told = read(markup.value(snapshot)).text
    for words in (
        "confidence",
        "the threshold of 0.90",
        "m supported",
        "m contradicted",
        "m unseen",
        "weakest direction",
    ):
        assert words in told
    assert "0.95 confidence at or above" in read(markup.value({**snapshot, "confidence": 0.95, "above": True})).text
    doubtful = {**snapshot, "confidence": 0.95, "above": False, "verdict": "review", "reasons": ["A rival is close."]}
    assert "in doubt, though at or above" in read(markup.value(doubtful)).text
    assert "A rival is close." in read(markup.value(doubtful)).text
    assert "0.85 confidence below" in read(markup.value({**snapshot, "confidence": 0.85, "above": False})).text
    assert "Confidence" in read(markup.heuristics(snapshot)).text
    view.next_candidate()
    assert "less than the best" in read(markup.value(view.snapshot())).text


def test_heuristics_are_told_with_tries_time_and_value(view: View, session: Session) -> None:
    """Draws too where there are draws; dashes where nothing was tried."""
    session.request("0.0-0.1", "random")
    assert session.settle(PATIENCE)
    view.select("0.0-0.1")
    told = read(markup.heuristics(view.snapshot())).text
    assert "draws" in told
    assert "–" in told
    outcome = session.outcome("0.0-0.1", "all")
    assert outcome is not None
    assert f"{outcome.value:.2f}" in told


def test_no_pair_and_no_candidate_are_told(view: View) -> None:
    """An empty project's panel says what there is not."""
    nothing = {
        **view.snapshot(),
        **dict.fromkeys(
            ("row", "names", "candidate", "value", "pose", "angles", "above", "behind", "evidence", "picked")
        ),
        **{"heuristics": [], "layers": [], "messages": []},
    }
    told = " ".join(read(part(nothing)).text for part in PARTS)
    for words in ("No pair", "No candidate", "No value yet", "Click a segment", "switched off"):
        assert words in told


def test_zero_has_no_minus_sign(view: View) -> None:
    """Rounding does not leave one."""
    shown = {**view.snapshot(), "pose": {"x": -0.001, "y": -1.0, "theta": -0.0001}}
    assert "x 0.00 m, y −1.00 m, θ 0.0°" in read(markup.candidate(shown)).text


# --- the camera -----------------------------------------------------------------------------------

number = st.floats(-200.0, 200.0)
size = st.floats(0.0, 300.0)


@given(number, number, size, size, st.floats(0.3, 4.0), st.sampled_from([2, 3]))
def test_everything_is_in_sight(
    left: float, bottom: float, width: float, height: float, aspect: float, dimension: int
) -> None:
    """All corners of the box project into the window, whatever its shape."""
    position, look_at, up = (
        np.array(v) for v in stand((left, bottom, left + width, bottom + height), dimension, aspect)
    )
    forward = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    upward = np.cross(right, forward)
    tangent = math.tan(FIELD_OF_VIEW[dimension] / 2.0)
    for x in (left, left + width):
        for y in (bottom, bottom + height):
            seen = np.array([x, y, 0.0]) - position
            depth = seen @ forward
            assert depth > 0.0
            assert abs(seen @ upward) <= depth * tangent * 1.001
            assert abs(seen @ right) <= depth * tangent * aspect * 1.001


def test_something_else_to_look_at_is_brought_into_sight(scene: Scene, view: View, session: Session) -> None:
    """Another pair or stage moves the camera; another candidate of the pair leaves it where it is."""
    fitted: list[int] = []
    client = SimpleNamespace(client_id=0)
    cameras = scene._cameras
    cameras._server = SimpleNamespace(  # type: ignore[assignment]
        get_clients=lambda: {0: client}, initial_camera=scene._server.initial_camera
    )
    cameras.fit = lambda found: fitted.append(found.client_id)  # type: ignore[method-assign, assignment]
    picture = view.picture()
    cameras.follow(picture, 0)
    before = len(fitted)
    cameras.follow(replace(picture, T_1_2=picture.T_1_2.inverse()), 0)
    assert len(fitted) == before
    cameras.follow(replace(picture, subject=("another",)), 0)
    cameras.follow(replace(picture, subject=("another",), dimension=3), 0)
    cameras.follow(replace(picture, subject=("another",), dimension=3), 1)
    assert len(fitted) == before + 3
