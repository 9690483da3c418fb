"""Components as GeoJSON: a FeatureCollection of LineStrings in metres, marked as a local frame.

RFC 7946 knows only WGS84 unless the parties have agreed otherwise (Section 4). The foreign member
``coordinate_frame`` is that agreement in words; ``crs``, as GeoJSON of 2008 has it, is what GDAL,
QGIS and others read: a local frame, so that nobody places the map off Africa.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from segmap.export.components import Content, ExportFormat, MapComponent, scans_of
from segmap.segments import SegmentMap

__all__ = ["GEOJSON", "write_geojson"]

DIGITS = 6
"""micrometres"""
FRAME = {
    "type": "local",
    "geographic": False,
    "units": "metres",
    "axes": "x, y; right-handed, angles counter-clockwise",
    "origin": "each component has a frame of its own, that of its first scan's sensor:"
    " coordinates of different components must not be compared",
    "note": "These are not longitudes and latitudes: no WGS84, no map projection.",
}
LOCAL_CS = 'LOCAL_CS["segmap local frame, not geographic",UNIT["metre",1]]'
CRS = {"type": "name", "properties": {"name": LOCAL_CS}}


def write_geojson(content: Content) -> bytes:
    """One feature a segment, in the order of components and segments; the same input gives the same bytes."""
    members = {
        "type": "FeatureCollection",
        "crs": CRS,
        "coordinate_frame": FRAME,
        "metadata": dict(sorted(content.metadata.items())),
        "components": [_summary(component, content) for component in content.components],
    }
    features = ",\n".join(
        _json(feature) for component in content.components for feature in _features(component, content)
    )
    head = ",\n".join(f"{_json(name)}: {_json(value)}" for name, value in members.items())
    return f'{{{head},\n"features": [\n{features}\n]}}\n'.encode("ascii")


def _json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _summary(component: MapComponent, content: Content) -> dict[str, Any]:
    return {
        "name": component.name,
        "scans": [str(scan) for scan in component.scans],
        "integrations": content.integrations_of(component.scans),
        "segments": len(component.map),
        "length": round(float(component.map.lengths.sum()), DIGITS),
    }


def _features(component: MapComponent, content: Content) -> Iterator[dict[str, Any]]:
    for segment in range(len(component.map)):
        yield {
            "type": "Feature",
            "geometry": {"type": "LineString", "coordinates": _line(component.map, segment)},
            "properties": _properties(component, segment, content),
        }


def _line(map: SegmentMap, segment: int) -> list[list[float]]:
    """Two positions, rounded unless that would make them one."""
    x1, y1, x2, y2 = map.coordinates[segment].tolist()
    exact = [[x1, y1], [x2, y2]]
    rounded = [[round(x, DIGITS) + 0.0, round(y, DIGITS) + 0.0] for x, y in exact]
    return exact if rounded[0] == rounded[1] else rounded


def _properties(component: MapComponent, segment: int, content: Content) -> dict[str, Any]:
    sources = component.map.sources[segment]
    return {
        "component": component.name,
        "segment": segment,
        "directed": bool(component.map.directed[segment]),
        "sources": [[source.log, source.scan, source.segment] for source in sources],
        "integrations": content.integrations_of(scans_of(sources)),
    }


GEOJSON = ExportFormat(
    name="geojson",
    suffix=".geojson",
    media_type="application/geo+json",
    title="GeoJSON",
    use="for maps and scripts; a local frame in metres",
    write=write_geojson,
)
