"""The HTTP API, in process: the whole road, and everything that should be refused on the way."""

from __future__ import annotations

import gzip
import io
import json
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.workspace import Workspace
from segmap.errors import SegmapError
from segmap.store import Store

FIRST, SECOND = "0.0-0.1", "0.1-0.2"
PATIENCE = 120.0


def failure(response: Any, status: int) -> str:
    """The message of a refused request, in the one shape all failures have."""
    assert response.status_code == status, response.text
    error = response.json()["error"]
    assert set(error) == {"message", "kind"}
    return str(error["message"])


def decide(client: Any, project: str, verdict: str, *ids: str, **more: Any) -> Any:
    return client.post(
        f"/api/projects/{project}/decisions", json={"integrations": list(ids), "verdict": verdict, **more}
    )


# --- the whole road -------------------------------------------------------------------------------


@pytest.mark.slow
def test_from_a_sample_to_an_exported_map_and_back_after_a_restart(make_client: Callable[..., Any]) -> None:
    """Create, match, look, decide, undo, export; after a restart everything decided is there, with the same map."""
    client = make_client()
    samples = client.get("/api/samples").json()["samples"]
    made = client.post("/api/projects", json={"sample": samples[0]["name"]})
    assert made.status_code == 201
    id = made.json()["id"]
    assert made.json()["url"] == f"/projects/{id}"
    url = f"/api/projects/{id}"
    session = client.settle(id)

    info = client.get(url).json()
    assert info["progress"]["done"] == info["counts"]["total"] == info["counts"]["pending"] + info["counts"]["none"]
    rows = client.get(f"{url}/integrations").json()["integrations"]
    assert len(rows) == info["counts"]["total"]
    pending = [row for row in rows if row["state"] == "pending"]
    doubts = [(row["verdict"] != "review", abs(row["confidence"] - info["threshold"])) for row in pending]
    assert doubts == sorted(doubts)

    above = [row["id"] for row in pending if row["above"]]
    revision = decide(client, id, "accepted", *above, who="Ada").json()["revision"]
    decide(client, id, "rejected", above[0], expected_revision=revision)
    undone = client.post(f"{url}/undo", json={}).json()
    assert undone["undone"] == f"rejected {above[0]}"
    assert session.settle(PATIENCE)

    exported = client.get(f"{url}/export/geojson")
    assert exported.headers["content-type"] == "application/geo+json"
    assert len(exported.json()["features"]) > 10
    assert ElementTree.fromstring(client.get(f"{url}/export/svg").content).tag.endswith("svg")
    all_formats(client, url)
    before = client.get(url).json()
    assert before["counts"]["accepted"] == len(above)
    assert (
        sum(len(part["scans"]) for part in before["components"]) + len(before["unplaced"]) == before["logs"][0]["scans"]
    )

    client = make_client()
    client.settle(id)
    after = client.get(url).json()
    assert {**after, "progress": None} == {**before, "progress": None}
    assert client.get(f"{url}/export/geojson").content == exported.content
    listed = client.get("/api/projects").json()["projects"]
    assert [(entry["id"], entry["integrations"]["accepted"]) for entry in listed] == [(id, len(above))]


def all_formats(client: Any, url: str) -> None:
    """Whatever the page offers is saved under the project's name; several files come as one archive."""
    offered = client.get("/api/exports").json()["formats"]
    assert {"ros", "dxf", "svg", "png", "geojson", "csv", "tum"} <= {format["name"] for format in offered}
    for format in offered:
        saved = client.get(f"{url}/export/{format['name']}")
        assert saved.status_code == 200
        assert saved.content
        assert "attachment" in saved.headers["content-disposition"]
    archive = zipfile.ZipFile(io.BytesIO(client.get(f"{url}/export/ros?resolution=0.25").content))
    (yaml, *_), images = ([n for n in archive.namelist() if n.endswith(end)] for end in (".yaml", ".pgm"))
    assert images
    assert b"resolution: 0.25\n" in archive.read(yaml)
    for wrong in ("0", "-1", "nan", "1e9", "fine"):
        assert client.get(f"{url}/export/ros?resolution={wrong}").status_code == 422


def test_a_project_of_several_logs(client: Any, log_bytes: bytes) -> None:
    """Each file is a log of its own; pairs are made within logs; gzip is taken off."""
    made = client.upload(("a.log", log_bytes), ("b.log.gz", gzip.compress(log_bytes))).json()
    assert made["name"] == "a and 1 more"
    session = client.session(made["id"])
    assert [(log.name, log.scans) for log in session.state.logs] == [("a.log", 7), ("b.log.gz", 7)]
    assert len(session.integrations) == 12


def test_a_project_file_goes_out_and_comes_in(client: Any, project: str) -> None:
    """The downloaded file, uploaded again, is the same project with the same decisions under a new id."""
    decide(client, project, "accepted", FIRST)
    file = client.get(f"/api/projects/{project}/download")
    assert file.content.startswith(b"SQLite format 3")
    assert "robot.segmap" in file.headers["content-disposition"]
    copied = client.upload(("copy.segmap", file.content)).json()
    assert copied["id"] != project
    assert client.get(f"/api/projects/{copied['id']}").json()["counts"]["accepted"] == 1


def test_one_integration_in_full(client: Any, project: str) -> None:
    """Candidates, chains, and every heuristic that was tried on the pair."""
    url = f"/api/projects/{project}/integrations/{FIRST}"
    detail = client.get(url).json()
    assert detail["match"]["ranked"][0]["value"] == detail["row"]["value"]
    assert [found["heuristic"] for found in detail["heuristics"]] == ["automatic"]
    assert client.get(url, params={"heuristic": "histogram"}).json()["match"] is None  # asked for by asking
    client.settle(project)
    detail = client.get(url, params={"heuristic": "histogram"}).json()
    assert detail["match"]["heuristic"] == "histogram"
    assert [found["heuristic"] for found in detail["heuristics"]] == ["automatic", "histogram"]


def test_a_conflict_is_answered_with_409(client: Any, project: str) -> None:
    """The second of two conflicting decisions is told who was first."""
    revision = client.get(f"/api/projects/{project}").json()["revision"]
    assert decide(client, project, "accepted", FIRST, who="Ada", expected_revision=revision).status_code == 200
    assert decide(client, project, "accepted", FIRST, who="Ada", expected_revision=revision).status_code == 200
    late = decide(client, project, "rejected", FIRST, who="Bob", expected_revision=revision)
    assert "Ada" in failure(late, 409)
    assert late.json()["error"]["kind"] == "ConflictError"


def test_decisions_answer_with_their_rows(client: Any, project: str) -> None:
    """The page can show the new state without asking again; undecided takes a decision back."""
    made = decide(client, project, "accepted", FIRST, candidate=1, reason="a wall & a door", who="Ada").json()
    row = made["rows"][0]
    assert (row["id"], row["state"], row["who"], row["reason"]) == (FIRST, "accepted", "Ada", "a wall & a door")
    assert made["undo"] == f"accepted {FIRST}"
    made = decide(client, project, "undecided", FIRST).json()
    assert made["rows"][0]["state"] == "pending"


@pytest.mark.slow
def test_the_threshold_and_the_parameters(client: Any, project: str) -> None:
    """A threshold is tried, then set; a preset, a heuristic and single parameters are set in one request."""
    url = f"/api/projects/{project}"
    assert client.post(f"{url}/parameters", json={"mode": "paper"}).status_code == 200
    client.settle(project)
    flips = client.get(f"{url}/threshold", params={"value": 0.0}).json()
    rows = client.get(f"{url}/integrations").json()["integrations"]
    assert set(flips["would_pass"]) == {row["id"] for row in rows if row["state"] == "pending" and not row["above"]}
    body = {"preset": "paper-lab", "changes": {"value_threshold": 0}, "heuristic": "histogram"}
    assert client.post(f"{url}/parameters", json=body).status_code == 200
    info = client.get(url).json()
    assert (info["parameters"]["max_range"], info["threshold"], info["heuristic"]) == (8.0, 0.0, "histogram")
    described = client.get("/api/parameters").json()
    assert {entry["name"] for entry in described["parameters"]} == set(info["parameters"])
    assert described["presets"]["paper-lab"]["max_range"] == 8.0


def test_new_projects_are_verified_and_can_be_as_the_paper(client: Any, project: str) -> None:
    """Mode, heuristics, criterion and threshold go together; the threshold is tried on the mode's quantity."""
    url = f"/api/projects/{project}"
    info = client.get(url).json()
    assert (info["mode"], info["modes"], info["heuristic"]) == ("verified", ["paper", "verified"], "automatic")
    assert info["heuristics"] == ["automatic", "all", "consecutive", "random", "histogram", "extremes"]
    assert (info["threshold"], info["parameters"]["value_threshold"]) == (0.9, 0.5)
    told = info["criterion"]
    assert (told["parameter"], told["quantity"], told["unit"], told["maximum"], told["step"]) == (
        "confidence_accept",
        "confidence",
        "",
        1.0,
        0.01,
    )
    failing = client.get(f"{url}/threshold", params={"value": 1.0}).json()["would_fail"]
    rows = client.get(f"{url}/integrations").json()["integrations"]
    assert set(failing) == {row["id"] for row in rows if row["above"] and row["confidence"] < 1.0}
    assert "confidence_accept" in failure(client.get(f"{url}/threshold", params={"value": 1.5}), 400)
    assert client.post(f"{url}/parameters", json={"mode": "paper"}).status_code == 200
    client.settle(project)
    info = client.get(url).json()
    assert (info["mode"], info["heuristic"], info["threshold"]) == ("paper", "all", 4.0)
    assert info["heuristics"] == ["all", "consecutive", "random", "histogram"]
    assert (info["criterion"]["quantity"], info["criterion"]["unit"]) == ("value", "m")
    row = client.get(f"{url}/integrations/{FIRST}").json()["row"]
    assert (row["confidence"], row["score"], row["above"]) == (None, None, row["value"] > 4.0)


def test_matching_is_stopped_and_resumed(make_client: Callable[..., Any], finder: Any, log_bytes: bytes) -> None:
    """Cancel stops the search that runs; the page stays usable; resume does the rest."""
    finder.hold()
    client = make_client(workspace={"open_session": _with(finder)})
    url = f"/api/projects/{client.upload(('robot.log', log_bytes)).json()['id']}"
    client.get(url)
    finder.wait_until_asked()
    assert client.post(f"{url}/matching", json={"action": "cancel"}).json()["cancelled"] is True
    session = client.settle(url.rpartition("/")[2])
    assert (finder.stopped, session.progress.running) == (1, 0)
    assert "not been matched" in failure(decide(client, session.id, "accepted", FIRST), 400)
    finder.go()
    client.post(f"{url}/matching", json={"action": "resume"})
    client.settle(session.id)
    assert client.get(url).json()["progress"]["done"] == 6


def _with(finder: Any) -> Callable[..., Any]:
    from app.session import Session

    return lambda *positional, **named: Session(*positional, **named, find=finder)


def test_pictures(client: Any, project: str) -> None:
    """Samples have one; a project has one as soon as something is accepted. None can run a script."""
    for sample in client.get("/api/samples").json()["samples"]:
        answer = client.get(sample["picture"])
        assert ElementTree.fromstring(answer.content).tag.endswith("svg")
        assert "sandbox" in answer.headers["content-security-policy"]
    assert "no merged map" in failure(client.get(f"/api/projects/{project}/map.svg"), 404)
    decide(client, project, "accepted", FIRST)
    client.settle(project)
    assert client.get(f"/api/projects/{project}/map.svg").content.startswith(b"<svg")


def test_pages(client: Any, project: str) -> None:
    """Both pages and what they load are there; a page of a project that is gone says so itself."""
    for url in ("/", f"/projects/{project}", "/static/js/home.js"):
        assert client.get(url).status_code == 200
    gone = client.get("/projects/gone")
    assert gone.status_code == 404
    assert "text/html" in gone.headers["content-type"]


# --- what is refused ------------------------------------------------------------------------------


def test_files_that_are_no_logs(client: Any, log_bytes: bytes) -> None:
    """One sentence each, nothing is left behind, and the server goes on."""
    bomb = gzip.compress(b"FLASER " + b"0" * (64 << 20))
    database = Path(str(client.app.state.services.workspace.folder) + ".db")
    broken = _database(database) + b"garbage"
    for name, content in (
        ("garbage.log", bytes(range(256)) * 50),
        ("bomb.log.gz", bomb),
        ("page.html", b"<html><script>alert(1)</script></html>"),
        ("other.segmap", broken),
        ("cut.segmap", b"SQLite format 3\0" + b"\0" * 50),
    ):
        answer = client.upload((name, content))
        assert 400 <= answer.status_code < 500, (name, answer.text)
        failure(answer, answer.status_code)
    assert client.get("/api/projects").json() == {"projects": []}
    assert list(client.app.state.services.workspace.folder.iterdir()) == []
    assert client.upload(("robot.log", log_bytes)).status_code == 201


def _database(path: Path) -> bytes:
    import sqlite3
    from contextlib import closing

    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE notes (text TEXT)")
    return path.read_bytes()


def test_what_is_good_of_an_upload_is_kept(client: Any, log_bytes: bytes) -> None:
    """A truncated log, a log with a bad line, and a bad file beside a good one: told of, not lost."""
    cut = gzip.compress(log_bytes)[:-2000]
    made = client.upload(("cut.log.gz", cut)).json()
    assert made["problems"]
    assert 0 < client.session(made["id"]).state.logs[0].scans < 7
    lines = log_bytes.splitlines(keepends=True)
    bad = b"".join([*lines[:-1], b"FLASER 180 nonsense\n", lines[-1]])
    made = client.upload(("bad.log", bad), ("garbage.bin", b"\0\1\2" * 99)).json()
    assert len(made["problems"]) == 2
    info = client.get(f"/api/projects/{made['id']}").json()
    assert [(log["name"], log["scans"], len(log["problems"])) for log in info["logs"]] == [("bad.log", 7, 1)]


def test_an_empty_log_passes_through_every_layer(client: Any) -> None:
    """A project without scans can be opened, shown and looked at, and says why there is nothing."""
    made = client.upload(("empty.log", b"")).json()
    assert "empty" in made["problems"][0]
    info = client.get(f"/api/projects/{made['id']}").json()
    assert (info["counts"]["total"], info["components"]) == (0, [])
    assert info["progress"]["message"] == "There is nothing to match."
    assert client.get(f"/api/projects/{made['id']}/integrations").json()["integrations"] == []
    assert "nothing to export" in failure(client.get(f"/api/projects/{made['id']}/export/svg"), 400)
    view = client.post(f"/api/projects/{made['id']}/views").json()["id"]
    assert client.get(f"/api/views/{view}").json()["integration"] is None


def test_names_are_text_and_never_paths(client: Any, log_bytes: bytes) -> None:
    """A name with ../ or HTML in it is shown as text, and nothing is written outside the folder."""
    folder = client.app.state.services.workspace.folder
    around = set(folder.parent.rglob("*"))
    for name in (
        "../../../tmp/evil.log",
        "..\\..\\evil.log",
        "<img src=x onerror=alert(1)>.log",
        "\udcff.log",
        "/etc/passwd",
    ):
        made = client.upload((name.encode("utf-8", "replace").decode(), log_bytes)).json()
        assert "/" not in made["name"]
        assert made["id"].replace("-", "").isalnum()
        assert client.get(made["url"]).status_code == 200
        assert client.get(f"/api/projects/{made['id']}/download").status_code == 200
    written = {path.parent for path in set(folder.parent.rglob("*")) - around - {folder}}
    assert written == {folder}


def test_uploads_are_bounded(make_client: Callable[..., Any], log_bytes: bytes) -> None:
    """Too large by its declared length or by what really comes, too many files, or none: refused."""
    client = make_client(upload_bytes=100_000)
    assert "larger than" in failure(client.upload(("big.log", log_bytes * 50)), 413)

    async def endless() -> Any:
        yield b'--x\r\nContent-Disposition: form-data; name="files"; filename="a"\r\n\r\n'
        for _ in range(1000):
            yield b"0" * 10_000

    chunked = client.post(
        "/api/projects", content=endless(), headers={"content-type": "multipart/form-data; boundary=x"}
    )
    assert "larger than" in failure(chunked, 413)
    failure(client.upload(*[(f"{i}.log", b"x") for i in range(70)]), 400)
    assert "No file" in failure(client.post("/api/projects", files=[("other", ("a.log", log_bytes))]), 400)
    failure(client.post("/api/projects", content=b"--x", headers={"content-type": "multipart/form-data"}), 400)


def test_a_project_file_comes_alone(client: Any, project: str, log_bytes: bytes) -> None:
    """A project among logs is a misunderstanding; say so."""
    file = client.get(f"/api/projects/{project}/download").content
    assert "alone" in failure(client.upload(("p.segmap", file), ("a.log", log_bytes)), 400)


@pytest.mark.parametrize(
    "url",
    [
        "/api/projects/none",
        "/api/projects/none/integrations",
        "/api/projects/none/events",
        "/api/projects/none/download",
        "/api/projects/none/map.svg",
        "/api/projects/..%2F..%2Fetc%2Fpasswd",
        "/api/projects/%2e%2e",
        "/api/projects/" + "x" * 70,
        "/api/projects/A",
        "/api/projects/{project}/integrations/0.0-0.9",
        "/api/projects/{project}/integrations/nonsense",
        "/api/projects/{project}/export/dwg",
        "/api/projects/{project}/events?view=none",
        "/api/views/none",
        "/api/samples/none/picture.svg",
        "/api/nothing",
        "/static/none.js",
        "/static/..%2f..%2fpyproject.toml",
        "/static/../../pyproject.toml",
        "/views/none/scene/",
    ],
)
def test_what_is_not_there_is_404(client: Any, project: str, url: str) -> None:
    """In the one shape of failures, whatever was asked for."""
    failure(client.get(url.format(project=project)), 404)


@pytest.mark.parametrize("method", ["GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"])
def test_odd_addresses_are_refused_in_peace(client: Any, project: str, method: str) -> None:
    """Zero bytes, half characters, other methods, other hosts in the path: never a fault of ours."""
    for url in (
        "/static/%00",
        "/static/" + "a" * 5000,
        "/api/projects/%00",
        "/projects/%ff%fe",
        "/api/views/%00",
        "/views/none/scene/..%2f..%2fetc/passwd",
        "/api/samples/%00/picture.svg",
        f"/api/projects/{project}/integrations/%00",
        f"/api/projects/{project}/export/%00",
        f"/api/projects/{project}/events?view=%00",
        "//evil.example/",
        "/projects/",
        "/static",
    ):
        assert client.request(method, url).status_code < 500, url


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("decisions", {"integrations": [], "verdict": "accepted"}),
        ("decisions", {"integrations": [FIRST], "verdict": "perhaps"}),
        ("decisions", {"integrations": FIRST, "verdict": "accepted"}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "candidate": -1}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "candidate": 10**30}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "candidate": 10**6}),
        ("decisions", {"integrations": ["0.0-0.5"], "verdict": "accepted"}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "heuristic": "guess"}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "expected_revision": 10**9}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "who": "x" * 300}),
        ("decisions", {"integrations": [FIRST], "verdict": "accepted", "unknown": 1}),
        ("parameters", {"changes": {"value_threshold": "high"}}),
        ("parameters", {"changes": {"value_threshold": -1}}),
        ("parameters", {"changes": {"none": 1}}),
        ("parameters", {"preset": "none"}),
        ("parameters", {"heuristic": "guess"}),
        ("parameters", {"mode": "guess"}),
        ("parameters", {"mode": "paper", "heuristic": "extremes"}),
        ("parameters", {"changes": [1, 2]}),
        ("matching", {"action": "explode"}),
        ("undo", {"who": 7}),
        ("redo", {}),
        ("undo", {}),
    ],
)
def test_requests_that_make_no_sense(client: Any, project: str, path: str, body: dict[str, Any]) -> None:
    """A sentence that says what is wrong, and nothing has changed."""
    revision = client.session(project).state.revision
    answer = client.post(f"/api/projects/{project}/{path}", json=body)
    assert 400 <= answer.status_code < 500, answer.text
    assert failure(answer, answer.status_code)
    assert client.session(project).state.revision == revision


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"null",
        b'"text"',
        b"\xff\xfe",
        b'{"action": ' + b"9" * 5000 + b"}",
        b"[" * 20_000,
        b'{"sample": 1}',
    ],
)
def test_bodies_that_are_not_json(client: Any, project: str, content: bytes) -> None:
    """Whatever bytes come, the answer is a refusal in words."""
    for url in (f"/api/projects/{project}/matching", "/api/projects"):
        answer = client.post(url, content=content, headers={"content-type": "application/json"})
        assert 400 <= answer.status_code < 500, answer.text
        failure(answer, answer.status_code)


def test_text_no_file_can_hold(client: Any, project: str) -> None:
    """Half a character in a name or reason, or in what is echoed, is no reason to fall over."""
    body = b'{"integrations": ["0.0-0.1"], "verdict": "rejected", "who": "\\ud800", "reason": "\\u0000<b>"}'
    url = f"/api/projects/{project}/decisions"
    assert client.post(url, content=body, headers={"content-type": "application/json"}).status_code < 500
    echo = b'{"integrations": ["\\ud800"], "verdict": "rejected"}'
    failure(client.post(url, content=echo, headers={"content-type": "application/json"}), 422)
    assert "no heuristic" in failure(
        client.get(f"{url.removesuffix('/decisions')}/integrations/{FIRST}?heuristic=%ed%a0%80%00"), 400
    )
    assert client.get(f"/api/projects/{project}/integrations").status_code == 200


def test_a_threshold_must_be_a_number(client: Any, project: str) -> None:
    """NaN, infinity, text and nothing are none."""
    for value in ("nan", "inf", "-1", "x", ""):
        failure(client.get(f"/api/projects/{project}/threshold", params={"value": value}), 422)


def test_the_unexpected_is_told_shortly_and_logged(
    make_client: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fault of ours answers 500 with one sentence that gives nothing away; the server goes on."""

    def fault(self: Workspace) -> None:
        raise RuntimeError("secret detail")

    client = make_client()
    monkeypatch.setattr(Workspace, "summaries", fault)
    message = failure(client.get("/api/projects"), 500)
    assert "secret" not in message
    assert client.get("/api/samples").status_code == 200


def test_a_broken_project_file_does_not_hide_the_others(client: Any, project: str) -> None:
    """It is listed with the reason; opening it says the same."""
    folder = client.app.state.services.workspace.folder
    (folder / "broken.segmap").write_bytes(b"SQLite format 3\0 and no more")
    listed = {entry["id"]: entry for entry in client.get("/api/projects").json()["projects"]}
    assert set(listed) == {project, "broken"}
    assert "damaged" in listed["broken"]["problem"]
    assert "damaged" in failure(client.get("/api/projects/broken"), 400)


# --- views ----------------------------------------------------------------------------------------


def test_a_view_is_opened_steered_and_closed(client: Any, project: str) -> None:
    """Every action answers with what the view shows; an unknown one with what there is."""
    opened = client.post(f"/api/projects/{project}/views").json()
    url = f"/api/views/{opened['id']}"
    assert opened["scene"] == f"/views/{opened['id']}/scene/"
    assert client.post(url, json={"action": "select", "value": SECOND}).json()["integration"] == SECOND
    assert client.post(url, json={"action": "next_candidate"}).json()["candidate"] == 1
    accepted = client.post(url, json={"action": "accept", "value": SECOND}).json()
    assert accepted["integration"] != SECOND
    assert client.session(project).state.decisions[SECOND].candidate == 1
    assert "no action" in failure(client.post(url, json={"action": "explode"}), 400)
    failure(client.post(url, json={"action": "select", "value": 7}), 400)
    failure(client.post(url, json={"action": "select", "value": "none"}), 404)
    assert client.delete(url).json() == {}
    assert client.delete(url).status_code == 200
    failure(client.get(url), 404)


def test_the_openapi_description_is_complete(client: Any) -> None:
    """Every route is described; the description can be made."""
    paths = client.get("/api/openapi.json").json()["paths"]
    assert {"/api/projects", "/api/projects/{project}/decisions", "/api/views/{view}"} <= set(paths)


def test_serving_a_log_again_reopens_its_project(tmp_path: Path, log_bytes: bytes) -> None:
    """Found by content, whatever the file is called; other content is another project."""
    first, renamed, other = (tmp_path / name for name in ("a.log", "b.log", "c.log"))
    first.write_bytes(log_bytes)
    renamed.write_bytes(log_bytes)
    other.write_bytes(log_bytes + b"\n# more\n")
    workspace = Workspace(tmp_path / "projects")
    id = workspace.open_files([first])
    assert workspace.open_files([renamed]) == id
    assert workspace.open_files([other]) != id
    assert workspace.open_files([first, other]) not in (id, None)
    with pytest.raises(SegmapError, match=r"none\.log cannot be opened"):
        workspace.open_files([tmp_path / "none.log"])
    workspace.close()


def test_a_project_file_is_opened_where_it_lies(tmp_path: Path, project_file: Path) -> None:
    """It is not copied, keeps its id over restarts, and is listed while it is open."""
    workspace = Workspace(tmp_path / "projects")
    id = workspace.open_files([project_file])
    assert workspace.session(id).state.name == "Seven scans"
    workspace.session(id).decide(["0.3-0.4"], "rejected")
    assert [summary.id for summary in workspace.summaries()] == [id]
    workspace.close()
    with Store.open(project_file) as store:
        assert set(store.state.decisions) == {"0.3-0.4"}
    assert Workspace(tmp_path / "projects").open_files([project_file]) == id


def test_json_of_a_row_is_json(client: Any, project: str) -> None:
    """Events and answers hold the same rows."""
    row = client.session(project).row(FIRST).to_json()
    answer = client.get(f"/api/projects/{project}/integrations/{FIRST}").json()
    assert json.loads(json.dumps(row)) == answer["row"]
