"""GeoJSON, read back with json and shapely."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from segmap.export import export_map
from segmap.segments import SegmentMap

COORDINATES = st.floats(-1e6, 1e6, allow_nan=False)
ROWS = st.lists(st.tuples(*[COORDINATES] * 4).filter(lambda row: math.dist(row[:2], row[2:]) > 1e-8), max_size=8)


def exported(*parts, metadata=None, integrations=()):
    return json.loads(export_map(parts, "geojson", metadata, integrations))


def read_back(document) -> np.ndarray:
    lines = [shapely.geometry.shape(feature["geometry"]) for feature in document["features"]]
    assert all(line.geom_type == "LineString" and len(line.coords) == 2 for line in lines)
    return np.array([np.ravel(line.coords) for line in lines]).reshape(-1, 4)


@given(ROWS)
def test_round_trip(part, rows):
    """What is read back is the same map, to a micrometre."""
    document = exported(part("a", *rows))
    np.testing.assert_allclose(read_back(document), np.array(rows).reshape(-1, 4), rtol=0, atol=5.1e-7)
    SegmentMap(read_back(document))


def test_tiny_segments_keep_their_length(part):
    """A segment shorter than the rounding is written exactly, never as a point."""
    assert read_back(exported(part("a", (1.0, 0.0, 1.0, 2e-8)))).tolist() == [[1.0, 0.0, 1.0, 2e-8]]


def test_shapely_reads_the_whole(corner):
    """shapely's own reader takes the collection as it is."""
    collection = shapely.from_geojson(export_map([corner], "geojson").decode())
    assert collection.length == 6.5
    assert collection.bounds == (0.0, 0.0, 4.0, 2.0)


def test_local_frame(corner):
    """The file says that its coordinates are metres in a local frame, not longitudes."""
    frame = exported(corner)["coordinate_frame"]
    assert (frame["type"], frame["units"], frame["geographic"]) == ("local", "metres", False)
    assert "no WGS84" in frame["note"]


def test_gdal_takes_it_for_a_local_frame(corner, tmp_path):
    """The reader of QGIS and others finds metres in a local frame, and the same lines."""
    raw = pytest.importorskip("pyogrio.raw", reason="pyogrio is not installed: pip install segmap[test]")
    (tmp_path / "map.geojson").write_bytes(export_map([corner], "geojson"))
    meta, _, shapes, _ = raw.read(tmp_path / "map.geojson")
    assert meta["crs"].startswith('LOCAL_CS["segmap local frame, not geographic",UNIT["metre",1]')
    assert shapely.get_coordinates(shapely.from_wkb(shapes)).reshape(-1, 4).tolist() == corner.map.coordinates.tolist()


def test_properties(corner, part):
    """Every segment says its component, its sources, whether it has a direction, and what joined its scans."""
    other = part("other", (9.0, 9.0, 8.0, 8.0))
    document = exported(corner, other, integrations=["0.0-0.1", "0.1-0.2"])
    properties = [feature["properties"] for feature in document["features"]]
    assert [(p["component"], p["segment"]) for p in properties] == [
        ("corner", 0),
        ("corner", 1),
        ("corner", 2),
        ("other", 0),
    ]
    assert [p["directed"] for p in properties] == [True, False, True, True]
    assert [p["sources"] for p in properties] == [[], [[0, 0, 1]], [[0, 0, 2], [0, 1, 3]], []]
    assert [p["integrations"] for p in properties] == [[], [], ["0.0-0.1"], []]


def test_components(corner, part):
    """Components are listed with their scans, those without segments too."""
    document = exported(corner, part("<nothing>"), integrations=["0.0-0.1", "0.1-0.2"])
    assert document["components"] == [
        {"name": "corner", "scans": ["0.0", "0.1"], "integrations": ["0.0-0.1"], "segments": 3, "length": 6.5},
        {"name": "<nothing>", "scans": ["0.0", "0.1"], "integrations": ["0.0-0.1"], "segments": 0, "length": 0.0},
    ]


def test_empty_map():
    """No components are a collection without features."""
    document = exported(metadata={"version": "0.1.0"})
    assert (document["type"], document["features"], document["metadata"]) == (
        "FeatureCollection",
        [],
        {"version": "0.1.0"},
    )


def test_hostile_names(part):
    """A name is text, whatever it holds."""
    name = '"}]\n\u2028</script>\ud800'
    assert exported(part(name, (0.0, 0.0, 1.0, 0.0)))["features"][0]["properties"]["component"] == name
