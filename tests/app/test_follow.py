"""Following a view, by the HTTP API in process: what is told, what is not, and that nothing can be changed by it."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import pytest

from app.scene.panel import Onlookers


@pytest.fixture
def shared(client: Any, project: str) -> tuple[str, str]:
    """The id of a view and the address by which it is followed."""
    view = client.post(f"/api/projects/{project}/views").json()["id"]
    links = client.post(f"/api/views/{view}/share").json()
    assert links["steer"] == f"/projects/{project}?view={view}"
    return view, links["follow"]


def test_what_is_told(client: Any, shared: tuple[str, str]) -> None:
    """What is shown, by the project's name; never the view's id, by which it could be steered."""
    view, follow = shared
    told = client.get(f"{follow}/view")
    assert told.json()["project"] == "robot"
    assert told.json()["scene"] == f"{follow}/scene/"
    client.post(f"/api/views/{view}", json={"action": "set_stage", "value": "map"})
    shown = client.get(f"{follow}/view").json()["snapshot"]
    assert shown["stage"] == "map"
    assert set(shown) == {"serial", "integration", "names", "stage", "theme", "messages"}
    page = client.get(follow)
    assert page.status_code == 200
    assert view not in told.text + page.text


def test_events(client: Any, shared: tuple[str, str]) -> None:
    """Each change is told as it happens, without the view's id."""
    from app.routes.follow import _of_audience

    view, follow = shared
    heard: list[Any] = []
    opened = client.app.state.services.views.followed(follow.rpartition("/")[2])
    stop = _of_audience(opened)(heard.append)
    client.post(f"/api/views/{view}", json={"action": "next"})
    stop()
    client.post(f"/api/views/{view}", json={"action": "next"})
    assert [event["type"] for event in heard] == ["view"]
    assert view not in json.dumps(heard)


@pytest.mark.parametrize("path", ["", "/view", "/events", "/scene/", "/scene/x.js"])
@pytest.mark.parametrize("token", ["nothing", "", "%00", "a" * 300])
def test_no_name_no_view(client: Any, token: str, path: str) -> None:
    """A name nobody gave leads nowhere."""
    assert client.get(f"/follow/{token}{path}").status_code == 404


def test_the_name_does_not_steer(client: Any, shared: tuple[str, str]) -> None:
    """No address of a view answers to the name it is followed by, nor does following take anything but questions."""
    _, follow = shared
    token = follow.rpartition("/")[2]
    act = {"action": "next"}
    for answer in (
        client.post(f"/api/views/{token}", json=act),
        client.post(f"/api/views/{token}/share"),
        client.get(f"/api/views/{token}"),
        client.get(f"/views/{token}/scene/"),
    ):
        assert answer.status_code == 404
    for path in ("", "/view", "/events", "/scene/"):
        assert client.post(follow + path, json=act).status_code == 405


def test_following_needs_no_other_pass(make_client: Callable[..., Any], log_bytes: bytes) -> None:
    """Where the server asks for a token, who follows needs the link alone, and gets at nothing else with it."""
    client = make_client(token="t" * 24)
    key = {"Authorization": "Bearer " + "t" * 24}
    files = [("files", ("robot.log", log_bytes))]
    id = client.post("/api/projects", files=files, headers=key).json()["id"]
    view = client.post(f"/api/projects/{id}/views", headers=key).json()["id"]
    follow = client.post(f"/api/views/{view}/share", headers=key).json()["follow"]
    assert client.get(follow).status_code == 200
    assert client.get(f"{follow}/view").status_code == 200
    needed, page = ["/static/js/follow.js"], client.get(follow).text
    needed += re.findall(r'(?:href|src)="(/static/[^"#]+)', page)
    while needed:
        file = client.get(needed[0])
        assert file.status_code == 200, needed[0]
        needed = needed[1:] + [f"/static/js/{name}" for name in re.findall(r'from "\./(.+?)"', file.text)]
    for closed in (
        "/",
        "/api/projects",
        f"/api/projects/{id}",
        f"/api/views/{view}",
        "/follow",
        "/follow/../api/projects",
    ):
        assert client.get(closed).status_code in (401, 404), closed


def test_onlookers_have_nothing_to_press() -> None:
    """Their panel is made of words: no button, no command, no field."""

    class Gui:
        """Counts what is added."""

        def __init__(self) -> None:
            self.added: list[str] = []
            self.main_panel = self

        def __getattr__(self, name: str) -> Any:
            def add(*_: Any, **__: Any) -> Any:
                self.added.append(name)
                return _Handle()

            return add

    class _Handle:
        content = ""

        def __enter__(self) -> None: ...

        def __exit__(self, *_: object) -> None: ...

    gui = Gui()
    Onlookers(gui)  # type: ignore[arg-type]
    assert set(gui.added) == {"dock_right", "set_width", "add_html", "add_folder"}
