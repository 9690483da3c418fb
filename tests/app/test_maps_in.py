"""Segment maps from files in the command line."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from app.resources import samples_folder
from segmap.logs import read_maps
from segmap.merging import Component, map_hash

OFFICE = str(samples_folder() / "office.log")


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


@pytest.mark.slow
def test_the_exported_map_of_a_project_comes_back_with_its_hash(
    run: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    """What is exported as GeoJSON and read again is the same map, by the hash that merging printed."""
    robots = [str(samples_folder() / f"two-robots-{letter}.log") for letter in "ab"]
    status, out, _ = run("merge", *robots, "--method", "pivot", "--out", tmp_path / "map.geojson", "--json")
    assert status == 0
    parts = read_maps(tmp_path / "map.geojson").parts
    scans = [part["scans"] for part in json.loads(out)["components"]]
    assert [part.name for part in parts] == [f"component {n}" for n in range(1, len(scans) + 1)]
    assert map_hash([Component(part.name, (), {}, part.map) for part in parts]) == json.loads(out)["hash"]
