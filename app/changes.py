"""What a step changed in a project, and how it is told. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from segmap.events import IntegrationId
from segmap.project import ProjectState

__all__ = ["Change", "changed", "is_accepted", "settings_of", "told"]


@dataclass(frozen=True)
class Change:
    """The state after a step, and the integrations that were decided, or proposed, otherwise by it."""

    state: ProjectState
    integrations: tuple[str, ...] = ()


def changed(before: ProjectState, after: ProjectState) -> tuple[str, ...]:
    """The integrations whose decision or proposal is another one, in order."""
    names = {*before.decisions, *after.decisions, *before.proposals, *after.proposals}
    different = [IntegrationId.parse(name) for name in names if _of(before, name) != _of(after, name)]
    return tuple(str(integration) for integration in sorted(different))


def _of(state: ProjectState, name: str) -> tuple[object, object]:
    return state.decisions.get(name), state.proposals.get(name)


def is_accepted(state: ProjectState, integration: str) -> bool:
    """Whether an integration is accepted."""
    decision = state.decisions.get(integration)
    return decision is not None and decision.verdict == "accepted"


def settings_of(state: ProjectState) -> tuple[object, ...]:
    """What matches depend on."""
    return state.parameters, state.heuristic, state.mode


def told(state: ProjectState) -> Mapping[str, Any]:
    """What every event about a step says."""
    return {"revision": state.revision, "undo": state.can_undo, "redo": state.can_redo}
