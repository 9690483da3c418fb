"""``segmap benchmark pairs``: its keys, what failed and its pictures, repeats and brute force."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from app.cli import main
from app.resources import samples_folder
from segmap.pose import Pose2

DOCUMENTED = {"pairs", "success", "median_ms", "p95_ms", "accepted_right", "accepted_wrong", "review", "rejected"}
ADDED = {"among_first_three", "median_cpu_ms", "p95_cpu_ms", "brute_force_ratio", "brute_force_success"}

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run ``segmap benchmark pairs`` on the samples in this process: status, output, errors."""

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            main([*map(str, ("benchmark", "pairs", *arguments)), "--logs", str(samples_folder())])
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    return run


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    """Pairs of the laboratory: two as they are, one with a truth a metre off, one without a common wall."""
    truth = json.loads((samples_folder() / "laboratory.truth.json").read_text())
    poses = [Pose2(*row) for row in truth["sessions"][0]["poses"]]
    held: list[dict[str, Any]] = []
    for i, error in ((0, 0.0), (4, 0.0), (8, 1.0)):
        T = poses[i].inverse() @ poses[i + 1]
        held.append({"kind": "consecutive", "i": i, "j": i + 1, "x": T.x + error, "y": T.y, "theta": T.theta})
    file = tmp_path / "pairs.json"
    file.write_text(json.dumps({"log": "laboratory.log", "pairs": [*held, {"kind": "negative", "i": 0, "j": 40}]}))
    return file


def test_the_documented_keys_and_those_beside_them(run: Run, pairs: Path) -> None:
    """One document; what is not known is null; failures are listed with their scans."""
    status, out, err = run(pairs, "--json")
    assert (status, err) == (0, "")
    told = json.loads(out)
    (log,) = told["logs"]
    assert {"log", "kinds", "recall_at_zero_false_accepts"} <= set(log)
    positive, negative = log["kinds"]["consecutive"], log["kinds"]["negative"]
    assert set(positive) == set(negative) == DOCUMENTED | ADDED
    assert positive["success"] == positive["among_first_three"] == pytest.approx(2 / 3)
    assert negative["among_first_three"] is None
    assert positive["brute_force_ratio"] is None
    (failed,) = told["failures"]
    assert (failed["log"], failed["kind"], failed["i"], failed["j"]) == ("laboratory.log", "consecutive", 8, 9)
    assert failed["among_first_three"] is False
    kinds = [kind["median_cpu_ms"] for kind in log["kinds"].values()]
    assert min(kinds) <= told["cpu_milliseconds"]["median"] <= max(kinds)
    assert told["cpu_milliseconds"]["median"] <= told["cpu_milliseconds"]["95 %"]


@pytest.mark.slow
def test_failures_are_named_and_drawn(run: Run, pairs: Path, tmp_path: Path) -> None:
    """The text names the pair; its picture and a page that shows it are in the folder."""
    folder = tmp_path / "new" / "failures"
    status, out, _ = run(pairs, "--failures", folder)
    assert status == 0
    (line,) = [line for line in out.splitlines() if line.startswith("failed: ")]
    assert "laboratory.log, consecutive, scans 8 and 9: " in line
    assert "all kinds and logs together: median " in out
    assert "m and" in line
    (picture,) = folder.glob("*.svg")
    assert picture.name == "laboratory-consecutive-8-9.svg"
    assert ElementTree.parse(picture).getroot().tag.endswith("svg")
    assert picture.name in (folder / "index.html").read_text()
    assert "mean with the right one among the first 3 distinct rivals, consecutive: 66.7 %" in out


def test_a_folder_that_cannot_be_made_is_told_of(run: Run, pairs: Path) -> None:
    """One line, what and what to do."""
    status, _, err = run(pairs, "--failures", pairs)
    assert status == 2
    assert "cannot be made" in err
    assert err.count("\n") == 1


def test_brute_force_and_repeats(run: Run, pairs: Path) -> None:
    """A ratio for each kind, as text and as a number; fewer than one repeat is refused."""
    status, out, _ = run(pairs, "--mode", "paper", "--repeats", 2, "--brute", 1, "--json")
    assert status == 0
    kinds = json.loads(out)["logs"][0]["kinds"]
    assert all(kind["brute_force_ratio"] > 0.0 for kind in kinds.values())
    assert kinds["consecutive"]["brute_force_success"] == 1.0
    assert kinds["negative"]["brute_force_success"] is None
    _, out, _ = run(pairs, "--mode", "paper", "--brute", 1)
    assert "brute force, laboratory.log, consecutive: " in out
    assert run(pairs, "--repeats", 0)[0] == 2
