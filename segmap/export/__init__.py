"""Merged maps as files other programs open.

To add a format, write a module with a function ``Content -> bytes`` and name it in ``FORMATS``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from segmap.errors import ExportError
from segmap.export.components import Content, MapComponent
from segmap.export.files import write_whole
from segmap.export.geojson import write_geojson
from segmap.export.svg import thumbnail, write_svg

__all__ = ["FORMATS", "ExportFormat", "MapComponent", "export_map", "thumbnail", "write_map"]


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """A kind of file segmap writes."""

    name: str
    suffix: str
    """with the dot"""
    media_type: str
    title: str
    """for people"""
    write: Callable[[Content], bytes]


FORMATS: dict[str, ExportFormat] = {
    format.name: format
    for format in (
        ExportFormat("geojson", ".geojson", "application/geo+json", "GeoJSON, local frame in metres", write_geojson),
        ExportFormat("svg", ".svg", "image/svg+xml", "SVG drawing in metres", write_svg),
    )
}
"""Every format written, by name."""


def export_map(
    components: Sequence[MapComponent],
    format: str,
    metadata: Mapping[str, str] | None = None,
    integrations: Sequence[str] = (),
) -> bytes:
    """The components of a merged map as the bytes of a file; the same input gives the same bytes.

    ``metadata`` is written as it is: ``title`` names the drawing; ``version``, ``map_hash`` and
    whatever else tells where the map comes from. ``integrations`` are the ids of the accepted
    ones (``0.12-0.13``). A map without segments gives a valid file without segments.

    Raises:
        ExportError: there is no such format, or it cannot hold the map.
    """
    return _format(format).write(Content(components, metadata or {}, integrations))


def write_map(
    components: Sequence[MapComponent],
    path: str | os.PathLike[str],
    format: str | None = None,
    metadata: Mapping[str, str] | None = None,
    integrations: Sequence[str] = (),
) -> None:
    """Write the components of a merged map to a file, whole or not at all.

    Without ``format`` the file's suffix says which one.

    Raises:
        ExportError: there is no such format, it cannot hold the map, or the file cannot be written.
    """
    target = Path(path)
    content = export_map(components, format or _by_suffix(target), metadata, integrations)
    write_whole(target, content)


def _format(name: str) -> ExportFormat:
    try:
        return FORMATS[name]
    except KeyError:
        raise ExportError(f"There is no export format {name!r}. Formats are: {', '.join(FORMATS)}.") from None


def _by_suffix(path: Path) -> str:
    for format in FORMATS.values():
        if path.suffix.lower() == format.suffix:
            return format.name
    suffixes = ", ".join(format.suffix for format in FORMATS.values())
    raise ExportError(f"{path.name} does not say its format: let the name end in one of {suffixes}.")
