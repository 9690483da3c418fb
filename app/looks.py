"""What one view looks at, as one immutable value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from app.drawables import Pick
from app.map_looks import MapLooks
from segmap.matches import Match
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.segments import SegmentMap

__all__ = ["Looks", "Trial"]


@dataclass(frozen=True, eq=False)
class Trial:
    """What other parameters make of one pair."""

    parameters: Parameters
    maps: tuple[SegmentMap, SegmentMap]
    match: Match
    milliseconds: float
    """for segments and match"""
    number: int
    """a later trial has a larger one"""


@dataclass(frozen=True)
class Looks:
    """A selection and how it is shown; another one is made for every change."""

    integration: str | None = None
    heuristic: str | None = None
    """None: the project's"""
    rank: int = 0
    """of the candidate shown, 0 for the best"""
    stage: str = "chains"
    dimension: int = 2
    theme: str = "light"
    switched: Mapping[tuple[str, str], bool] = field(default_factory=lambda: MappingProxyType({}))
    """layers switched on or off by hand, by stage and layer"""
    picked: Pick | None = None
    """the segment that was clicked"""
    notice: str = ""
    """what the last action did, for people"""
    fits: int = 0
    """how often somebody asked to see everything"""
    map: MapLooks = field(default_factory=MapLooks)
    measuring: bool = False
    """whether clicks measure"""
    measured: tuple[tuple[float, float], ...] = ()
    """metres; the places that were clicked to measure, two at most"""
    nudging: bool = False
    """whether the second map is to be laid by hand"""
    held: Pose2 | None = None
    """where the second map is held, while it is dragged"""
    laying: tuple[Pick, ...] = ()
    """the segments clicked so far, to lay the second map by them: each with its partner after it"""
    reason: str = ""
    """of the next decision"""
    trial: Trial | None = None
    """parameters that are tried on this pair"""

    @property
    def shown(self) -> dict[str, bool]:
        """The layers of this stage that were switched by hand."""
        return {layer: on for (stage, layer), on in self.switched.items() if stage == self.stage}

    def at(self, integration: str | None, heuristic: str | None = None, rank: int = 0) -> Looks:
        """The same view of another integration, or of another candidate of it."""
        same = integration == self.integration
        blank = replace(self, picked=None, notice="", held=None, laying=(), trial=None, measured=())
        kept = blank if same else replace(blank, nudging=False, reason="")
        return replace(kept, integration=integration, heuristic=heuristic, rank=rank)

    def switch(self, layer: str, on: bool) -> Looks:
        """With a layer of this stage drawn or not."""
        return replace(self, switched=MappingProxyType({**self.switched, (self.stage, layer): on}))
