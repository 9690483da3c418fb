"""What the buttons of the merged map do: colours, components, another map to compare with, measuring."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from app.drawing import Picture
from app.errors import RequestError, UnknownError
from app.looks import Looks
from app.map_looks import COLOURINGS, SIDES
from app.picking import corner
from segmap.scans import ScanId

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["MapActions", "known"]


class MapActions(ABC):
    """The actions of a view on the merged map; what they act on is the view's."""

    session: Session
    _acting: threading.RLock
    _looks: Looks

    @abstractmethod
    def _change(self, **changes: Any) -> None: ...

    @abstractmethod
    def fit(self) -> None: ...

    def _measure(self, picture: Picture, x: float, y: float, reach: float) -> None:
        """Take a place to measure from or to; the third begins again. Ends of segments nearby are meant."""
        place = corner(picture, x, y, reach) or (x, y)
        with self._acting:
            held = self._looks.measured if len(self._looks.measured) == 1 else ()
            self._change(measured=(*held, place))

    def toggle_measuring(self) -> None:
        """Let clicks measure, or look at segments again."""
        with self._acting:
            self._change(measuring=not self._looks.measuring, measured=(), picked=None)

    # --- the merged map ---------------------------------------------------------------------------

    def set_colouring(self, colouring: str) -> None:
        """What the colours of the merged map say, one of COLOURINGS; looks at the map."""
        known(colouring, tuple(COLOURINGS), "colouring")
        self._look_at_map(colouring=colouring)

    def toggle_component(self, first: str) -> None:
        """Show a component of the map, named by its first scan, or hide it."""
        with self._acting:
            scan, looks = self._first(first), self._looks.map
            self._look_at_map(hidden=looks.showing(scan, scan in looks.hidden).hidden)

    def isolate(self, first: str) -> None:
        """Show only one component, named by its first scan; all again where it is the only one shown already."""
        with self._acting:
            others = {part.scans[0] for part in self.session.components()} - {self._first(first)}
            alone = self._looks.map.hidden >= others and self._first(first) not in self._looks.map.hidden
            self._look_at_map(hidden=frozenset() if alone else frozenset(others))
            self.fit()

    def set_compare(self, name: str) -> None:
        """Compare the merged map with another one, by name; with none where the name is empty."""
        if name:
            self.session.others.check(name)
        self._look_at_map(compare=name)
        self.fit()

    def set_side(self, side: str) -> None:
        """Draw the other map beside the merged one, or over it."""
        known(side, SIDES, "place")
        self._look_at_map(side=side)
        self.fit()

    def _first(self, name: str) -> ScanId:
        found = next((part.scans[0] for part in self.session.components() if str(part.scans[0]) == name), None)
        if found is None:
            raise UnknownError(f"The map has no component that begins with scan {name[:40]!r} (any more).")
        return found

    def _look_at_map(self, **changes: Any) -> None:
        with self._acting:
            self._change(stage="map", picked=None, map=replace(self._looks.map, **changes), **self._left())

    def _left(self) -> dict[str, Any]:
        """What was measured in another stage means nothing in the map."""
        return {} if self._looks.stage == "map" else {"measured": ()}


def known(value: object, among: Sequence[object], what: str) -> None:
    """Raise RequestError where a value is none of those that can be chosen."""
    if value not in among:
        raise RequestError(f"There is no {what} {str(value)[:80]!r}: take one of {', '.join(map(str, among))}.")
