"""What people do to a project: decide, propose, set, undo. Each is one step, on the disk before it is answered."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

from app.changes import Change
from app.deciding import in_force
from app.modes import heuristic_in, parameters_in
from segmap.events import (
    Choice,
    Clear,
    Decide,
    Event,
    Nudge,
    Proposal,
    Propose,
    Redo,
    Rename,
    SetHeuristic,
    SetParameters,
    Undo,
)
from segmap.parameters import preset
from segmap.project import ProjectState

__all__ = ["Steps"]


class Steps(ABC):
    """The steps of a session; what they act on is the session's."""

    _lock: threading.RLock
    _state: ProjectState
    _integrations: tuple[str, ...]

    @abstractmethod
    def _commit(self, event: Event, expected_revision: int | None = None) -> Change: ...

    @abstractmethod
    def _choice(self, integration: str, verdict: str, heuristic: str, rank: int | None) -> Choice: ...

    @abstractmethod
    def _heuristic(self, name: str | None) -> str: ...

    @abstractmethod
    def _listed(self, integration: str) -> str: ...

    def decide(
        self,
        integrations: Sequence[str],
        verdict: str,
        *,
        candidate: int | None = None,
        heuristic: str | None = None,
        reason: str = "",
        who: str = "",
        expected_revision: int | None = None,
    ) -> Change:
        """Accept or reject integrations in one step; what is decided so already stays as it is.

        ``candidate`` is a rank among the match's candidates, default the best, or the one our own search proposes.

        Raises:
            UnknownError: there is no such integration or candidate.
            ProjectError: an integration to be accepted has no transformation (yet).
            ConflictError: one was decided by somebody after ``expected_revision``.
        """
        name = self._heuristic(heuristic)
        with self._lock:
            choices = [self._choice(id, verdict, name, candidate) for id in dict.fromkeys(integrations)]
            new = tuple(choice for choice in choices if not in_force(choice, self._state))
            if not new:
                return Change(self._state)
            return self._commit(Decide(choices=new, who=who, reason=reason), expected_revision)

    def clear(
        self, integrations: Sequence[str], *, who: str = "", reason: str = "", expected_revision: int | None = None
    ) -> Change:
        """Make integrations undecided again, in one step."""
        names = tuple(dict.fromkeys(self._listed(name) for name in integrations))
        return self._commit(Clear(integrations=names, who=who, reason=reason), expected_revision)

    def undo(self, who: str = "", *, expected_revision: int | None = None) -> Change:
        """Take the last step back. Raises ProjectError where there is none."""
        return self._commit(Undo(who=who), expected_revision)

    def redo(self, who: str = "", *, expected_revision: int | None = None) -> Change:
        """Bring the step undone last back into force. Raises ProjectError where there is none."""
        return self._commit(Redo(who=who), expected_revision)

    def set_parameters(self, changes: Mapping[str, Any], *, who: str = "") -> Change:
        """Change some parameters. Raises ParameterError for unknown names and impossible values."""
        return self.configure(changes, who=who)

    def set_heuristic(self, heuristic: str, *, who: str = "") -> Change:
        """Match by another heuristic. Raises ParameterError where there is no such heuristic."""
        return self.configure({}, heuristic=heuristic, who=who)

    def configure(
        self,
        changes: Mapping[str, Any],
        *,
        preset_name: str | None = None,
        heuristic: str | None = None,
        mode: str | None = None,
        who: str = "",
    ) -> Change:
        """Change parameters, from those in force or from a preset, the heuristic and the mode; all or nothing.

        Another mode brings its own heuristic and threshold of the value, where those before were the defaults.

        Raises:
            ParameterError: a name is unknown, or a value impossible.
        """
        with self._lock:
            wanted = mode or self._state.mode
            name = heuristic_in(wanted, self._state, heuristic)
            base = parameters_in(wanted, self._state) if preset_name is None else preset(preset_name)
            parameters, change = base.replace(**changes), Change(self._state)
            if parameters != self._state.parameters:
                change = self._commit(SetParameters(parameters=parameters, who=who))
            if (name, wanted) != (self._state.heuristic, self._state.mode):
                change = self._commit(SetHeuristic(heuristic=name, mode=wanted, who=who))
            return change

    def rename(self, name: str, *, who: str = "") -> Change:
        """Give the project another name."""
        with self._lock:
            if name == self._state.name:
                return Change(self._state)
            return self._commit(Rename(name=name, who=who))

    def propose(self, proposals: Sequence[Proposal], *, who: str = "", reason: str = "", again: bool = True) -> Change:
        """Put pairs into the review queue, in one step; what is proposed so already stays as it is.

        ``again``: also what is in the queue already, with what is said of it now.

        Raises:
            ProjectError: the project has no such scans.
        """
        with self._lock:
            held, known = self._state.proposals, set(self._integrations)
            wanted = [_keeping_nudge(proposal, held.get(proposal.integration)) for proposal in proposals]
            new = [p for p in wanted if held.get(p.integration) != p and (again or p.integration not in known)]
            if not new:
                return Change(self._state)
            return self._commit(Propose(proposals=tuple(new), who=who, reason=reason))

    def nudge(self, integration: str, nudge: Nudge, *, who: str = "", reason: str = "") -> Change:
        """Let a pose a person laid by hand be a candidate of a pair, instead of the one laid before; one step.

        Raises:
            UnknownError: there is no such integration.
        """
        with self._lock:
            held = self._state.proposals.get(self._listed(integration))
            blank = held or Proposal(integration=integration, kind="manual")
            return self.propose([blank.model_copy(update={"nudge": nudge})], who=who, reason=reason)


def _keeping_nudge(proposal: Proposal, held: Proposal | None) -> Proposal:
    """What is proposed anew says nothing of what was laid by hand: that stays."""
    if proposal.nudge is not None or held is None:
        return proposal
    return proposal.model_copy(update={"nudge": held.nudge})
