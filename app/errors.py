"""What can go wrong between the pages and the library, beside the library's own errors."""

from __future__ import annotations

from segmap.errors import SegmapError

__all__ = ["BusyError", "RequestError", "UnknownError"]


class UnknownError(SegmapError):
    """Something of this name is not here (any more)."""


class BusyError(SegmapError):
    """As much is open as the server keeps open."""


class RequestError(SegmapError):
    """A request that makes no sense."""
