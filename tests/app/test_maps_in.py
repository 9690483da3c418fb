"""Segment maps from files in the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from app.cli import main
from app.resources import samples_folder

OFFICE = str(samples_folder() / "office.log")


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command in this process."""

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    return run


def test_integrate_takes_maps_in_place_of_scans(run: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    """Segments that were printed, put together as maps, integrate as the scans they came from do."""
    rows = [json.loads(run("segments", OFFICE, "--scan", scan, "--json")[1])["segments"] for scan in (7, 8)]
    maps = {"components": [{"name": f"scan {n}", "segments": held, "directed": True} for n, held in enumerate(rows)]}
    (tmp_path / "maps.json").write_text(json.dumps(maps))
    options = ("--mode", "paper", "--heuristic", "all", "--json")
    scans = json.loads(run("integrate", OFFICE, 7, 8, *options)[1])
    again = json.loads(run("integrate", tmp_path / "maps.json", 0, 1, *options)[1])
    assert again["segments"] == scans["segments"]
    assert again["value"] == pytest.approx(scans["value"], abs=0.5)
    assert math.dist(again["pose"].values(), scans["pose"].values()) < 0.1
    assert "holds maps 0 to 1" in run("integrate", tmp_path / "maps.json", 0, 2)[2]
