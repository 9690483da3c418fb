"""CSV, read back with the csv module."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from segmap.export import export_map

COORDINATES = st.floats(-1e6, 1e6, allow_nan=False)
ROWS = st.lists(st.tuples(*[COORDINATES] * 4).filter(lambda row: math.dist(row[:2], row[2:]) > 1e-8), max_size=8)


def parsed(*parts, metadata=None, integrations=()) -> list[dict[str, str]]:
    text = export_map(parts, "csv", metadata, integrations).decode()
    return list(csv.DictReader(io.StringIO(text, newline=""), strict=True))


@given(ROWS)
def test_round_trip(part, rows):
    """What is read back is the same map, to a micrometre, with length and heading."""
    read = parsed(part("a", *rows))
    held = np.array([[float(row[name]) for name in ("x1_m", "y1_m", "x2_m", "y2_m")] for row in read]).reshape(-1, 4)
    np.testing.assert_allclose(held, np.array(rows).reshape(-1, 4), rtol=0, atol=5.1e-7)
    assert all(abs(float(row["length_m"]) - math.dist(r[:2], r[2:])) < 1e-6 for row, r in zip(read, rows, strict=True))


def test_columns(corner):
    """Component, number, direction, sources, integrations and where the map comes from."""
    rows = parsed(corner, metadata={"version": "0.1.0", "map_hash": "5f3a"}, integrations=["0.0-0.1"])
    last = rows[-1]
    assert [row["segment"] for row in rows] == ["0", "1", "2"]
    assert (last["component"], last["directed"], last["heading_deg"]) == ("corner", "1", "0.000000")
    assert (last["sources"], last["integrations"]) == ("0.0.2 0.1.3", "0.0-0.1")
    assert (last["version"], last["map_hash"]) == ("0.1.0", "5f3a")


def test_no_cell_is_a_formula(part):
    """A name that a spreadsheet would compute is a text there; quotes and line ends stay inside their cell."""
    names = ["=1+1", "@SUM(A1)", "-2", '"a",\n"b"']
    rows = parsed(*(part(name, (0.0, 0.0, 1.0, 0.0)) for name in names))
    assert [row["component"] for row in rows] == ["'=1+1", "'@SUM(A1)", "'-2", '"a",\n"b"']


def test_empty():
    """No segments are the header alone."""
    assert parsed() == []
    assert export_map([], "csv").count(b"\r\n") == 1
