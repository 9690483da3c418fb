"""How drawings lay components out: side by side in rows, as nothing is known between them.

Sheet coordinates are metres from the upper left corner, y down; letters and margins are hundredths
of the drawing's size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from segmap.errors import ExportError
from segmap.export.components import MapComponent
from segmap.segments import SegmentMap

__all__ = ["BAR", "COLOURS", "LABEL", "MARGIN", "STROKE", "TITLE", "Place", "Sheet", "round_length", "title_of"]

COLOURS = ("#0b5394", "#c2410c", "#15803d", "#9d174d", "#a16207", "#0e7490", "#6d28d9", "#4b5563")
WIDEST = 1e7
"""metres"""
MARGIN, TITLE, LABEL, BAR, STROKE = 3.0, 2.6, 1.8, 0.5, 0.16
"""units, hundredths of the drawing's longer side"""
LETTER = 0.6
"""width of a letter, sizes of the font"""
EMPTY = 10.0
"""metres, the side of a sheet without segments"""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a component's box lies on the sheet: its upper left corner, metres from the sheet's."""

    component: MapComponent
    left: float
    top: float

    @property
    def origin(self) -> tuple[float, float]:
        """Where on the sheet the origin of the component's frame lies."""
        x1, _, _, y2 = _box(self.component.map)
        return self.left - x1, self.top + y2


@dataclass(frozen=True, slots=True)
class Sheet:
    """Components in rows, and the size that takes, metres."""

    places: tuple[Place, ...]
    width: float
    height: float
    unit: float
    """a hundredth of the widest row or tallest component: margins and letters are some of it"""

    @classmethod
    def of(cls, components: Sequence[MapComponent], small: bool = False) -> Sheet:
        """A sheet for some components; ``small``: for the lines only, without room for words.

        Raises:
            ExportError: the map is too large for a sheet.
        """
        sizes = [_size(component.map) for component in components]
        if not sizes:
            return cls((), EMPTY, EMPTY / 2, EMPTY / 100)
        widest = max(*(width for width, _ in sizes), 1.4 * math.sqrt(sum(w * h for w, h in sizes)), 0.1)
        longest = max(widest, *(height for _, height in sizes))
        if not longest < WIDEST:
            raise ExportError(f"The map is {longest:.3g} m wide, too large for a drawing: export it as geojson.")
        return cls._laid_out(components, widest, longest / 100.0, small)

    @classmethod
    def _laid_out(cls, components: Sequence[MapComponent], widest: float, unit: float, small: bool) -> Sheet:
        gap, head, foot = MARGIN * unit, 0.0 if small else (LABEL + 1.0) * unit, 0.0 if small else 3 * MARGIN * unit
        slots = [_slot(component, unit, small) for component in components]
        places: list[Place] = []
        top, right = gap if small else gap + 2 * TITLE * unit, 50.0 * unit
        for row in _rows(slots, widest + gap, gap):
            left = gap
            for i in row:
                places.append(Place(components[i], left, top + head))
                left += slots[i] + gap
            right, top = max(right, left), top + head + max(_size(components[i].map)[1] for i in row) + gap
        return cls(tuple(places), right, max(top + foot, 10.0 * unit), unit)


def _slot(component: MapComponent, unit: float, small: bool) -> float:
    """The width a component and its label take, metres."""
    width, _ = _size(component.map)
    return width if small else max(width, LETTER * LABEL * unit * len(component.name))


def _rows(slots: Sequence[float], widest: float, gap: float) -> list[list[int]]:
    """Which components stand in one row, in order."""
    rows: list[list[int]] = []
    taken = math.inf
    for i, slot in enumerate(slots):
        if taken + slot > widest:
            rows.append([])
            taken = 0.0
        rows[-1].append(i)
        taken += slot + gap
    return rows


def _box(map: SegmentMap) -> tuple[float, float, float, float]:
    return map.bounds or (0.0, 0.0, 0.0, 0.0)


def _size(map: SegmentMap) -> tuple[float, float]:
    x1, y1, x2, y2 = _box(map)
    return x2 - x1, y2 - y1


def round_length(most: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is at most this.

    >>> round_length(7.3), round_length(0.25)
    (5.0, 0.2)
    """
    power = 10.0 ** math.floor(math.log10(most))
    return float(f"{next(step for step in (5, 2, 1) if step * power <= most * (1 + 1e-9)) * power:.3g}")


def title_of(metadata: Mapping[str, str]) -> str:
    """What a drawing is called."""
    return metadata.get("title", "Segment map")
