"""The exceptions segmap raises on purpose.

    SegmapError
    ├── ParameterError     a parameter is unknown, out of bounds or of the wrong kind
    ├── LogError           a file cannot be read as what it claims to be
    ├── ScanError          ranges, angles or an index that no laser scan can have
    ├── MapError           coordinates that no segment map can have
    ├── GraphError         an edge that no pose graph can have
    ├── ProjectError       a project file or a decision that cannot be carried out
    │   └── ConflictError  somebody else decided first: look again, then decide
    ├── ExportError        a map that cannot be written in the format asked for
    ├── DatasetError       public data that cannot be fetched, or is not what it should be
    └── CancelledError     long work was stopped because somebody asked for it

Every message is one sentence or two: what is wrong, where, and what to do about it.
"""

from __future__ import annotations

__all__ = [
    "CancelledError",
    "ConflictError",
    "DatasetError",
    "ExportError",
    "GraphError",
    "LogError",
    "MapError",
    "ParameterError",
    "ProjectError",
    "ScanError",
    "SegmapError",
]


class SegmapError(Exception):
    r"""Base of everything segmap raises on purpose; its text, for people, is one printable line whatever it quotes.

    >>> str(SegmapError("There is no scan named \x1b[31m\n."))
    'There is no scan named �[31m�.'
    """

    def __str__(self) -> str:
        return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in super().__str__())


class ParameterError(SegmapError):
    """A parameter is unknown, out of bounds or of the wrong kind."""


class LogError(SegmapError):
    """A file cannot be read as what it claims to be."""


class ScanError(SegmapError):
    """Ranges, angles or an index that no laser scan can have."""


class MapError(SegmapError):
    """Coordinates that no segment map can have."""


class GraphError(SegmapError):
    """An edge that no pose graph can have."""


class ProjectError(SegmapError):
    """A project file or a decision that cannot be carried out."""


class ConflictError(ProjectError):
    """Somebody else decided first; the state has moved on."""


class ExportError(SegmapError):
    """A map that cannot be written in the format asked for."""


class DatasetError(SegmapError):
    """Public data that cannot be fetched, or is not what it should be."""


class CancelledError(SegmapError):
    """Long work was stopped because somebody asked for it."""
