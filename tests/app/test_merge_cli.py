"""``segmap merge`` by every method: what is tried, bridged, closed, cleaned, and refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.resources import samples_folder
from segmap.benchmark import is_right
from segmap.fusion import spurious_length
from segmap.logs import read_log
from segmap.merging import METHODS
from segmap.pose import Pose2
from segmap.segments import SegmentMap
from segmap.store import Store

OFFICE = samples_folder() / "office.log"
COUNT = len(read_log(OFFICE))

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def merged(run: Run) -> Callable[..., Any]:
    """The document of a merge of the office."""

    def merged(*arguments: object) -> Any:
        status, out, err = run("merge", OFFICE, "--stride", 4, *arguments, "--json")
        assert (status, err) == (0, "")
        return json.loads(out)

    return merged


def near_the_truth(document: Any) -> None:
    """Each scan lies where it should beside the one before it in its component."""
    rows = json.loads((samples_folder() / "office.truth.json").read_text())["sessions"][0]["poses"]
    truth = [Pose2(*row) for row in rows]
    for component in document["components"]:
        scans = {int(name.split(".")[1]): Pose2(**pose) for name, pose in component["scans"].items()}
        order = sorted(scans)
        for a, b in pairwise(order):
            assert is_right(scans[a].inverse() @ scans[b], truth[a].inverse() @ truth[b]), (a, b)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.slow
def test_every_method_merges_a_thinned_log(merged: Callable[..., Any], run: Run, method: str, tmp_path: Path) -> None:
    """Every fourth scan and what bridges them: placed truly or named; the steps are told, parts before the whole.

    A project replays to the map that was merged, but for the tree, which fuses its maps more than once.
    """
    told = merged("--method", method, "--project", tmp_path / "p.segmap")
    near_the_truth(told)
    taken = set(range(0, COUNT, 4))
    placed = {int(scan.split(".")[1]) for component in told["components"] for scan in component["scans"]}
    alone = {int(scan.split(".")[1]) for scan in told["alone"]}
    assert taken <= placed | alone
    bridges = placed - taken
    assert bridges
    flagged = [node for node in told["nodes"] if "bridged" in node.get("flags", [])]
    assert flagged
    assert told["method"] == method
    assert told["calls"] == len(told["integrations"])
    assert all(max(node["first"], node["second"]) < node["node"] for node in told["nodes"] if "first" in node)
    with Store.open(tmp_path / "p.segmap") as store:
        decided = store.state.decisions
    assert len(decided) == len(placed) - len(told["components"])
    replayed = run("replay", tmp_path / "p.segmap")
    assert replayed[::2] == (0, "")
    assert (replayed[1] == f"{told['hash']}\n") == (method != "tree")


def test_bridging_can_be_switched_off(merged: Callable[..., Any]) -> None:
    """Without it no scan is placed but every fourth, and there are no fewer components."""
    bridged, plain = merged(), merged("--set", "bridging=false")
    assert all(int(scan.split(".")[1]) % 4 == 0 for part in plain["components"] for scan in part["scans"])
    assert len(plain["components"]) + len(plain["alone"]) > len(bridged["components"]) + len(bridged["alone"])


def test_closing_is_told(run: Run) -> None:
    """The office is a loop: how far it is from closing, in the document and for people; joined or not, it is tried."""
    status, out, _ = run("merge", OFFICE, "--stride", 5, "--close", "--json")
    assert status == 0
    (closure,) = json.loads(out)["closures"]
    assert closure["pair"] == ["0.0", f"0.{COUNT - 1}"]
    assert closure["metres"] < 1.0
    assert closure["flags"] == ["closing"]
    status, out, _ = run("merge", OFFICE, "--stride", 5, "--close")
    assert status == 0
    assert "from closing" in out


def test_a_clean_map_has_no_doubles(merged: Callable[..., Any], tmp_path: Path) -> None:
    """The same scans and poses, walls once; the file holds the clean map and its hash."""
    plain, clean = merged("--out", tmp_path / "plain.geojson"), merged("--clean", "--out", tmp_path / "clean.geojson")
    assert [part["scans"] for part in plain["components"]] == [part["scans"] for part in clean["components"]]
    assert plain["hash"] != clean["hash"]
    assert sum(part["segments"] for part in clean["components"]) < sum(part["segments"] for part in plain["components"])
    doubles = []
    for name in ("plain", "clean"):
        document = json.loads((tmp_path / f"{name}.geojson").read_text())
        rows = [np.ravel(feature["geometry"]["coordinates"]) for feature in document["features"]]
        doubles.append(spurious_length(SegmentMap(np.array(rows))))
    assert doubles[1] < 0.1 * doubles[0]
    assert clean["hash"] in (tmp_path / "clean.geojson").read_text()


@pytest.mark.slow
def test_a_tree_of_many_scans_is_refused_or_asked_for(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """n (n - 1) / 2 calls: said with the remedy; at a terminal asked; allowed where it is asked for."""
    needed = COUNT * (COUNT - 1) // 2
    status, out, err = run("merge", OFFICE, "--method", "tree", "--most-calls", 100)
    assert (status, out) == (2, "")
    assert f"needs {needed} integrations" in err
    assert f"--most-calls {needed}" in err
    assert "--stride" in err
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    asked: list[str] = []
    monkeypatch.setattr("typer.confirm", lambda text, **_: asked.append(text))
    assert run("merge", OFFICE, "--method", "tree", "--most-calls", 100)[0] == 2
    assert str(needed) in asked[0]
    monkeypatch.undo()
    assert run("merge", OFFICE, "--method", "tree", "--stride", 30, "--most-calls", 3)[0] == 0


def test_a_stride_below_one_is_refused(run: Run) -> None:
    """As any bad usage."""
    assert run("merge", OFFICE, "--stride", 0)[0] == 2
