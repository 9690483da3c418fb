"""Keeping projects, by the HTTP API in process: names, copies, deletions that can be undone, logs added later."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.creation import Source
from app.resources import samples_folder

FIRST = "0.0-0.1"
PATIENCE = 120.0


def listed(client: Any) -> dict[str, str]:
    """Names of the projects by id."""
    return {held["id"]: held["name"] for held in client.get("/api/projects").json()["projects"]}


def accept(client: Any, project: str, *ids: str) -> None:
    body = {"integrations": list(ids), "verdict": "accepted"}
    assert client.post(f"/api/projects/{project}/decisions", json=body).status_code == 200
    client.settle(project)


def add(client: Any, project: str, *files: tuple[str, bytes]) -> Any:
    return client.post(f"/api/projects/{project}/logs", files=[("files", file) for file in files])


def heard(client: Any, project: str) -> list[Any]:
    events: list[Any] = []
    client.session(project).subscribe(events.append)
    return events


@pytest.fixture(scope="session")
def other_log() -> bytes:
    """Another log, of three scans."""
    lines = (samples_folder() / "laboratory.log").read_bytes().splitlines(keepends=True)
    return b"".join([line for line in lines if line.startswith((b"FLASER", b"ROBOTLASER1"))][:3])


def test_rename(client: Any, project: str) -> None:
    """A project has the name it is given, open or not; pages are told, and it can be undone in it."""
    events = heard(client, project)
    renamed = client.request("PATCH", f"/api/projects/{project}", json={"name": "  <b>North wing</b> "})
    assert renamed.json()["name"] == "<b>North wing</b>"
    assert listed(client)[project] == "<b>North wing</b>"
    assert [event["name"] for event in events if event["type"] == "project"] == ["<b>North wing</b>"]
    client.post(f"/api/projects/{project}/undo", json={})
    assert listed(client)[project] == "robot"


def test_rename_of_a_project_nobody_has_open(make_client: Callable[..., Any], log_bytes: bytes) -> None:
    """The name is in the file, and nothing is opened or matched for it."""
    client = make_client()
    id = client.upload(("robot.log", log_bytes)).json()["id"]
    client = make_client()
    client.request("PATCH", f"/api/projects/{id}", json={"name": "Cellar"})
    assert listed(client) == {id: "Cellar"}
    assert client.app.state.services.workspace.open_session(id) is None


@pytest.mark.parametrize("name", ["", "   ", "x" * 300, 7, None])
def test_a_name_must_be_one(client: Any, project: str, name: Any) -> None:
    """No name, a name of blanks, or one too long is refused, and the old one kept."""
    answer = client.request("PATCH", f"/api/projects/{project}", json={"name": name})
    assert answer.status_code == 422
    assert listed(client)[project] == "robot"
    assert client.request("PATCH", "/api/projects/nowhere", json={"name": "x"}).status_code == 404


def test_duplicate(client: Any, project: str) -> None:
    """A copy has the same decisions and makes the same map; from then on the two go their own ways."""
    accept(client, project, FIRST)
    made = client.post(f"/api/projects/{project}/duplicate", json={})
    assert made.status_code == 201
    copy = made.json()["id"]
    assert listed(client) == {project: "robot", copy: "robot (copy)"}
    assert client.settle(copy).merged(PATIENCE).hash == client.session(project).merged(PATIENCE).hash
    accept(client, copy, "0.1-0.2")
    assert set(client.session(project).state.decisions) == {FIRST}
    named = client.post(f"/api/projects/{project}/duplicate", json={"name": "Second try"}).json()
    assert listed(client)[named["id"]] == "Second try"


def test_delete_and_have_it_back(make_client: Callable[..., Any], log_bytes: bytes) -> None:
    """A deleted project leaves the list, tells whoever looks at it, and comes back as it was, after a restart too."""
    client = make_client()
    id = client.upload(("robot.log", log_bytes)).json()["id"]
    client.settle(id)
    accept(client, id, FIRST)
    hash, events = client.session(id).merged(PATIENCE).hash, heard(client, id)
    view = client.post(f"/api/projects/{id}/views").json()["id"]
    deleted = client.delete(f"/api/projects/{id}").json()["projects"]
    assert [(held["id"], held["name"]) for held in deleted] == [(id, "robot")]
    assert events[-1] == {"type": "deleted"}
    assert listed(client) == {}
    for gone in (f"/api/projects/{id}", f"/projects/{id}", f"/api/views/{view}"):
        assert client.get(gone).status_code == 404
    client = make_client()
    assert client.post(f"/api/deleted/{id}/restore").json()["url"] == f"/projects/{id}"
    assert listed(client) == {id: "robot"}
    assert client.get("/api/deleted").json() == {"projects": []}
    assert client.settle(id).merged(PATIENCE).hash == hash


def test_removed_for_good(client: Any, project: str, tmp_path: Path) -> None:
    """Only a deleted project can be removed for good, and then no file of it is left."""
    assert client.delete(f"/api/deleted/{project}").status_code == 404
    client.delete(f"/api/projects/{project}")
    assert client.delete(f"/api/deleted/{project}").json() == {"projects": []}
    assert client.post(f"/api/deleted/{project}/restore").status_code == 404
    assert [path.name for path in (tmp_path / "projects").rglob("*.segmap*")] == []


@pytest.mark.parametrize("name", ["..%2Fproject", "nowhere", "a" * 200, ".deleted"])
def test_no_id_is_a_path(client: Any, project_file: Path, name: str) -> None:
    """Nothing outside the folder of projects is deleted, restored or removed."""
    for method, url in (("DELETE", "/api/projects/"), ("DELETE", "/api/deleted/"), ("POST", "/api/deleted/")):
        url += name + ("/restore" if method == "POST" else "")
        assert client.request(method, url).status_code == 404
    assert project_file.exists()


def test_a_project_that_lies_elsewhere(client: Any, project_file: Path) -> None:
    """Deleting it takes it off the list and leaves its file alone, also when it is removed for good."""
    workspace = client.app.state.services.workspace
    id = workspace.open_files([project_file])
    client.delete(f"/api/projects/{id}")
    assert listed(client) == {}
    client.post(f"/api/deleted/{id}/restore")
    assert listed(client) == {id: "Seven scans"}
    client.delete(f"/api/projects/{id}")
    client.delete(f"/api/deleted/{id}")
    assert project_file.exists()
    assert client.get("/api/deleted").json() == {"projects": []}


def test_a_damaged_project_can_be_put_away(client: Any, project: str, tmp_path: Path) -> None:
    """What cannot be read can be deleted, but neither renamed nor copied, and it says why."""
    client.session(project)
    path = tmp_path / "projects" / "broken.segmap"
    shutil.copyfile(tmp_path / "projects" / f"{project}.segmap", path)
    path.write_bytes(b"SQLite format 3\0" + bytes(200))
    copied = client.post("/api/projects/broken/duplicate", json={})
    assert copied.status_code == 400
    assert "broken" in copied.json()["error"]["message"]
    assert client.delete("/api/projects/broken").status_code == 200
    assert [held["problem"] != "" for held in client.get("/api/deleted").json()["projects"]] == [True]


def test_logs_added_later(client: Any, project: str, log_bytes: bytes, other_log: bytes) -> None:
    """More logs bring their pairs into the queue; what was decided stays, pages are told, a restart finds all."""
    accept(client, project, FIRST)
    events = heard(client, project)
    added = add(client, project, ("second.log", other_log)).json()
    assert (added["logs"], added["scans"], added["problems"]) == (["second.log"], 3, [])
    client.settle(project)
    info = client.get(f"/api/projects/{project}").json()
    assert [log["scans"] for log in info["logs"]] == [7, 3]
    assert (info["counts"]["total"], info["counts"]["accepted"]) == (8, 1)
    assert info["progress"]["done"] == 8
    assert [event["logs"] for event in events if event["type"] == "log"] == [["second.log"]]
    assert client.get(f"/api/projects/{project}/integrations/1.0-1.1").json()["match"] is not None
    again = add(client, project, ("other-name.log", other_log), ("robot.log", log_bytes))
    assert again.status_code == 400
    assert "in this project already" in again.json()["error"]["message"]


def test_a_project_that_begins_empty(client: Any, log_bytes: bytes) -> None:
    """A new project has a name and nothing else; a view of it shows the first pair once there are logs."""
    made = client.post("/api/projects", json={"name": "Empty <i>house</i>"})
    assert made.status_code == 201
    id = made.json()["id"]
    view = client.post(f"/api/projects/{id}/views").json()["id"]
    assert client.get(f"/api/views/{view}").json()["integration"] is None
    assert add(client, id, ("robot.log", log_bytes)).status_code == 200
    assert client.get(f"/api/views/{view}").json()["integration"] is not None
    client.settle(id)
    assert client.get(f"/api/projects/{id}").json()["counts"]["total"] == 6


def test_logs_that_are_none(client: Any, project: str, other_log: bytes) -> None:
    """A file that is no log is refused with its name; beside a good one it is left out and told of."""
    refused = add(client, project, ("holiday.jpg", b"\xff\xd8 nothing"))
    assert refused.status_code == 400
    assert "holiday.jpg" in refused.json()["error"]["message"]
    mixed = add(client, project, ("holiday.jpg", b"\xff\xd8 nothing"), ("second.log", other_log)).json()
    assert mixed["logs"] == ["second.log"]
    assert any("holiday.jpg" in problem for problem in mixed["problems"])
    assert client.post(f"/api/projects/{project}/logs").status_code == 422


def test_what_to_make_must_be_clear(client: Any) -> None:
    """A request for a new project that names neither a sample nor a name is refused in one sentence."""
    for body in ({}, {"name": " "}, {"sample": "hall", "name": "x"}, {"title": "x"}):
        answer = client.post("/api/projects", json=body)
        assert answer.status_code == 422, body
        assert answer.json()["error"]["message"]


def test_logs_are_read_before_anybody_waits(open_session: Callable[..., Any], other_log: bytes) -> None:
    """A session given logs directly has their scans at once, in the order they came."""
    import io

    session = open_session()
    session.add_logs([Source("second.log", io.BytesIO(other_log))], who="Ada")
    assert len(session.scan_ids) == 10
    assert session.segment_map(session.scan_ids[-1]).sources[0][0].log == 1
    assert session.settle(PATIENCE)
