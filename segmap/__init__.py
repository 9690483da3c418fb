"""Segment-based maps from laser scans, without pose information.

What scripts need is here by name, and explained with examples in docs/api.md::

    from segmap import extract, integrate, preset, read_log

A name is imported when it is first asked for: ``import segmap`` itself takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from segmap.errors import SegmapError
    from segmap.export import write_map
    from segmap.integration import integrate
    from segmap.logs import read_log, read_logs, read_maps, read_pose_graph
    from segmap.mapping import fused, map_scans
    from segmap.merging import map_hash, merge
    from segmap.parameters import Parameters, preset
    from segmap.pose import Pose2
    from segmap.scans import ScanId
    from segmap.segments import SegmentMap, extract
    from segmap.store import Store

__all__ = [
    "Parameters",
    "Pose2",
    "ScanId",
    "SegmapError",
    "SegmentMap",
    "Store",
    "extract",
    "fused",
    "integrate",
    "map_hash",
    "map_scans",
    "merge",
    "preset",
    "read_log",
    "read_logs",
    "read_maps",
    "read_pose_graph",
    "write_map",
]

_HOMES = {
    "errors": ("SegmapError",),
    "parameters": ("Parameters", "preset"),
    "pose": ("Pose2",),
    "scans": ("ScanId",),
    "segments": ("SegmentMap", "extract"),
    "logs": ("read_log", "read_logs", "read_maps", "read_pose_graph"),
    "integration": ("integrate",),
    "merging": ("map_hash", "merge"),
    "mapping": ("fused", "map_scans"),
    "store": ("Store",),
    "export": ("write_map",),
}
"""the module of each name"""
_HOME = {name: f"{__name__}.{module}" for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(_HOME[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
