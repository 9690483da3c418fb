"""Components as DXF (R2010), metres: a line a segment, a layer for each component and kind.

The first component has its own coordinates; the others stand beside it, as nothing is known between
them, and a custom property of the file says by how much each was moved. Every line carries its
origin as extended data of the application ``SEGMAP``.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from segmap.export.components import Content, ExportFormat, MapComponent, origin_of, scans_of

if TYPE_CHECKING:
    from ezdxf.document import Drawing

__all__ = ["DXF", "write_dxf"]

APPLICATION = "SEGMAP"
METRES = 6
"""the unit's number in DXF"""
KINDS = {"walls": 7, "undirected": 8, "connectors": 3, "sensors": 1}
"""colour number of each kind: segments with free space on one side; on an unknown one; joining others, of no scan;
where the scans were taken"""
GAP = 5.0
"""metres between components"""
LONGEST_TEXT = 250
"""bytes of one text of extended data"""
VARYING = re.compile(
    r"(?<=\$)(TDCREATE|TDUCREATE|TDUPDATE|TDUUPDATE)\n 40\n[^\n]*|(?<=\$)(VERSIONGUID|FINGERPRINTGUID)\n  2\n[^\n]*"
)
WRITTEN = re.compile(r"(?<= @ )\d{4}-\d\d-\d\dT[^\n]*")


def write_dxf(content: Content) -> bytes:
    """The drawing; the same input gives the same bytes."""
    from ezdxf.filemanagement import new

    drawing = new("R2010", units=METRES)
    drawing.appids.add(APPLICATION)
    drawing.header.custom_vars.append("frame", "metres; local frame of each component, that of its first scan's sensor")
    for name, value in sorted(content.metadata.items()):
        drawing.header.custom_vars.append(_text(name), _text(value))
    for part in _parts(content):
        _draw(drawing, part, content)
    text = io.StringIO()
    drawing.write(text)
    return _timeless(text.getvalue()).encode("utf-8", "replace")


@dataclass(frozen=True, slots=True)
class _Part:
    """A component, what its layers begin with, and how far it is moved along x, metres."""

    component: MapComponent
    layer: str
    moved: float


def _parts(content: Content) -> Iterator[_Part]:
    right, taken = None, set[str]()
    for number, component in enumerate(content.components, start=1):
        left, _, end, _ = component.map.bounds or (0.0, 0.0, 0.0, 0.0)
        moved = 0.0 if right is None else round(right + GAP - left, 3)
        right = end + moved
        layer = _layer(component.name)
        layer = f"{layer} ({number})" if layer.lower() in taken else layer
        taken.add(layer.lower())
        yield _Part(component, layer, moved)


def _layer(name: str) -> str:
    """A name as a layer may have it."""
    return re.sub(r"[<>/\\\":;?*|=`,\x00-\x1f\x7f]", "_", _text(name))[:100]


def _draw(drawing: Drawing, part: _Part, content: Content) -> None:
    drawing.header.custom_vars.append(f"{part.layer}, moved along x by", f"{part.moved} m")
    for kind, colour in KINDS.items():
        drawing.layers.add(f"{part.layer} {kind}", color=colour)
    space = drawing.modelspace()
    component_map = part.component.map
    rows = component_map.coordinates + np.array((part.moved, 0.0, part.moved, 0.0))
    for number, (x1, y1, x2, y2) in enumerate(rows.tolist()):
        line = space.add_line((x1, y1), (x2, y2), {"layer": f"{part.layer} {_kind(part.component, number)}"})
        line.set_xdata(APPLICATION, _origin(part.component, number, content))
    for scan, pose in part.component.poses.items():
        point = space.add_point((pose.x + part.moved, pose.y), {"layer": f"{part.layer} sensors"})
        point.set_xdata(APPLICATION, [(1000, f"scan {scan}")])


def _kind(component: MapComponent, segment: int) -> str:
    if not component.map.sources[segment]:
        return "connectors"
    return "walls" if component.map.directed[segment] else "undirected"


def _origin(component: MapComponent, segment: int, content: Content) -> list[tuple[int, Any]]:
    """Component, number, sources and integrations of a segment, as extended data."""
    sources = component.map.sources[segment]
    texts = {
        "component": component.name,
        "segment": str(segment),
        "sources": origin_of(sources),
        "integrations": " ".join(content.integrations_of(scans_of(sources))),
    }
    return [(1000, piece) for name, text in texts.items() for piece in _pieces(f"{name} {_text(text)}")]


def _pieces(text: str) -> Iterator[str]:
    """A text in pieces of a length that DXF takes, cut between words where it has some."""
    while len(text.encode("utf-8")) > LONGEST_TEXT:
        cut = text.rfind(" ", 1, LONGEST_TEXT // 4)
        cut = LONGEST_TEXT // 4 if cut < 0 else cut
        yield text[:cut]
        text = text[cut:].lstrip()
    yield text


def _text(text: str) -> str:
    r"""One printable line; a caret or a backslash followed by U would be taken for a code."""
    printable = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return re.sub(r"\\(?=[UM]\+)|\^", "_", printable.encode("utf-8", "replace").decode())


def _timeless(text: str) -> str:
    """The same drawing whenever it is written: times and random identifiers are what a new drawing has."""

    def fixed(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        held = "2451544.5" if match[1] else "{00000000-0000-0000-0000-000000000000}"
        return f"{name}\n{' 40' if match[1] else '  2'}\n{held}"

    return WRITTEN.sub("2000-01-01T00:00:00+00:00", VARYING.sub(fixed, text))


DXF = ExportFormat(
    name="dxf",
    suffix=".dxf",
    media_type="image/vnd.dxf",
    title="DXF",
    use="for CAD: metres, a layer for each component and kind",
    write=write_dxf,
)
