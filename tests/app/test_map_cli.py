"""``segmap map``: whole logs on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from app.resources import samples_folder
from segmap.logs import read_log, read_maps
from segmap.mapping import map_scans
from segmap.pose import Pose2

Run = Callable[..., tuple[int, str, str]]
LOGS = [samples_folder() / f"two-robots-{letter}.log" for letter in "ab"]
COUNT = sum(len(read_log(log)) for log in LOGS)


@pytest.fixture(scope="module")
def truth() -> dict[str, Pose2]:
    """Where every scan of both robots is, by its name."""
    sessions = json.loads((samples_folder() / "two-robots.truth.json").read_text())["sessions"]
    poses = {session["log"]: session["poses"] for session in sessions}
    return {f"{n}.{i}": Pose2(*pose) for n, log in enumerate(LOGS) for i, pose in enumerate(poses[log.name])}


@pytest.mark.slow
def test_two_logs_become_one_map_in_files_others_read(run: Run, tmp_path: Path, truth: dict[str, Pose2]) -> None:
    """Every scan is placed where it is; the map and the trajectory are written, and the document says the same."""
    drawing, segments, path = (tmp_path / name for name in ("map.svg", "map.geojson", "path.tum"))
    status, out, _ = run("map", *LOGS, "--out", drawing, "--out", segments, "--trajectory", path, "--json")
    document = json.loads(out)
    assert status == 0
    assert (document["scans"], document["placed"], document["alone"], document["weakly_held"]) == (COUNT, 1.0, [], {})
    (component,) = document["components"]
    first = truth["0.0"]
    for scan, pose in component["poses"].items():
        distance, turn = Pose2(*pose).distance(first.inverse() @ truth[scan])
        assert distance < 0.25
        assert turn < np.radians(5.0)
    assert {"accepted", "joined"} <= {link["why"] for link in document["links"]}
    assert not any(link["silenced"] for link in document["links"])
    assert ElementTree.parse(drawing).getroot().tag.endswith("svg")
    (held,) = read_maps(segments).parts
    assert held.map.lengths.sum() == pytest.approx(component["length"], rel=1e-3)
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    assert len(rows) == COUNT


@pytest.mark.slow
def test_without_json_it_tells_a_person(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """How many scans are where, what holds nothing, and what hangs on too little."""
    held = {}

    def doubted(maps: object, *rest: object, **options: object) -> object:
        whole = map_scans(maps, *rest, **options)  # type: ignore[arg-type]
        held.update(whole=whole)
        return whole

    monkeypatch.setattr("app.cli.mapping.map_scans", doubted)
    monkeypatch.setattr("segmap.holding.FIRM", ("tracked",))
    status, out, _ = run("map", samples_folder() / "hall.log", "--workers", 1)
    assert status == 0
    count = len(held["whole"].scans)
    assert f"keyframes of {count} scans" in out
    assert "component 1" in out
    assert "to be looked at: scan 0.56 hangs" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing.log"], "missing.log"),
        ([LOGS[0], "--out", "map.pdf"], "does not say its format"),
        ([LOGS[0], "--set", "max_range=-1"], "max_range"),
        ([LOGS[0], "--workers", 0], "workers"),
    ],
)
def test_what_cannot_be_mapped_is_told(run: Run, arguments: list[object], said: str) -> None:
    """In a line, with status 2, before anything is matched."""
    status, out, err = run("map", *arguments)
    assert (status, out) == (2, "")
    assert said in err
