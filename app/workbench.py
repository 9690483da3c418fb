"""One page's view of a project: what it looks at, and what its buttons do (no viser).

The session holds the truth. A view holds one immutable :class:`~app.looks.Looks`; actions replace it,
one after the other, and everybody who subscribed is told: ``{"type": "view", **snapshot}``. Session
events take none of the view's locks, so a session may send them while it holds its own.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from app.actions import perform
from app.content import Content
from app.drawables import Pick
from app.drawing import LAYERS, STAGES, Picture, draw, layers
from app.errors import UnknownError
from app.evidence import Evidence
from app.explaining import explained
from app.graph_layers import TIES
from app.judging import Judging
from app.listeners import Listeners
from app.looks import Looks
from app.map_view import MapActions, known
from app.nudging import Nudging
from app.palette import THEMES
from app.picking import nearest
from app.snapshot import snapshot
from app.trying import Trying
from segmap.events import Decision
from segmap.integration import Match, heuristics
from segmap.pose import FloatArray
from segmap.scans import ScanId

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["View"]

DOUBLE_CLICK_SECONDS = 0.35
"""a decision so soon after the last one was meant for the pair that has just gone"""
RELEVANT = ("decision", "map", "graph", "parameters", "log", "other")
"""session events after which a view may look different"""


class View(MapActions, Judging, Nudging, Trying):
    """What one page shows of a session. Thread-safe; actions raise SegmapError with a sentence for people."""

    def __init__(self, session: Session, *, who: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        self.session = session
        self.who = who
        self._clock = clock
        self._listed: tuple[str, ...] | None = None
        self._evidence = Evidence(session)
        self._acting = threading.RLock()
        self._looks = Looks()
        self._listeners = Listeners()
        self.subscribe = self._listeners.add
        self._serials, self._trials = itertools.count(1), itertools.count(1)
        self._seen = session.state.revision
        self._unsubscribe = session.subscribe(self._hear)
        rows = session.rows()
        if rows:
            self.select(rows[0].id)

    # --- what is shown ----------------------------------------------------------------------------

    @property
    def looks(self) -> Looks:
        """What is looked at now."""
        return self._looks

    def content(self) -> Content:
        """All that the picture is made from, now."""
        return self._evidence.content(self._looks)

    def walls_of(self, scan: ScanId) -> FloatArray:
        """The segments of a scan in its own frame, (n, 4), metres."""
        return self.session.segment_map(scan).coordinates

    def picture(self) -> Picture:
        """What is to be drawn now."""
        return draw(self.content())

    def snapshot(self) -> dict[str, Any]:
        """What the panel and the page show now, as JSON.

        Snapshots are made in several threads and may arrive in another order. The serial is taken before
        anything is looked at, so the one with the greatest serial is the newest.
        """
        serial, looks = next(self._serials), self._said(self._looks)
        shown = snapshot(self.session, self._evidence, looks, self._evidence.content(looks))
        return {"serial": serial, "who": self.who, **shown}

    def match(self) -> Match | None:
        """The match that is looked at: of the project, or of parameters on trial; None: not computed yet."""
        return self._evidence.match(self._looks)

    def explanation(self) -> dict[str, Any] | None:
        """Why the candidate shown has its value and its score; None where none is shown."""
        return explained(self.content())

    def close(self) -> None:
        """Stop listening to the session."""
        self._unsubscribe()

    # --- choosing what to look at -----------------------------------------------------------------

    def select(self, integration: str) -> None:
        """Look at an integration: at the candidate that was decided on, or our own search proposes, or else the best.

        Raises:
            UnknownError: the project has no such integration.
        """
        with self._acting:
            self._look(self._at(integration))

    def _at(self, integration: str, notice: str = "") -> Looks:
        if integration not in self.session.integrations:
            raise UnknownError(f"The project has no integration {integration[:80]!r}.")
        decision = self.session.state.decisions.get(integration)
        heuristic = decision.heuristic if decision and decision.heuristic in self._heuristics else None
        suggested = self.session.suggested
        rank = self._rank_of(integration, heuristic, decision) if decision else suggested(integration, heuristic)
        return replace(self._looks.at(integration, heuristic, rank), notice=notice)

    def _rank_of(self, integration: str, heuristic: str | None, decision: Decision) -> int:
        """The candidate that was decided on; a pose that was claimed has no rank of its own."""
        match = None if decision.candidate is not None else self.session.match(integration, heuristic)
        found = enumerate(match.ranked if match else ())
        return next((rank for rank, one in found if one.T_1_2 == decision.T_1_2), decision.candidate or 0)

    def set_order(self, integrations: Sequence[str] | None) -> None:
        """Step and go on through these integrations only, in this order; None: through the whole queue, in its own.

        It is what the page lists, filtered, searched and sorted.
        """
        with self._acting:
            self._listed = None if integrations is None else tuple(integrations)

    def _order(self) -> tuple[str, ...]:
        """What the person steps through."""
        if self._listed is None:
            return tuple(row.id for row in self.session.rows())
        known = set(self.session.integrations)
        return tuple(id for id in self._listed if id in known)

    def next(self) -> None:
        """The next integration of the queue; after the last comes the first."""
        self._step(1)

    def previous(self) -> None:
        """The integration before this one in the queue."""
        self._step(-1)

    def _step(self, step: int) -> None:
        with self._acting:
            ids = self._order()
            if ids:
                place = ids.index(self._looks.integration) if self._looks.integration in ids else -step
                self.select(ids[(place + step) % len(ids)])

    def next_candidate(self) -> None:
        """The next best candidate."""
        self.set_candidate(self._rank() + 1)

    def previous_candidate(self) -> None:
        """The candidate that ranks before this one."""
        self.set_candidate(self._rank() - 1)

    def set_candidate(self, rank: int) -> None:
        """Look at the candidate of a rank, 0 for the best; beyond the ends the last one stays."""
        with self._acting:
            last = max(0, self._count() - 1)
            self._change(rank=min(max(0, rank), last), picked=None)

    def _count(self) -> int:
        match = self._evidence.match(self._looks)
        return len(match.ranked) if match else 0

    def _rank(self) -> int:
        return min(self._looks.rank, max(0, self._count() - 1))

    def next_heuristic(self) -> None:
        """What the next heuristic finds on this pair; after the last comes the first."""
        self._turn_heuristic(1)

    def previous_heuristic(self) -> None:
        """What the heuristic before this one finds on this pair."""
        self._turn_heuristic(-1)

    def _turn_heuristic(self, step: int) -> None:
        with self._acting:
            names = self._heuristics
            place = names.index(self._evidence.heuristic(self._looks))
            self.set_heuristic(names[(place + step) % len(names)])

    @property
    def _heuristics(self) -> tuple[str, ...]:
        """Those of the project's mode."""
        return heuristics(self.session.state.mode)

    def set_heuristic(self, heuristic: str) -> None:
        """Look at what a heuristic finds on this pair; the project's heuristic stays what it is."""
        known(heuristic, self._heuristics, "heuristic")
        with self._acting:
            self._look(self._looks.at(self._looks.integration, heuristic))

    def set_stage(self, stage: str) -> None:
        """Look at a stage, one of STAGES."""
        known(stage, STAGES, "stage")
        self._change(stage=stage, picked=None, measured=())

    def next_stage(self) -> None:
        """The next stage; the last stays."""
        self._turn_stage(1)

    def previous_stage(self) -> None:
        """The stage before this one; the first stays."""
        self._turn_stage(-1)

    def _turn_stage(self, step: int) -> None:
        with self._acting:
            place = STAGES.index(self._looks.stage) + step
            self.set_stage(STAGES[min(max(0, place), len(STAGES) - 1)])

    # --- how to look at it ------------------------------------------------------------------------

    def toggle_layer(self, layer: str) -> None:
        """Draw a layer of this stage, or stop drawing it."""
        with self._acting:
            shown = {one.name: one.visible for one in layers(self.content())}
            self.switch_layer(layer, not shown.get(layer, False))

    def switch_layer(self, layer: str, on: bool) -> None:
        """Draw a layer of this stage or not."""
        known(layer, LAYERS, "layer")
        with self._acting:
            self._look(self._looks.switch(layer, on))

    def set_dimension(self, dimension: int) -> None:
        """Look straight down (2) or from the side (3)."""
        known(dimension, (2, 3), "dimension")
        self._change(dimension=dimension)

    def toggle_dimension(self) -> None:
        """From 2D to 3D, or back."""
        with self._acting:
            self.set_dimension(5 - self._looks.dimension)

    def set_theme(self, theme: str) -> None:
        """Draw on a light or on a dark background."""
        known(theme, THEMES, "theme")
        self._change(theme=theme)

    def fit(self) -> None:
        """Bring everything into sight."""
        with self._acting:
            self._change(fits=self._looks.fits + 1)

    def pick(self, x: float, y: float, reach: float) -> None:
        """Look at the segment nearest to a place, at most ``reach`` metres away; at none if none is there.

        In the map, a click on the line of an integration selects it.
        """
        content = self.content()
        if self._looks.measuring:
            self._measure(draw(content), float(x), float(y), float(reach))
            return
        if self._looks.nudging:
            self.lay(nearest(draw(content), float(x), float(y), float(reach), self.partners))
            return
        picked = nearest(draw(content), float(x), float(y), float(reach))
        if picked is not None and picked.source == TIES:
            self.select(content.ties[picked.segment].integration)
        else:
            self._change(picked=picked)

    def set_picked(self, source: str | None, segment: int = 0) -> None:
        """Look at a segment: of ``first``, of ``second``, of a component of the map; None: at none."""
        self._change(picked=None if source is None else Pick(source, segment))

    def say(self, notice: str) -> None:
        """Show a sentence until the next action."""
        self._change(notice=notice)

    def act(self, action: str, value: Any = None) -> dict[str, Any]:
        """Do what a page asks for, by name; the snapshot afterwards.

        Raises:
            RequestError: there is no such action, or it cannot be done with this value.
        """
        perform(self, action, value)
        return self.snapshot()

    # --- keeping in step --------------------------------------------------------------------------

    def _change(self, **changes: Any) -> None:
        with self._acting:
            self._news = None
            self._look(replace(self._looks, **{"notice": "", **changes}))

    def _present(self, looks: Looks) -> Looks:
        """The same, or the first pair of the queue where there is none, or it was taken out of the queue."""
        if looks.integration in self.session.integrations:
            return looks
        rows = self.session.rows()
        return looks.at(rows[0].id) if rows else replace(looks, integration=None)

    def _look(self, looks: Looks) -> None:
        """Look at something else, and tell everybody."""
        if looks.integration != self._looks.integration:
            self._news = None
        self._looks = self._present(looks)
        self._tell()

    def _hear(self, event: Mapping[str, Any]) -> None:
        """A session event: a match for what is looked at, or a change of what is decided."""
        kind = event.get("type")
        if kind == "decision":
            self._heard(event)
        if kind in RELEVANT or (kind == "match" and event.get("integration") == self._looks.integration):
            self._tell()

    def _tell(self) -> None:
        """Have what is looked at computed where it is not known, and tell everybody what there is."""
        looks = self._present(self._looks)
        if looks is not self._looks:
            self._looks = looks
        if looks.integration is not None and self._evidence.unknown(looks):
            self.session.request(looks.integration, self._evidence.heuristic(looks))
        self._seen = self.session.state.revision
        self._listeners.tell({"type": "view", **self.snapshot()})
