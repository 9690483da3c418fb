"""Laying the second map of a pair by hand: dragged, or by pairs of segments; it settles on the best nearby."""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from app.claims import nudged_rank
from app.drawables import Pick
from app.errors import RequestError
from app.looks import Looks
from segmap.errors import ProjectError
from segmap.events import IntegrationId, Nudge
from segmap.placing import Tie, laid, settled
from segmap.pose import Pose2

if TYPE_CHECKING:
    from app.evidence import Evidence
    from app.session import Session

__all__ = ["FARTHEST", "Nudging", "nudged"]

FARTHEST = 1000.0
"""metres; no scan is laid farther from another"""
PAIRS = 2
"""pairs of segments that lay a map"""
SIDE_BY_SIDE = ("scans", "segments", "map")
"""stages in which the second map does not stand where a candidate puts it"""


def nudged(session: Session, integration: str, start: Pose2 | None = None, ties: Sequence[Tie] = ()) -> Nudge:
    """Where the second map comes to rest that is let go at ``start``, or laid by pairs of segments.

    Raises:
        MapError: there is no such pair of segments.
        RequestError: it is too far away.
    """
    state, pair = session.state, IntegrationId.parse(integration)
    maps = session.segment_map(pair.first), session.segment_map(pair.second)
    start = laid(*maps, ties, state.parameters) if start is None else start
    if max(abs(start.x), abs(start.y)) > FARTHEST:
        raise RequestError(f"A scan cannot be laid more than {FARTHEST:.0f} m from the other.")
    return Nudge(T_1_2=settled(*maps, start, state.parameters, state.mode), start=start, ties=tuple(ties))


class Nudging(ABC):
    """The hand in a view; what it moves is the view's."""

    session: Session
    who: str
    _acting: threading.RLock
    _evidence: Evidence
    _looks: Looks

    @abstractmethod
    def _look(self, looks: Looks) -> None: ...

    @abstractmethod
    def _change(self, **changes: Any) -> None: ...

    @abstractmethod
    def _stepping(self) -> AbstractContextManager[None]: ...

    def toggle_nudging(self) -> None:
        """Begin to lay the second map by hand, or stop."""
        with self._acting:
            self.set_nudging(not self._looks.nudging)

    def set_nudging(self, on: bool) -> None:
        """Whether the second map can be dragged, and laid by clicks on segments.

        Raises:
            ProjectError: there is no pair.
        """
        with self._acting:
            if self._looks.integration is None:
                raise ProjectError("There is no pair to lay by hand.")
            if self._looks.trial is not None:
                raise ProjectError("These parameters are on trial: apply them or put them back, then lay it by hand.")
            beside = self._looks.stage in ("scans", "map")
            stage = "candidate" if on and beside else self._looks.stage
            self._change(nudging=on, held=None, laying=(), picked=None, stage=stage)

    def hold(self, T_1_2: Pose2) -> None:
        """Hold the second map somewhere: what it is worth there is shown, and nothing is kept yet."""
        with self._acting:
            stage = "candidate" if self._looks.stage in SIDE_BY_SIDE else self._looks.stage
            if self._looks.nudging:
                self._change(held=T_1_2, stage=stage)

    def let_go(self) -> None:
        """Let the second map settle on the best nearby; there it is a candidate, which can be accepted or undone."""
        with self._acting:
            if self._looks.held is not None:
                self._keep(start=self._looks.held)

    def lay(self, pick: Pick | None) -> None:
        """Lay the second map by the segments clicked: one of a map, its partner in the other, and two more."""
        with self._acting:
            taken = _taken(self._looks.laying, pick)
            if len(taken) < 2 * PAIRS:
                self._change(laying=taken)
            else:
                self._keep(ties=_ties(taken))

    @property
    def partners(self) -> tuple[str, ...]:
        """The maps of which a segment can be clicked next."""
        laying = self._looks.laying
        return ("first", "second") if len(laying) % 2 == 0 else (_other(laying[-1].source),)

    def _keep(self, start: Pose2 | None = None, ties: Sequence[Tie] = ()) -> None:
        looks, here = self._looks, self._looks.integration
        assert here is not None
        nudge = nudged(self.session, here, start, ties)
        with self._stepping():
            self.session.nudge(here, nudge, who=self.who, reason=looks.reason)
        stage = "candidate" if looks.stage in SIDE_BY_SIDE else looks.stage
        shown = replace(looks, held=None, laying=(), picked=None, stage=stage)
        match, held = self._evidence.match(shown), self.session.state.proposals.get(here)
        rank = nudged_rank(match, held) if match and held else None
        known = rank is not None and match is not None and match.ranked[rank].index >= 0
        self._look(replace(shown, rank=rank or 0, notice=_told(nudge, rank if known else None)))


def _taken(before: tuple[Pick, ...], pick: Pick | None) -> tuple[Pick, ...]:
    """The clicks with one more: none takes the last back, one on the same map replaces a segment without partner."""
    if pick is None:
        return before[:-1]
    if len(before) % 2 and before[-1].source == pick.source:
        return (*before[:-1], pick)
    return (*before, pick)


def _ties(clicks: Sequence[Pick]) -> list[Tie]:
    pairs = zip(clicks[::2], clicks[1::2], strict=True)
    return [(a.segment, b.segment) if a.source == "first" else (b.segment, a.segment) for a, b in pairs]


def _other(source: str) -> str:
    return "second" if source == "first" else "first"


def _told(nudge: Nudge, rank: int | None) -> str:
    """``rank``: of the candidate that was found already where it settled."""
    distance, turn = nudge.T_1_2.distance(nudge.start)
    where = "Laid by the segments" if nudge.ties else "Let go"
    known = "" if rank is None else f", on candidate {rank + 1}"
    moved = f"{100.0 * distance:.0f} cm and {math.degrees(turn):.1f}°"
    return f"{where}, it settled {moved} from there{known}. Accept it, or undo."
