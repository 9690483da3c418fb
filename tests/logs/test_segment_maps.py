"""Segment maps from files: what was exported, what others write, and what is none."""

from __future__ import annotations

import gzip
import json
import math
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from segmap.errors import LogError
from segmap.export import export_map
from segmap.logs import read_log, read_maps
from segmap.scans import ScanId
from segmap.segments import SegmentMap, Source

COORDINATES = st.floats(-1e6, 1e6, allow_nan=False)
ROWS = st.lists(st.tuples(*[COORDINATES] * 4).filter(lambda row: math.dist(row[:2], row[2:]) > 1e-5), max_size=8)


@dataclass(frozen=True)
class Part:
    """What is exported."""

    name: str
    map: SegmentMap
    scans: tuple[ScanId, ...] = ()
    poses: tuple = ()


def made(rows) -> SegmentMap:
    sources = tuple((Source(0, 0, i), Source(1, 2, i + 1))[: i % 3] for i in range(len(rows)))
    return SegmentMap(np.array(rows), directed=np.arange(len(rows)) % 2 == 0, sources=sources)


@given(st.lists(ROWS, max_size=3))
def test_an_exported_map_comes_back(maps):
    """GeoJSON read again is the same map: coordinates to a micrometre, directions, sources, components."""
    parts = [Part(f"component {number}", made(rows)) for number, rows in enumerate(maps)]
    read = read_maps(export_map(parts, "geojson"))
    assert read.problems == ()
    assert [part.name for part in read.parts] == [part.name for part in parts]
    for back, part in zip(read.parts, parts, strict=True):
        np.testing.assert_allclose(back.map.coordinates, part.map.coordinates, rtol=0, atol=5.1e-7)
        assert back.map.directed.tolist() == part.map.directed.tolist()
        assert back.map.sources == part.map.sources


def test_lines_that_others_write():
    """Polylines become their segments; several lines, heights and single geometries are taken; direction is unknown."""
    lines = shapely.MultiLineString([[(0, 0), (4, 0), (4, 3)], [(9, 9), (9, 8)]])
    rows = [[0, 0, 4, 0], [4, 0, 4, 3], [9, 9, 9, 8]]
    feature = {"type": "Feature", "properties": None, "geometry": json.loads(shapely.to_geojson(lines))}
    collection = {"type": "GeometryCollection", "geometries": [feature["geometry"]]}
    high = {"type": "LineString", "coordinates": [[0, 0, 7], [4, 0, 8]]}
    for held in (feature, feature["geometry"], collection, {"type": "FeatureCollection", "features": [feature]}):
        (part,) = read_maps(json.dumps(held).encode()).parts
        assert part.map.coordinates.tolist() == rows
        assert not part.map.directed.any()
    assert read_maps(json.dumps(high).encode()).parts[0].map.coordinates.tolist() == rows[:1]


def test_plain_json():
    """What the command line prints of a scan is a map; so are several, by name."""
    printed = {"log": "a.log", "scan": 7, "segments": [[0, 0, 4, 0]]}
    (part,) = read_maps(gzip.compress(json.dumps(printed).encode()), "scan.json.gz").parts
    assert (part.name, part.map.directed.tolist()) == ("a.log", [True])
    several = {"components": [{"name": "hall", "segments": [[0, 0, 1, 1]], "directed": [False]}, {"segments": []}]}
    read = read_maps(json.dumps(several).encode(), "maps.json")
    assert [(part.name, len(part.map)) for part in read.parts] == [("hall", 1), ("map", 0)]
    with pytest.raises(LogError, match=r"maps\.json has no map 2: it holds maps 0 to 1"):
        read.part(2)


@pytest.mark.parametrize(
    "row",
    [
        [0, 0, 1],
        [0, 0, 0, 0],
        [0, 0, 1, "1"],
        [0, 0, 1, True],
        [0, 0, 1, None],
        [0, 0, 1e300, 0],
        [0, 10**400, 1, 1],
        7,
    ],
)
def test_bad_segments_cost_only_themselves(row):
    """A segment without length, or that is no four numbers, is left out with its number."""
    read = read_maps(json.dumps({"segments": [[0, 0, 1, 0], row, [0, 1, 1, 1]]}).encode())
    assert len(read.parts[0].map) == 2
    assert str(read.problems[0]).startswith("segment 2: ")
    assert str(read.problems[0]).isprintable()


@pytest.mark.parametrize(
    "geometry",
    [
        None,
        7,
        {},
        {"type": "Point", "coordinates": [1, 2]},
        {"type": "LineString"},
        {"type": "LineString", "coordinates": [1]},
    ],
)
def test_features_that_are_no_lines(geometry):
    """Points, areas and nonsense are left out and told of; the lines beside them are kept."""
    good = {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 0]]}}
    bad = {"type": "Feature", "geometry": geometry}
    read = read_maps(json.dumps({"type": "FeatureCollection", "features": [bad, good, 7]}).encode())
    assert (len(read.parts[0].map), len(read.problems)) == (1, 1)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"FLASER 1 2 3", "holds no segment map"),
        (b'{"segments": [', "is no valid JSON"),
        (b'{"segments": [' + b"[" * 100_000, "cannot be read"),
        (b'{"components": [{"segments": [], "x": 1}, {"segments": 7}]}', "a component without a list of segments"),
        (b'{"segments": [' + b"0," * (1 << 24) + b"0]}", "more than 32 MiB"),
    ],
)
def test_files_that_hold_no_maps(content, reason):
    """They are refused in a sentence."""
    with pytest.raises(LogError, match=r"^m\.json ") as refused:
        read_maps(content, "m.json")
    assert reason in str(refused.value)


def test_maps_are_no_logs():
    """Where scans are asked for, a map is named as what it is."""
    with pytest.raises(LogError, match=r"m\.json holds segment maps, not laser scans"):
        read_log(export_map([], "geojson"), "m.json")
