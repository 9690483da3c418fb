"""SVG, read back with an XML parser and drawn by a browser."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree

import imageio.v3
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from segmap.errors import ExportError
from segmap.export import export_map, thumbnail

SVG = "{http://www.w3.org/2000/svg}"
COORDINATES = st.floats(-1e4, 1e4, allow_nan=False)
ROWS = st.lists(
    st.tuples(*[COORDINATES] * 4).filter(lambda row: math.dist(row[:2], row[2:]) > 1e-8), min_size=1, max_size=5
)


def parsed(*parts, metadata=None) -> ElementTree.Element:
    return ElementTree.fromstring(export_map(parts, "svg", metadata))


def groups(root: ElementTree.Element) -> list[ElementTree.Element]:
    return root.findall(f"{SVG}g")


def lines(group: ElementTree.Element) -> np.ndarray:
    """x1, y1, x2, y2 of the lines of a group, in its own frame."""
    rows = [[float(line.attrib[name]) for name in ("x1", "y1", "x2", "y2")] for line in group.iter(f"{SVG}line")]
    return np.array(rows).reshape(-1, 4)


def on_sheet(group: ElementTree.Element) -> np.ndarray:
    """The same points on the sheet, y down, shape (lines, 2, 2)."""
    move = re.fullmatch(r"translate\((\S+) (\S+)\) scale\(1 -1\)", group.attrib["transform"])
    return lines(group).reshape(-1, 2, 2) * (1.0, -1.0) + (float(move[1]), float(move[2]))


@given(ROWS)
def test_metres(part, rows):
    """Inside its group a line has the map's own coordinates, to a tenth of a millimetre, and lies on the sheet."""
    root = parsed(part("a", *rows))
    (group,) = groups(root)
    np.testing.assert_allclose(lines(group), np.array(rows), rtol=0, atol=5.1e-5)
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    assert (on_sheet(group) > 0.0).all()
    assert (on_sheet(group) < (width, height)).all()


def test_y_up(corner):
    """What is up in the map is up on the sheet."""
    foot, _, arm = on_sheet(groups(parsed(corner))[0])
    assert arm[0, 1] < foot[0, 1]
    assert foot[1, 0] - foot[0, 0] == pytest.approx(4.0)


@given(st.lists(ROWS, min_size=2, max_size=12))
def test_components_lie_apart(part, maps):
    """Components do not overlap on the sheet: nothing is known of how they lie to each other."""
    boxes = [on_sheet(group).reshape(-1, 2) for group in groups(parsed(*(part("c", *rows) for rows in maps)))]
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            apart = (a.min(axis=0) > b.max(axis=0)) | (b.min(axis=0) > a.max(axis=0))
            assert apart.any()


def test_sources(corner):
    """Every line says which segments of which scans it came from."""
    origins = [line.attrib["data-sources"] for line in groups(parsed(corner))[0].iter(f"{SVG}line")]
    assert origins == ["", "0.0.1", "0.0.2 0.1.3"]


def test_scale_bar(corner):
    """The scale bar is as long as it says."""
    root = parsed(corner)
    bar = next(rect for rect in root.iter(f"{SVG}rect") if rect.get("id") == "scale-bar")
    assert f"{float(bar.attrib['width']):g} m" in [text.text for text in root.iter(f"{SVG}text")]


@given(st.text(max_size=60))
def test_names_are_text(part, name):
    """Whatever stands in names and metadata, the file is well-formed and has no element of theirs."""
    part_of_name = part(f"<script>{name}", (0.0, 0.0, 1.0, 0.0))
    root = parsed(part_of_name, metadata={"title": f"<b onload='x'>{name}", "]]>": name})
    assert {element.tag.removeprefix(SVG) for element in root.iter()} == {
        "svg",
        "title",
        "desc",
        "rect",
        "text",
        "g",
        "line",
    }


@pytest.mark.parametrize("parts", [(), ("a",), ("a", "b")])
def test_empty_map(part, parts):
    """A map without segments is a sheet that says so."""
    root = parsed(*map(part, parts), metadata={"title": "T"})
    assert "no segments" in [text.text for text in root.iter(f"{SVG}text")]
    assert groups(root) == []
    assert "no segments" in thumbnail([part(name) for name in parts])


def test_empty_component_is_named(corner, part):
    """A component without segments is not drawn, but told of."""
    assert "lost: no segments" in parsed(corner, part("lost")).find(f"{SVG}desc").text


def test_thumbnail(corner, part):
    """A thumbnail has one path a component and no words."""
    root = ElementTree.fromstring(thumbnail([corner, part("b", (0.0, 0.0, 0.0, 1.0))]))
    assert [len(list(group)) for group in groups(root)] == [1, 1]
    assert list(root.iter(f"{SVG}text")) == []


def test_too_large(part):
    """A map beyond all measure is refused, with what to do."""
    for far in (1e7, 9e7):
        with pytest.raises(ExportError, match="too large for a drawing: export it as geojson"):
            export_map([part("a", (-far, 0.0, far, 0.0))], "svg")


def test_in_a_browser(chromium, corner, tmp_path):
    """A browser draws the corner as it is: foot below arm, ink where a line is, paper where none is."""
    (tmp_path / "map.svg").write_bytes(export_map([corner], "svg", {"title": "A corner"}))
    page = chromium.new_page(viewport={"width": 1000, "height": 750})
    page.goto((tmp_path / "map.svg").as_uri())
    foot, _, arm = (line.bounding_box() for line in page.locator("line").all())
    picture = imageio.v3.imread(page.screenshot())[..., :3].min(axis=2)
    page.close()
    assert arm["y"] < foot["y"]
    assert foot["width"] == pytest.approx(8 * arm["width"], rel=0.02)
    middle, y = int(foot["x"] + foot["width"] / 2), int(foot["y"])
    assert picture[y - 3 : y + 4, middle].min() < 120
    assert picture[y - 60 : y - 10, middle].min() == 255
