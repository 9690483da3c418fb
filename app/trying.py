"""Parameters on trial: what they would make of the pair that is looked at; the project's stay what they are."""

from __future__ import annotations

import itertools
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from app.looks import Looks, Trial
from segmap.errors import CancelledError, ProjectError
from segmap.events import IntegrationId
from segmap.integration import match_maps
from segmap.parameters import Parameters
from segmap.segments import SegmentMap, extract

if TYPE_CHECKING:
    from app.evidence import Evidence
    from app.session import Session

__all__ = ["Trying"]


class Trying(ABC):
    """The trials of a view; what they look at is the view's."""

    session: Session
    _acting: threading.RLock
    _evidence: Evidence
    _looks: Looks
    _trials: itertools.count[int]
    _newest = 0

    @abstractmethod
    def _change(self, **changes: Any) -> None: ...

    def try_parameters(self, changes: Mapping[str, Any] | None) -> None:
        """Show what other parameters would make of the pair looked at; None: those of the project again.

        The newest call wins: one that is still at work stops, and shows nothing.

        Raises:
            ParameterError: a name is unknown, or a value impossible.
            ProjectError: there is no pair.
        """
        number = self._newest = next(self._trials)
        looks = self._looks
        if changes is None:
            if looks.trial is not None:
                self._change(trial=None)
            return
        parameters = self.session.state.parameters.replace(**changes)
        if looks.integration is None:
            raise ProjectError("There is no pair to try parameters on.")
        try:
            trial = self._tried(looks.integration, self._evidence.heuristic(looks), parameters, number)
        except CancelledError:
            return
        with self._acting:
            if number == self._newest and self._looks.integration == looks.integration:
                self._change(trial=trial, rank=0, held=None, laying=(), picked=None)

    def _tried(self, integration: str, heuristic: str, parameters: Parameters, number: int) -> Trial:
        def check() -> None:
            if number != self._newest:
                raise CancelledError("Newer parameters are tried.")

        started, mode = time.perf_counter(), self.session.state.mode
        first, second = (self._extracted(scan, parameters, check) for scan in IntegrationId.parse(integration))
        match = match_maps(first, second, parameters, heuristic, mode, check=check)
        return Trial(parameters, (first, second), match, 1000.0 * (time.perf_counter() - started), number)

    def _extracted(self, scan: Any, parameters: Parameters, check: Any) -> SegmentMap:
        check()
        return extract(self.session.scan(scan), parameters, scan.log, scan.scan)
