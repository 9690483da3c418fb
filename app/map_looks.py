"""How the merged map is looked at: what its colours say, which components, and beside which other map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from segmap.merging import Component
from segmap.pose import FloatArray, Pose2
from segmap.scans import ScanId

__all__ = ["COLOURINGS", "SIDES", "MapContent", "MapLooks", "Motion", "Other"]

COLOURINGS = {
    "components": "Components",
    "misfit": "Misfit of single scans",
    "witnesses": "Number of scans that saw it",
}
"""what the colours of the merged map can say"""
SIDES = ("beside", "over")
"""where another map is drawn"""


@dataclass(frozen=True)
class MapLooks:
    """What somebody chose to see of the merged map."""

    colouring: str = "components"
    hidden: frozenset[ScanId] = frozenset()
    """components that are not shown, each by its first scan"""
    compare: str = ""
    """name of the map it is compared with; empty: none"""
    side: str = "beside"

    def showing(self, scan: ScanId, on: bool) -> MapLooks:
        """With the component of a first scan shown or not."""
        return replace(self, hidden=self.hidden - {scan} if on else self.hidden | {scan})


@dataclass(frozen=True, eq=False)
class Other:
    """Another map of the same scans, to compare with."""

    name: str
    title: str
    components: tuple[Component, ...] = ()
    problem: str = ""
    """why there is none (yet), for people"""


@dataclass(frozen=True, eq=False)
class Motion:
    """A map on its way from one state of the pose graph to the next."""

    poses: Mapping[ScanId, Pose2]
    """where scans are now, in the frame of the first scan of their component"""
    walls: Mapping[ScanId, FloatArray] = field(default_factory=dict)
    """segments of the scans, each in its own frame: they move as a whole; empty: only the trajectory moves"""


@dataclass(frozen=True, eq=False)
class MapContent:
    """The looks of the merged map, with what they take."""

    looks: MapLooks = field(default_factory=MapLooks)
    misfits: Mapping[str, FloatArray] = field(default_factory=dict)
    """metres for each segment, by name of the component, where that is looked at"""
    other: Other | None = None
    motion: Motion | None = None

    def worst(self) -> tuple[float, float] | None:
        """Median and 95th percentile of the misfit, metres; None where nothing is known."""
        told = [values[np.isfinite(values)] for values in self.misfits.values()]
        held = np.concatenate(told) if told else np.empty(0)
        return (float(np.median(held)), float(np.quantile(held, 0.95))) if len(held) else None
