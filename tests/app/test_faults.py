"""Disks that are full, files that others hold, move or damage, clients that go, two servers: answered, nothing lost."""

from __future__ import annotations

import errno
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.errors import UnknownError
from app.resources import samples_folder
from app.session import Session
from app.workspace import Workspace
from segmap.errors import ProjectError
from segmap.store import Store

PATIENCE = 120.0
REJECT = {"integrations": ["0.0-0.1"], "verdict": "rejected"}


def sentence(answer: httpx.Response, status: int) -> str:
    """What a refused request is told."""
    assert answer.status_code == status, answer.text
    message = answer.json()["error"]["message"]
    assert message.endswith(".")
    assert "Traceback" not in message
    return str(message)


# --- disks ----------------------------------------------------------------------------------------


def test_a_decision_that_does_not_fit_is_not_acknowledged(client: Any, project: str) -> None:
    """On a full disk it is refused in a sentence and not in force; reading goes on, and with room again deciding."""
    session = client.session(project)
    before = session.state
    connection = session._store._connection
    pages = connection.execute("PRAGMA page_count").fetchone()[0]
    connection.execute(f"PRAGMA max_page_count = {pages}")
    url = f"/api/projects/{project}"
    long = {**REJECT, "reason": "x" * 9_999}
    answers = [client.post(f"{url}/decisions", json={**long, "reason": f"{k}{'x' * 9_990}"}) for k in range(30)]
    acknowledged = [answer.json()["revision"] for answer in answers if answer.status_code == 200]
    assert "disk is full" in sentence(answers[-1], 400)
    assert session.state.revision == max(acknowledged, default=before.revision)
    assert client.get(url).status_code == 200
    connection.execute("PRAGMA max_page_count = 1000000")
    assert client.post(f"{url}/decisions", json=REJECT).status_code == 200


def test_a_full_disk_while_files_come_in(client: Any, log_bytes: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Uploads, more logs and downloads are answered with what to do; nothing half-made stays."""
    project = client.upload(("robot.log", log_bytes)).json()["id"]

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("shutil.copyfileobj", full)
    monkeypatch.setattr("starlette.datastructures.UploadFile.write", full)
    url = f"/api/projects/{project}"
    for answer in (
        client.upload(("robot.log", log_bytes)),
        client.post(f"{url}/logs", files=[("files", ("more.log", log_bytes))]),
        client.post(f"{url}/graph", files={"file": ("graph.g2o", b"VERTEX_SE2 0 0 0 0")}),
    ):
        assert "disk is full" in sentence(answer, 507)
    monkeypatch.undo()
    folder = client.app.state.services.workspace.folder
    assert {path.name for path in folder.iterdir()} <= {f"{project}.segmap{end}" for end in ("", "-wal", "-shm")}
    assert client.upload(("robot.log", log_bytes)).status_code == 201


LIMITED = """
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), -1))
from app.server import serve
serve(workspace=Path(sys.argv[1]), port=0)
"""


@contextmanager
def served(*arguments: object, code: str, **environment: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """A server in a process of its own; its address and process."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}) as process:
        try:
            assert process.stderr is not None
            line = next(line for line in process.stderr if "segmap is at" in line)
            yield line.split()[3].rstrip("/"), process
        finally:
            process.kill()


@pytest.mark.slow
def test_a_system_that_lets_no_file_grow(tmp_path: Path) -> None:
    """Where the system really refuses to write, uploads are refused with a sentence and the server goes on."""
    log = (samples_folder() / "laboratory.log").read_bytes()
    with served(tmp_path / "projects", 100_000, code=LIMITED) as (url, _):
        answer = httpx.post(f"{url}/api/projects", files={"files": ("a.log", log * 8)}, timeout=PATIENCE)
        assert "disk" in sentence(answer, answer.status_code)
        assert answer.status_code in (400, 507)
        assert httpx.get(f"{url}/api/projects").json() == {"projects": []}
    assert list((tmp_path / "projects").iterdir()) == []


# --- files that others hold, move or damage -------------------------------------------------------


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Another program writes into a project and does not come to an end."""
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.rollback()
        other.close()


@pytest.fixture
def impatient(project_file: Path) -> Iterator[Session]:
    """The project, open, that waits for nobody."""
    session = Session("seven", Store.open(project_file, patience=0.01))
    assert session.settle(PATIENCE)
    yield session
    session.close()


def test_a_file_another_program_holds(impatient: Session, project_file: Path) -> None:
    """A decision is refused in a sentence and not in force; everything can be looked at; then work goes on."""
    before = impatient.state
    with locked(project_file):
        with pytest.raises(ProjectError, match="is being written by another program"):
            impatient.decide(["0.0-0.1"], "rejected")
        impatient.request("0.0-0.1", "random")
        assert impatient.settle(PATIENCE)
        assert impatient.match("0.0-0.1", "random") is not None  # it could not be kept in the file, and is there
        assert impatient.state is before
    impatient.decide(["0.0-0.1"], "rejected")
    assert impatient.state.revision == before.revision + 1


@pytest.mark.parametrize("how", ["moved", "replaced", "deleted"])
def test_a_file_that_goes_away_while_it_is_open(impatient: Session, project_file: Path, how: str) -> None:
    """What would go where nobody finds it is refused; put back, work goes on with all that was decided."""
    impatient.decide(["0.0-0.1"], "rejected")
    held, elsewhere = impatient.state, project_file.with_name("elsewhere.segmap")
    project_file.rename(elsewhere)
    if how == "replaced":
        shutil.copy(elsewhere, project_file)
    if how == "deleted":
        kept = elsewhere.read_bytes()
        elsewhere.unlink()
    with pytest.raises(ProjectError, match="was moved, replaced or deleted while it was open"):
        impatient.decide(["0.1-0.2"], "rejected")
    assert impatient.state is held
    if how == "deleted":
        assert kept.startswith(b"SQLite")
    else:
        elsewhere.replace(project_file)
        impatient.decide(["0.1-0.2"], "rejected")


def test_a_file_cut_off_while_it_is_open(client: Any, project: str) -> None:
    """Reading what is known goes on; writing is a sentence, never a traceback."""
    path = client.app.state.services.workspace.folder / f"{project}.segmap"
    client.session(project)._store._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    client.post(f"/api/projects/{project}/decisions", json=REJECT)
    os.truncate(path, 5000)
    answer = client.post(f"/api/projects/{project}/undo", json={})
    assert "cut off while it was open" in sentence(answer, 400)
    assert client.get(f"/api/projects/{project}").status_code == 200


@pytest.mark.parametrize(("change", "words"), [("newer", "update segmap"), ("cut", "cut off"), ("empty", "is empty")])
def test_a_file_that_cannot_be_opened(client: Any, project: str, change: str, words: str) -> None:
    """Newer or cut off, in the folder or as an upload: said what it is and what to do; the others stay in the list."""
    good = client.get(f"/api/projects/{project}/download").content
    bad = {"newer": good[:60] + (99).to_bytes(4, "big") + good[64:], "cut": good[: len(good) // 2], "empty": b""}[
        change
    ]
    folder = client.app.state.services.workspace.folder
    (folder / "bad.segmap").write_bytes(bad)
    assert words in sentence(client.get("/api/projects/bad"), 400)
    listed = {held["id"]: held["problem"] for held in client.get("/api/projects").json()["projects"]}
    assert listed[project] == ""
    assert words in listed["bad"]
    if bad:
        assert words in sentence(client.upload(("p.segmap", bad)), 400)
    assert {path.stem for path in folder.glob("*.segmap")} == {project, "bad"}


# --- clients and clocks ---------------------------------------------------------------------------

SERVE = "import sys; from pathlib import Path; from app.server import serve; serve(workspace=Path(sys.argv[1]), port=0)"


@pytest.mark.slow
def test_a_client_that_goes_in_the_middle_of_an_upload(tmp_path: Path, log_bytes: bytes) -> None:
    """Nothing of it is kept, no temporary file stays, and the next one is served."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    with served(tmp_path / "projects", code=SERVE, TMPDIR=str(temporary)) as (url, _):
        host, port = url.removeprefix("http://").split(":")
        head = (
            f"POST /api/projects HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length: 9000000\r\n"
            "Content-Type: multipart/form-data; boundary=x\r\n\r\n"
            '--x\r\nContent-Disposition: form-data; name="files"; filename="a.log"\r\n\r\n'
        )
        for _ in range(3):
            with socket.create_connection((host, int(port))) as connection:
                connection.sendall(head.encode() + log_bytes * 20)
        answer = httpx.post(f"{url}/api/projects", files={"files": ("robot.log", log_bytes)}, timeout=PATIENCE)
        assert answer.status_code == 201
        assert len(httpx.get(f"{url}/api/projects").json()["projects"]) == 1
        assert list(temporary.iterdir()) == []


def test_a_clock_that_goes_backwards(client: Any, project: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Decisions keep their order and are all in force; the list of projects and undo work as ever."""
    url = f"/api/projects/{project}"
    revisions = []
    for year, name in ((2026, "0.0-0.1"), (1999, "0.1-0.2"), (2031, "0.2-0.3"), (1970, "0.3-0.4")):
        monkeypatch.setattr("segmap.store._now", lambda year=year: f"{year}-01-01T00:00:00.000Z")
        body = {"integrations": [name], "verdict": "rejected"}
        revisions.append(client.post(f"{url}/decisions", json=body).json()["revision"])
    assert revisions == sorted(set(revisions))
    assert client.get(url).json()["counts"]["rejected"] == 4
    assert client.post(f"{url}/undo", json={}).json()["undone"] == "rejected 0.3-0.4"
    assert [held["id"] for held in client.get("/api/projects").json()["projects"]] == [project]


# --- two servers ----------------------------------------------------------------------------------


def test_two_servers_on_one_project(
    make_client: Callable[..., Any], client: Any, project: str, log_bytes: bytes
) -> None:
    """Each keeps what the other decided, tells of conflicts, and shows the other's steps and logs by itself."""
    other = Workspace(client.app.state.services.workspace.folder)
    try:
        here, there = client.session(project), other.session(project)
        heard: list[Any] = []
        there.subscribe(heard.append)
        seen = there.state.revision
        here.decide(["0.0-0.1"], "rejected", who="here")
        there.decide(["0.1-0.2"], "rejected", who="there")  # on top of what it has not seen
        assert {*there.state.decisions} == {"0.0-0.1", "0.1-0.2"}
        with pytest.raises(ProjectError, match=r"0\.0-0\.1"):
            there.clear(["0.0-0.1"], expected_revision=seen)
        here.add_logs([source("more.log", log_bytes + b"# another\n")])
        other.tend()
        assert here.state.revision == there.state.revision
        assert len(there.scan_ids) == 14
        assert {"decision", "log"} <= {event["type"] for event in heard}
        with Store.open(here._store.path) as store:
            assert {*store.state.decisions} == {"0.0-0.1", "0.1-0.2"}
    finally:
        other.close()


def source(name: str, content: bytes) -> Any:
    from io import BytesIO

    from app.creation import Source

    return Source(name, BytesIO(content))


def test_projects_nobody_looks_at_are_closed(client: Any, project: str) -> None:
    """Not those a page listens to or work is done on; asked for again, they are as they were."""
    workspace = client.app.state.services.workspace
    session = workspace.session(project)
    assert session.settle(PATIENCE)
    session.decide(["0.0-0.1"], "rejected")
    end = session.subscribe(lambda _: None)
    workspace.tend(idle_seconds=0.0)
    assert workspace.open_session(project) is session
    end()
    time.sleep(0.001)
    workspace.tend(idle_seconds=0.0)
    assert workspace.open_session(project) is None
    again = workspace.session(project)
    assert again is not session
    assert "0.0-0.1" in again.state.decisions
    with pytest.raises(UnknownError):
        workspace.session("none")
