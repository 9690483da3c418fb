"""Merged maps as files other programs open.

To add a format, write a module with an :class:`~segmap.export.components.ExportFormat` and name it
in ``FORMATS``: command line, web API and pages offer what is there.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from segmap.errors import ExportError
from segmap.export.components import RESOLUTION, Content, ExportFormat, Files, MapComponent
from segmap.export.dxf import DXF
from segmap.export.files import check_place, packed, write_whole
from segmap.export.g2o import G2O
from segmap.export.geojson import GEOJSON
from segmap.export.png import PNG
from segmap.export.record import LogTold, PairTold, Record
from segmap.export.report import REPORT
from segmap.export.ros import ROS_MAP
from segmap.export.svg import SVG, thumbnail
from segmap.export.table import CSV
from segmap.export.tum import TUM

__all__ = [
    "FORMATS",
    "RESOLUTION",
    "Content",
    "ExportFormat",
    "Files",
    "LogTold",
    "MapComponent",
    "PairTold",
    "Record",
    "by_suffix",
    "export_files",
    "export_map",
    "format_of",
    "in_one",
    "thumbnail",
    "write_files",
    "write_map",
]

FORMATS: dict[str, ExportFormat] = {
    format.name: format for format in (ROS_MAP, DXF, SVG, PNG, GEOJSON, CSV, TUM, G2O, REPORT)
}
"""Every format written, by name."""


def export_files(content: Content, format: str) -> Files:
    """A merged map as the files of a format, by name; the same content gives the same bytes.

    A map without segments gives valid files without segments.

    Raises:
        ExportError: there is no such format, or it cannot hold the map.
    """
    kind = format_of(format)
    written = kind.write(content)
    return {f"{content.stem}{kind.suffix}": written} if isinstance(written, bytes) else written


def export_map(
    components: Sequence[MapComponent],
    format: str,
    metadata: Mapping[str, str] | None = None,
    integrations: Sequence[str] = (),
) -> bytes:
    """The components of a merged map as the bytes of a file; the same input gives the same bytes.

    ``metadata`` is written as it is: ``title`` names the drawing; ``version``, ``map_hash`` and
    whatever else tells where the map comes from. ``integrations`` are the ids of the accepted
    ones (``0.12-0.13``). A format of several files gives a zip archive of them.

    Raises:
        ExportError: there is no such format, or it cannot hold the map.
    """
    return in_one(export_files(Content(components, metadata or {}, integrations), format), format)


def in_one(files: Files, format: str) -> bytes:
    """The files of a format as one: itself, or a zip archive where the format takes several."""
    return packed(files) if format_of(format).several else next(iter(files.values()))


def write_map(
    components: Sequence[MapComponent],
    path: str | os.PathLike[str],
    format: str | None = None,
    metadata: Mapping[str, str] | None = None,
    integrations: Sequence[str] = (),
) -> None:
    """Write the components of a merged map to a file, whole or not at all.

    Without ``format`` the file's suffix says which one. A format of several files puts the others
    beside it, with names that begin like its own.

    Raises:
        ExportError: there is no such format, it cannot hold the map, or a file cannot be written.
    """
    write_files(Content(components, metadata or {}, integrations), path, format)


def write_files(content: Content, path: str | os.PathLike[str], format: str | None = None) -> tuple[Path, ...]:
    """The same for content that is put together already; its ``stem`` is taken from the path.

    Gives the files that were written, the one that was named first.

    Raises:
        ExportError: as for ``write_map``.
    """
    check_place(path)
    target = Path(path)
    kind = format_of(format or by_suffix(target))
    files = dict(export_files(replace(content, stem=target.stem), kind.name))
    if target.name not in files:
        files = {target.name: files.pop(next(iter(files))), **files}
    for name in reversed(files):  # what the first one points to is there before it
        write_whole(target.with_name(name), files[name])
    return tuple(target.with_name(name) for name in files)


def format_of(name: str) -> ExportFormat:
    """The format of a name.

    Raises:
        ExportError: there is none.
    """
    try:
        return FORMATS[name]
    except KeyError:
        raise ExportError(f"There is no export format {name!r}. Formats are: {', '.join(FORMATS)}.") from None


def by_suffix(path: Path) -> str:
    """The name of the format that a file's suffix means.

    Raises:
        ExportError: it means none.
    """
    for format in FORMATS.values():
        if path.suffix.lower() == format.suffix:
            return format.name
    suffixes = ", ".join(format.suffix for format in FORMATS.values())
    raise ExportError(f"{path.name} does not say its format: let the name end in one of {suffixes}.")
