"""What is known of the integration a view looks at: the session's results, and what follows from them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from app.claims import NUDGED
from app.content import Content, Pair, Tie
from app.drawing import LAYERS_OF
from app.listing import Listed
from app.looks import Looks
from app.map_looks import MapContent
from app.review import Row
from app.sights import sights
from segmap.chains import matching_chains
from segmap.fusion import fuse
from segmap.integration import Candidate, Match, heuristics
from segmap.merging import Component, misfit
from segmap.placing import judged_at
from segmap.pose import FloatArray, Pose2
from segmap.project import IntegrationId, ProjectState
from segmap.scans import ScanId

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["Evidence", "scan_name"]

KEPT = 64
"""candidates whose chains are remembered"""
QUEUES = 4
"""queues whose ties are remembered"""
SAME_POSE = 1e-6
"""metres, radians"""


def scan_name(scan: ScanId, state: ProjectState) -> str:
    """A scan's name for people; with its log's name where there are several logs."""
    if len(state.logs) < 2:
        return f"scan {scan.scan}"
    return f"{state.logs[scan.log].name}, scan {scan.scan}"


@lru_cache(QUEUES)
def _ties(listed: Listed) -> tuple[Tie, ...]:
    """The lines of the map; the same object for the same queue, whoever looks at it."""
    return tuple(map(_tie, filter(_is_tie, listed.rows)))


def _is_tie(row: Row) -> bool:
    return row.state == "accepted" or (row.state == "pending" and row.kind != "neighbour")


def _tie(row: Row) -> Tie:
    decided = row.who, row.value, row.confidence
    return Tie(row.id, row.first, row.second, row.state == "accepted", row.chi, row.silenced, *decided)


def _found(match: Match) -> dict[str, Any]:
    """What a pair shows of its match."""
    told = {name: getattr(match, name) for name in ("ranked", "confidence", "reasons")}
    return {**told, "verdict": str(match.verdict)}


class Evidence:
    """The content of a view's picture; what takes time is computed once for each candidate. Thread-safe."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._chains = lru_cache(KEPT)(matching_chains)
        self._fused = lru_cache(KEPT)(fuse)
        self._sights = lru_cache(KEPT)(sights)
        self._misfit = lru_cache(KEPT)(self._misfit_of)

    def match(self, looks: Looks) -> Match | None:
        """The match of the integration looked at, by the heuristic looked at; None: not computed yet."""
        if looks.trial is not None:
            return looks.trial.match
        if looks.integration is None:
            return None
        return self._session.match(looks.integration, self.heuristic(looks))

    def unknown(self, looks: Looks) -> bool:
        """Whether there is a match to be computed: none is there, and none has failed."""
        integration, heuristic = looks.integration, self.heuristic(looks)
        known = looks.trial is not None or integration is None
        return not known and self._session.outcome(str(integration), heuristic) is None

    def heuristic(self, looks: Looks) -> str:
        """The heuristic looked at, by name; the project's, where its mode does not know the one looked at."""
        state = self._session.state
        return looks.heuristic if looks.heuristic in heuristics(state.mode) else state.heuristic

    def content(self, looks: Looks) -> Content:
        """All that the picture is made from."""
        pair = self._pair(looks)
        return Content(
            stage=looks.stage,
            pair=pair,
            components=tuple(self._session.components()) if looks.stage == "map" else (),
            ties=_ties(self._session.listed) if looks.stage == "map" else (),
            scans=len(self._session.scan_ids),
            dimension=looks.dimension,
            theme=looks.theme,
            shown=looks.shown,
            picked=looks.picked,
            held=looks.held,
            laying=looks.laying,
            message=self._message(looks, pair),
            map=self._map(looks),
            measured=looks.measured,
        )

    def _map(self, looks: Looks) -> MapContent:
        """How the merged map is looked at, with what that takes."""
        if looks.stage != "map":
            return MapContent(looks.map)
        off = {}
        if looks.map.colouring == "misfit":
            off = {part.name: self._misfit(part) for part in self._session.components() if len(part.scans) > 1}
        return MapContent(looks.map, off, self._session.others.get(looks.map.compare) if looks.map.compare else None)

    def _misfit_of(self, part: Component) -> FloatArray:
        return misfit(part, {scan: self._session.segment_map(scan) for scan in part.scans})

    def _pair(self, looks: Looks) -> Pair | None:
        if looks.integration is None:
            return None
        session, state, match = self._session, self._session.state, self.match(looks)
        scans = IntegrationId.parse(looks.integration)
        parameters = looks.trial.parameters if looks.trial else state.parameters
        maps = (
            looks.trial.maps if looks.trial else (session.segment_map(scans.first), session.segment_map(scans.second))
        )
        reach = parameters.max_range
        pair = Pair(
            integration=looks.integration,
            scans=(scans.first, scans.second),
            names=(scan_name(scans.first, state), scan_name(scans.second, state)),
            maps=maps,
            returns=(session.scan(scans.first).returns(reach)[0], session.scan(scans.second).returns(reach)[0]),
            parameters=parameters,
            **({} if match is None else _found(match)),
        )
        if looks.held is not None:
            return self._held(pair, looks.held, looks)
        if not pair.ranked:
            return pair
        return self._at_candidate(pair, pair.ranked[min(looks.rank, len(pair.ranked) - 1)], looks)

    def _held(self, pair: Pair, T_1_2: Pose2, looks: Looks) -> Pair:
        """While it is dragged: what the place where it is held is worth, now; nothing of it is remembered."""
        held = judged_at(*pair.maps, T_1_2, pair.parameters, self._session.state.mode, NUDGED)
        chains = matching_chains(*pair.maps, T_1_2, pair.parameters)
        seen = sights(*pair.maps, T_1_2, pair.parameters) if "sights" in LAYERS_OF[looks.stage] else None
        return replace(pair, candidate=held, chains=chains, sights=seen)

    def _at_candidate(self, pair: Pair, candidate: Candidate, looks: Looks) -> Pair:
        chains = self._chains(*pair.maps, candidate.T_1_2, pair.parameters)
        fusion = None
        if looks.stage == "fused":
            fusion = self._fused(*pair.maps, candidate.T_1_2, chains, pair.parameters)
        seen = None
        if "sights" in LAYERS_OF[looks.stage]:
            seen = self._sights(*pair.maps, candidate.T_1_2, pair.parameters)
        return replace(pair, candidate=candidate, chains=chains, fusion=fusion, sights=seen)

    def _message(self, looks: Looks, pair: Pair | None) -> str:
        """Why there is less to see than one might expect, or something else; empty where there is no reason to ask."""
        if looks.stage == "map":
            return self._about_map()
        if pair is None:
            return "There is no pair to look at: the project has fewer than two scans."
        match = self.match(looks)
        if match is None:
            return self._unmatched(looks, pair)
        return self._elsewhere(pair) if match.ranked else " ".join(match.reasons)

    def _about_map(self) -> str:
        if self._session.components():
            return ""
        accepted = any(decision.verdict == "accepted" for decision in self._session.state.decisions.values())
        return "The merged map is being computed." if accepted else "Nothing is accepted yet: the merged map is empty."

    def _unmatched(self, looks: Looks, pair: Pair) -> str:
        outcome = self._session.outcome(pair.integration, self.heuristic(looks))
        if outcome is not None and outcome.failure:
            return outcome.failure
        return f"{pair.names[0]} and {pair.names[1]} are being matched."

    def _elsewhere(self, pair: Pair) -> str:
        """A word on a decision that was made on another pose than the one shown."""
        decision = self._session.state.decisions.get(pair.integration)
        if decision is None or decision.T_1_2 is None or pair.candidate is None or pair.rank is None:
            return ""
        distance, turn = decision.T_1_2.distance(pair.candidate.T_1_2)
        if max(distance, turn) < SAME_POSE:
            return ""
        x, y, degrees = decision.T_1_2.x, decision.T_1_2.y, math.degrees(decision.T_1_2.theta)
        return f"This pair was {decision.verdict} at another pose: x {x:.2f} m, y {y:.2f} m, θ {degrees:.1f}°."
