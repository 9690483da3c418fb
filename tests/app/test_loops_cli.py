"""``segmap loops``: what it prints, what it puts into the project, and how it says no."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main
from app.resources import samples_folder
from segmap.integration import DEFAULT_HEURISTIC, DEFAULT_PRESET
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.store import Store

SCANS = 30


@pytest.fixture(scope="module")
def log() -> bytes:
    """The first scans of a drive that comes back."""
    lines = (samples_folder() / "office.log").read_bytes().splitlines(keepends=True)
    header = [line for line in lines if not line.startswith(b"FLASER")]
    scans = [line for line in lines if line.startswith(b"FLASER")]
    return b"".join(header + scans[:SCANS])


@pytest.fixture
def project(tmp_path: Path, log: bytes) -> Path:
    path = tmp_path / "office.segmap"
    settings = preset(DEFAULT_PRESET["verified"]), DEFAULT_HEURISTIC["verified"], "verified"
    with Store.create(path, "Office", *settings) as store:
        store.add_log("office.log", log, scans=SCANS, format="CARMEN")
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(stopped.value.code or 0), out, err


@pytest.mark.slow
def test_loops_are_found_told_and_kept(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each is where the scans truly were; they are in the queue afterwards, and undecided; again nothing is new."""
    status, out, err = run(capsys, "loops", project, "--workers", 1, "--json")
    assert (status, err) == (0, "")
    told = json.loads(out)
    assert told["new"] == len(told["closures"]) > 2
    assert told["others"] > 10 > told["revisits"] > 0
    assert told["silenced"] < 5  # a few lie 0.2 m or more from where all together have them
    truth = [Pose2(*pose) for pose in poses()]
    for closure in told["closures"]:
        i, j = (int(scan.partition(".")[2]) for scan in closure["id"].split("-"))
        found = Pose2(*(closure["pose"][name] for name in ("x", "y", "theta")))
        assert found.distance(truth[i].inverse() @ truth[j])[0] < 0.3
        assert closure["residual"]["translation"] < 0.3
    with Store.open(project) as store:
        assert set(store.state.proposals) == {closure["id"] for closure in told["closures"]}
        assert not store.state.decisions
    status, out, _ = run(capsys, "loops", project, "--workers", 1)
    assert status == 0
    assert out.splitlines()[0].split() == ["pair", "value", "[m]", "confidence", "residual", "judged"]
    assert len(out.splitlines()) == len(told["closures"]) + 3
    assert "0 are new in the queue." in out.splitlines()[-2]
    assert out.splitlines()[-1] == f"None is in the map before a person accepts it: segmap serve {project}"


@pytest.mark.slow
def test_every_closure_can_be_had_and_from_a_cluster(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Not only a few of each revisit; the same whoever does the work. A scheduler that is not there is said."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(1, processes=False, dashboard_address=None) as cluster:
        status, out, _ = run(capsys, "loops", project, "--dask", cluster.scheduler_address, "--all", "--json")
    every = json.loads(out)
    assert (status, every["others"]) == (0, 0)
    status, out, _ = run(capsys, "loops", project, "--workers", 1, "--json")
    few = json.loads(out)
    assert len(few["closures"]) + few["others"] == len(every["closures"])
    assert {one["id"] for one in few["closures"]} < {one["id"] for one in every["closures"]}
    assert (few["new"], few["revisits"]) == (0, every["revisits"])


@pytest.mark.parametrize("command", ["loops", "map"])
def test_a_cluster_that_is_not_there_is_said(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """In one line, by both commands that can use one."""
    pytest.importorskip("distributed")
    monkeypatch.setattr("app.cli.clusters.PATIENCE", "100ms")
    given = project if command == "loops" else samples_folder() / "hall.log"
    status, _, err = run(capsys, command, given, "--dask", "tcp://127.0.0.1:9")
    assert status == 2
    assert "no Dask scheduler at tcp://127.0.0.1:9" in err


def poses() -> list[list[float]]:
    """Where the sample's scans were taken."""
    document = json.loads((samples_folder() / "office.truth.json").read_text())
    return list(document["sessions"][0]["poses"])


@pytest.mark.slow
def test_loops_can_leave_the_project_alone(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With --no-keep nothing is written."""
    with Store.open(project) as store:
        before = store.state.revision
    assert run(capsys, "loops", project, "--workers", 1, "--no-keep")[0] == 0
    with Store.open(project) as store:
        assert store.state.revision == before


def test_nothing_to_search_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One line, no traceback."""
    Store.create(tmp_path / "empty.segmap", "Empty").close()
    status, _, err = run(capsys, "loops", tmp_path / "empty.segmap")
    assert status == 2
    assert "fewer than two scans" in err
