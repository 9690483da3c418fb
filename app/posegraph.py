"""The pose graph over what is accepted: poses that fit all of it best, and how each integration fares in it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from app.jobs import Check, Latest
from app.pairs import are_neighbours
from app.review import Fate
from segmap.events import Covariance, Decision, IntegrationId
from segmap.graph import (
    Edge,
    Loop,
    Optimised,
    Part,
    Preview,
    Residual,
    Strength,
    explain,
    loop_of,
    optimise,
    preview,
    strength_of,
)
from segmap.merging import Accepted
from segmap.pose import Pose2
from segmap.project import ProjectState
from segmap.scans import ScanId

__all__ = ["Firmness", "Graph", "PoseGraph", "Solver", "edge", "edges_of", "graph_of", "placed"]

DEVIATION = 0.1, math.radians(2.0)
"""metres and radians; what is taken for a pose nobody says how well it is known"""
UNTOLD: Covariance = (
    (DEVIATION[0] ** 2, 0.0, 0.0),
    (0.0, DEVIATION[0] ** 2, 0.0),
    (0.0, 0.0, DEVIATION[1] ** 2),
)


EDGES = 16_384
"""that are remembered"""
LOOPS = 12
"""loops of each component that are looked at for the one that misses itself most"""
FAR_OFF = 0.4
"""metres; an integration farther from where the others have it is not believed, however little it claims to know:
right closures of public logs are at most 0.34 m off"""


@lru_cache(EDGES)
def edge(integration: str, T_1_2: Pose2, covariance: Covariance | None) -> Edge:
    """An integration as an edge of the graph; the same object for the same, as edges are compared again and again."""
    pair = IntegrationId.parse(integration)
    return Edge(pair.first, pair.second, T_1_2, covariance or UNTOLD)


def edges_of(state: ProjectState) -> tuple[Edge, ...]:
    """What is accepted, in the order of the scans."""
    made = (_edge(decision) for decision in state.decisions.values() if decision.verdict == "accepted")
    return tuple(sorted((one for one in made if one is not None), key=lambda one: (one.first, one.second)))


def _edge(decision: Decision) -> Edge | None:
    return None if decision.T_1_2 is None else edge(decision.integration, decision.T_1_2, decision.covariance)


def placed(edges: tuple[Edge, ...], optimised: Optimised) -> tuple[Accepted, ...]:
    """What is accepted as the graph has it: the poses of the merged map.

    Where no loop is closed there is nothing to weigh: each integration is as it was accepted, to the last bit.
    """
    count = [-len(part) for part in optimised.components]
    number = {scan: i for i, part in enumerate(optimised.components) for scan in part}
    for one in edges:
        count[number[one.first]] += 1
    poses = optimised.poses

    def fitted(one: Edge) -> Pose2:
        closes = count[number[one.first]] >= 0  # a tree has one edge less than scans
        return poses[one.first].inverse() @ poses[one.second] if closes else one.T_1_2

    return tuple((one.first, one.second, fitted(one)) for one in edges)


class Solver:
    """Optimises edges, and remembers the last result: the graph and the merged map ask for the same, and of what comes
    next only the components that changed are optimised. Thread-safe.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: tuple[tuple[Edge, ...], Optimised] | None = None

    def __call__(self, edges: tuple[Edge, ...], check: Check | None = None) -> Optimised:
        """The poses that fit the edges best; the same for the same edges."""
        with self._lock:
            if self._held is None or self._held[0] != edges:
                before = self._held[1] if self._held else None
                self._held = edges, optimise(edges, most=FAR_OFF, known=before, check=check)
            return self._held[1]


@dataclass(frozen=True, eq=False)
class Graph:
    """What the optimiser makes of the integrations accepted at a revision."""

    revision: int
    edges: tuple[Edge, ...]
    optimised: Optimised
    firmness: tuple[Firmness, ...]
    """of every component"""

    @cached_property
    def residuals(self) -> Mapping[str, Residual]:
        """How each accepted integration fares, by name."""
        return {residual.edge.name: residual for residual in self.optimised.residuals}

    def fate(self, integration: str, T_1_2: Pose2 | None) -> Fate | None:
        """How far a pose of an integration is from where the graph has it; None where the graph says nothing."""
        held = self.residuals.get(integration)
        if held is not None and held.edge.T_1_2 == T_1_2:
            return Fate(held.translation, held.rotation, held.chi, held.silenced)
        pair = IntegrationId.parse(integration)
        part = self.part(*pair)
        if T_1_2 is None or part is None:
            return None
        return Fate(*T_1_2.distance(part.poses[pair.first].inverse() @ part.poses[pair.second]))

    def part(self, first: ScanId, second: ScanId) -> Part | None:
        """The component that holds both scans: all that the graph says of the two depends on it alone."""
        found = self.optimised.part_of(first)
        return found if found is not None and second in found.poses else None

    def explained(self, integration: str) -> tuple[str, ...]:
        """What the graph says of an accepted integration, in words; nothing of others."""
        residual = self.residuals.get(integration)
        part = None if residual is None else self.optimised.part_of(residual.edge.first)
        return () if residual is None or part is None else explain(self.optimised, residual, part.ways)

    def preview(self, candidate: Edge) -> Preview:
        """What would come of accepting one more integration, or of this one at another pose."""
        others = tuple(one for one in self.edges if one.name != candidate.name)
        return preview(others, candidate, self.optimised, most=FAR_OFF)

    def to_json(self) -> dict[str, Any]:
        """As the pages get it: strength by component, and what is silenced, in words."""
        silenced = [{"id": r.edge.name, "sentence": self.explained(r.edge.name)[0]} for r in self.optimised.silenced]
        return {
            "revision": self.revision,
            "edges": len(self.edges),
            "silenced": silenced,
            "strengths": [one.to_json() for one in self.firmness],
        }


def _follow(one: Edge) -> bool:
    return are_neighbours(min(one.first, one.second), max(one.first, one.second))


@dataclass(frozen=True, eq=False)
class Firmness:
    """How firmly a component holds together."""

    part: Part
    strength: Strength
    loop: Loop | None
    """the one that misses itself most, of those that the integrations farthest off close"""

    @classmethod
    def of(cls, part: Part) -> Firmness:
        """The firmness of a component."""
        counting = (one for one in part.residuals if not one.silenced and not _follow(one.edge))
        asked = sorted(counting, key=lambda residual: -residual.translation)[:LOOPS]
        found = [loop for residual in asked if (loop := loop_of(residual.edge, part.ways)) is not None]
        return cls(part, strength_of(part), max(found, key=lambda loop: loop.translation, default=None))

    def to_json(self) -> dict[str, Any]:
        """As the pages get it."""
        held, worst = self.strength, self.loop
        return {
            "loop": worst.edge.name if worst else None,
            "loop_scans": len(worst.scans) if worst else 0,
            "loop_error": worst.translation if worst else None,
            "loop_turn": worst.rotation if worst else None,
            "first": str(held.scans[0]),
            "scans": len(held.scans),
            "edges": held.edges,
            "bridges": [bridge.name for bridge in held.bridges],
            "hanging": len(held.hanging),
            "cut": [cut.name for cut in held.cut],
            "cut_off": len(held.cut_off),
            "softest": str(held.softest),
            "deviation": held.deviation,
        }


def graph_of(state: ProjectState, solve: Solver, check: Check | None = None, before: Graph | None = None) -> Graph:
    """The graph of everything accepted in a project; of the one ``before`` what did not change is taken."""
    edges = edges_of(state)
    optimised = solve(edges, check)
    held = {one.part: one for one in before.firmness} if before else {}
    return Graph(
        state.revision, edges, optimised, tuple(held.get(part) or Firmness.of(part) for part in optimised.parts)
    )


class PoseGraph:
    """Keeps the graph of a project up to date, in a thread of its own."""

    def __init__(
        self,
        state: Callable[[], ProjectState],
        solve: Solver,
        done: Callable[[], None],
        prepare: Callable[[Check], None],
    ) -> None:
        self._state, self._solve, self._done, self._prepare = state, solve, done, prepare
        self.current = Graph(0, (), optimise(()), ())
        self._latest = Latest(self._optimise, "optimising")
        self.ask, self.settle, self.close = self._latest.ask, self._latest.settle, self._latest.close

    @property
    def busy(self) -> bool:
        """Whether the graph is being optimised, or is about to be."""
        return self._latest.busy

    def _optimise(self, check: Check) -> None:
        self._prepare(check)
        self.current = graph_of(self._state(), self._solve, check, self.current)
        self._done()
