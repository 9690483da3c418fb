"""Loop closures of an open project: the search for them, the pose graph, and what accepting one would do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from app.deciding import covariance_at
from app.jobs import Check
from app.kept import ResultStore
from app.posegraph import Graph, PoseGraph, Solver, edge
from app.searching import WORKERS, Found, LoopSearch, Searching, find_closures
from segmap.errors import ParameterError, ProjectError
from segmap.graph import Preview
from segmap.spreading import Told

if TYPE_CHECKING:
    from app.session import Session

__all__ = ["Loops"]


class Loops:
    """The search and the graph of one session, each in a thread of its own.

    ``optimised`` hears of each new graph, ``searching`` of progress; ``take`` puts what a search found into
    the project and says in a sentence what came of it.
    """

    def __init__(
        self,
        session: Session,
        store: ResultStore,
        *,
        solve: Solver,
        prepare: Callable[[Check], None],
        take: Callable[[Found], str],
        optimised: Callable[[], None],
        searching: Callable[[dict[str, Any]], None],
        workers: int = WORKERS,
    ) -> None:
        self._session, self._prepare, self._take, self._workers = session, prepare, take, workers
        self._store = store
        self._graph = PoseGraph(lambda: session.state, solve, optimised, prepare)
        self._search = LoopSearch(self._find, lambda: searching({"type": "search", **self.progress.to_json()}))
        self.start, self.cancel = self._search.start, self._search.cancel
        self.optimise = self._graph.ask

    @property
    def progress(self) -> Searching:
        """How far the search is; what came of the last one where none runs."""
        return self._search.progress

    @property
    def graph(self) -> Graph:
        """The pose graph of what is accepted, as last optimised."""
        return self._graph.current

    @property
    def optimising(self) -> bool:
        """Whether the pose graph is being optimised again."""
        return self._graph.busy

    def preview(self, integration: str, heuristic: str | None = None, rank: int = 0) -> Preview | None:
        """What accepting a candidate would do to the graph; None where the pair has no candidates, or none yet.

        Raises:
            ProjectError: there are others, but not this one.
        """
        try:
            match = self._session.match(integration, heuristic)
        except ParameterError:  # the heuristic is one of a mode that was left meanwhile
            return None
        if match is None or not match.ranked:
            return None
        if rank >= len(match.ranked):
            raise ProjectError(f"{integration} has no candidate of rank {rank}: it has {len(match.ranked)}, from 0.")
        candidate, claim = match.ranked[rank], self._session.state.proposals.get(integration)
        return self.graph.preview(edge(integration, candidate.T_1_2, covariance_at(candidate, claim)))

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until no search runs and the graph is optimised; False when the time, in seconds, ran out before."""
        return self._search.settle(timeout) and self._graph.settle(timeout)

    def close(self) -> None:
        """Stop both."""
        self._search.close()
        self._graph.close()

    def _find(self, progress: Told, check: Check) -> str:
        self._prepare(check)
        session = self._session
        found = find_closures(
            session.state,
            session.scan_ids,
            session.extractor,
            store=self._store,
            workers=self._workers,
            progress=progress,
            check=check,
        )
        check()
        return self._take(found)
