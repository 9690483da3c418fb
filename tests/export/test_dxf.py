"""DXF, read back and audited by ezdxf, and read by GDAL."""

from __future__ import annotations

import io
import math

import ezdxf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from segmap.export import export_map

COORDINATES = st.floats(-1e5, 1e5, allow_nan=False)
ROWS = st.lists(st.tuples(*[COORDINATES] * 4).filter(lambda row: math.dist(row[:2], row[2:]) > 1e-8), max_size=6)


def parsed(*parts, metadata=None, integrations=()):
    document = ezdxf.read(io.StringIO(export_map(parts, "dxf", metadata, integrations).decode()))
    audit = document.audit()
    assert (audit.errors, audit.fixes) == ([], [])
    return document


def rows_of(document, prefix="") -> np.ndarray:
    lines = [line for line in document.modelspace().query("LINE") if line.dxf.layer.startswith(prefix)]
    return np.array([[*line.dxf.start.vec2, *line.dxf.end.vec2] for line in lines]).reshape(-1, 4)


@settings(max_examples=15)
@given(ROWS)
def test_round_trip(part, rows):
    """What is read back is the same map, in metres."""
    document = parsed(part("a", *rows))
    np.testing.assert_allclose(rows_of(document), np.array(rows).reshape(-1, 4), rtol=0, atol=1e-9)
    assert (document.dxfversion, document.units) == ("AC1024", 6)


def test_layers_tell_components_and_kinds(corner, part):
    """A layer for each component and kind; every line lies on the one of its own."""
    document = parsed(corner, part("other", (9.0, 9.0, 8.0, 8.0)))
    kinds = ("walls", "undirected", "connectors", "sensors")
    names = {layer.dxf.name for layer in document.layers} - {"0", "Defpoints"}
    assert names == {f"{name} {kind}" for name in ("corner", "other") for kind in kinds}
    lines = [line.dxf.layer for line in document.modelspace().query("LINE")]
    assert lines == ["corner connectors", "corner undirected", "corner walls", "other connectors"]
    assert [point.dxf.layer for point in document.modelspace().query("POINT")][:2] == ["corner sensors"] * 2


def test_components_stand_beside_each_other(corner, part):
    """The first has its own coordinates, the others are moved along x, and the file says by how much."""
    document = parsed(corner, part("corner", (0.0, 0.0, 4.0, 0.0)), part("c", (-7.0, 1.0, -5.0, 1.0)))
    np.testing.assert_allclose(rows_of(document, "corner (2)"), [[9.0, 0.0, 13.0, 0.0]])
    told = dict(document.header.custom_vars.properties)
    moved = float(told["c, moved along x by"].removesuffix(" m"))
    np.testing.assert_allclose(rows_of(document, "c ") - [moved, 0.0, moved, 0.0], [[-7.0, 1.0, -5.0, 1.0]])
    assert moved - 7.0 > 13.0


def test_origin_of_every_line(corner):
    """Every line says its component, number, sources and integrations; the drawing where it comes from."""
    document = parsed(corner, metadata={"map_hash": "5f3a", "title": "T"}, integrations=["0.0-0.1"])
    origins = [[tag.value for tag in line.get_xdata("SEGMAP")] for line in document.modelspace().query("LINE")]
    assert origins[2] == ["component corner", "segment 2", "sources 0.0.2 0.1.3", "integrations 0.0-0.1"]
    told = dict(document.header.custom_vars.properties)
    assert (told["map_hash"], told["title"]) == ("5f3a", "T")


@pytest.mark.parametrize("name", ["<a>/b:c*", "x" * 300, "\ud800\n\0\x1b", "\\U+0041 ^J", "0", ""])
def test_hostile_names(part, name):
    """Whatever a component is called, the drawing is sound and every line has its layer."""
    document = parsed(part(name, (0.0, 0.0, 1.0, 0.0)), metadata={"title": name})
    (line,) = document.modelspace().query("LINE")
    assert line.dxf.layer in document.layers
    assert all(len(tag.value.encode()) <= 255 for tag in line.get_xdata("SEGMAP"))


def test_empty():
    """No components are a drawing without lines."""
    assert len(parsed().modelspace()) == 0


def test_gdal_reads_it(corner, tmp_path):
    """The reader of QGIS and others finds every line on its layer."""
    raw = pytest.importorskip("pyogrio.raw", reason="pyogrio is not installed: pip install segmap[test]")
    shapely = pytest.importorskip("shapely")
    (tmp_path / "map.dxf").write_bytes(export_map([corner], "dxf"))
    meta, _, shapes, fields = raw.read(tmp_path / "map.dxf")
    layers = fields[list(meta["fields"]).index("Layer")]
    lines = [shape for shape, layer in zip(shapely.from_wkb(shapes), layers, strict=True) if "sensors" not in layer]
    assert sum(line.length for line in lines) == pytest.approx(6.5)
