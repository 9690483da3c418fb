"""A project as its history: events in, state out, nothing else (no files, no clock).

What happened is a list of events that only grows (:mod:`segmap.events`); what is in force is
:func:`replay` of the list. Undo and redo are events like the others, so they survive a restart,
and nothing decided ever leaves the list. The order of events is their sequence number, never
their time.

Two people at work: :func:`check_conflict` refuses an event that was made on a revision after
which somebody else changed the same thing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias, TypeVar, assert_never

from segmap.errors import ConflictError, ProjectError
from segmap.events import (
    AddLog,
    Choice,
    Clear,
    Create,
    Decide,
    Decision,
    Event,
    IntegrationId,
    LogInfo,
    Proposal,
    Propose,
    Redo,
    Rename,
    SetHeuristic,
    SetParameters,
    Undo,
    event_from_json,
    fingerprint,
)
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId

__all__ = [
    "AddLog",
    "Choice",
    "Clear",
    "Create",
    "Decide",
    "Decision",
    "Event",
    "IntegrationId",
    "LogInfo",
    "ProjectState",
    "Proposal",
    "Propose",
    "Redo",
    "Rename",
    "SetHeuristic",
    "SetParameters",
    "Step",
    "Touch",
    "Undo",
    "accepted",
    "apply",
    "check_conflict",
    "event_from_json",
    "fingerprint",
    "replay",
]

_T = TypeVar("_T")
_Change: TypeAlias = Mapping[str, tuple[_T, _T]]  # name -> before, after

_DEFAULTS = Parameters()
_DEFAULTS_NAME = fingerprint(_DEFAULTS)


class Touch(NamedTuple):
    """Who changed something last, and how."""

    revision: int
    who: str
    what: str
    """in words, as in ``accepted 0.12-0.13``"""


@dataclass(frozen=True)
class Step:
    """Something that can be undone in one go."""

    seq: int
    """the event that did it"""
    who: str
    description: str
    """in words, for buttons: ``accepted 12 integrations``"""
    decisions: _Change[Decision | None]
    settings: _Change[Any]
    proposals: _Change[Proposal | None] = field(default_factory=dict)


@dataclass(frozen=True)
class ProjectState:
    """What is in force after some events; immutable."""

    name: str = ""
    parameters: Parameters = _DEFAULTS
    fingerprint: str = _DEFAULTS_NAME
    """of ``parameters``, as decisions name them"""
    heuristic: str = "all"
    mode: str = "paper"
    logs: tuple[LogInfo, ...] = ()
    decisions: Mapping[str, Decision] = field(default_factory=lambda: MappingProxyType({}))
    """the ones in force, by integration; an integration that is not here is undecided"""
    proposals: Mapping[str, Proposal] = field(default_factory=lambda: MappingProxyType({}))
    """pairs in the review queue beside the neighbours of each log, by integration"""
    parameter_sets: Mapping[str, Parameters] = field(
        default_factory=lambda: MappingProxyType({_DEFAULTS_NAME: _DEFAULTS})
    )
    """by fingerprint, all that have ever been in force"""
    revision: int = 0
    """sequence number of the last event"""
    modified: str = ""
    """when that was, UTC"""
    done: tuple[Step, ...] = ()
    """what can be undone, the last step last"""
    undone: tuple[Step, ...] = ()
    """what can be redone, the step undone last is last"""
    touched: Mapping[str, Touch] = field(default_factory=lambda: MappingProxyType({}))
    """by integration or setting: its last change"""
    turned: Touch | None = None
    """the last event that was a step, an undo or a redo"""

    @property
    def can_undo(self) -> str | None:
        """What undo takes back, in words; None: nothing."""
        return self.done[-1].description if self.done else None

    @property
    def can_redo(self) -> str | None:
        """What redo brings back, in words; None: nothing."""
        return self.undone[-1].description if self.undone else None


def replay(events: Iterable[Event], state: ProjectState | None = None) -> ProjectState:
    """The state after events, in order, from the empty project or from ``state``.

    Raises:
        ProjectError: an event cannot happen at its place, or one is missing.
    """
    draft = _Draft(state or ProjectState())
    for event in events:
        draft.take(event)
    return draft.state()


def apply(state: ProjectState, event: Event) -> ProjectState:
    """The state after one more event; an event without a number gets the next one.

    Raises:
        ProjectError: the event cannot happen here; the message says why.
        ConflictError: it undoes or redoes a step by number which is no longer the last.
    """
    return replay((event,), state)


def accepted(state: ProjectState) -> tuple[tuple[ScanId, ScanId, Pose2], ...]:
    """The accepted integrations as scan, scan, T_1_2, in the order of the scans."""
    poses = {IntegrationId.parse(d.integration): d.T_1_2 for d in state.decisions.values() if d.verdict == "accepted"}
    return tuple((pair.first, pair.second, T_1_2) for pair, T_1_2 in sorted(poses.items()) if T_1_2 is not None)


def check_conflict(state: ProjectState, event: Event, revision: int) -> None:
    """Refuse an event made on ``revision`` when what it is about has changed since.

    Raises:
        ConflictError: it has; the message says who did what.
    """
    if revision > state.revision:
        raise ConflictError(
            f"This was decided on revision {revision}, but the project is at revision {state.revision}: load it again."
        )
    touches = [state.turned] if isinstance(event, Undo | Redo) else [state.touched.get(name) for name in _names(event)]
    later = [touch for touch in touches if touch and touch.revision > revision]
    if later:
        more = f" and {len(later) - 1} more" if len(later) > 1 else ""
        raise ConflictError(
            f"{later[0].who or 'Somebody'} {later[0].what}{more} after you looked"
            f" (revision {later[0].revision}, yours is {revision}). Look again, then decide."
        )


def _names(event: Event) -> tuple[str, ...]:
    """What an event is about: integrations, or settings."""
    match event:
        case Decide():
            return tuple(choice.integration for choice in event.choices)
        case Clear():
            return event.integrations
        case SetParameters() | SetHeuristic() | Rename():
            return tuple(name for name in _settings(event) if name != "fingerprint")
    return ()


def _settings(event: SetParameters | SetHeuristic | Rename) -> dict[str, Any]:
    match event:
        case SetParameters():
            return {"parameters": event.parameters, "fingerprint": event.fingerprint}
        case SetHeuristic():
            named = {"heuristic": event.heuristic, "mode": event.mode}
            return {name: value for name, value in named.items() if value is not None}
        case Rename():
            return {"name": event.name}


class _Draft:
    """A state in the making: what replay writes on."""

    def __init__(self, state: ProjectState) -> None:
        self.settings: dict[str, Any] = {name: getattr(state, name) for name in _SETTINGS}
        self.parameter_sets = dict(state.parameter_sets)
        self.logs = list(state.logs)
        self.decisions, self.proposals = dict(state.decisions), dict(state.proposals)
        self.done, self.undone = list(state.done), list(state.undone)
        self.touched, self.turned = dict(state.touched), state.turned
        self.revision, self.modified = state.revision, state.modified

    def state(self) -> ProjectState:
        return ProjectState(
            **self.settings,
            logs=tuple(self.logs),
            decisions=MappingProxyType(self.decisions),
            proposals=MappingProxyType(self.proposals),
            parameter_sets=MappingProxyType(self.parameter_sets),
            revision=self.revision,
            modified=self.modified,
            done=tuple(self.done),
            undone=tuple(self.undone),
            touched=MappingProxyType(self.touched),
            turned=self.turned,
        )

    def take(self, event: Event) -> None:
        if event.seq not in (0, self.revision + 1):
            raise ProjectError(f"Event {event.seq} cannot follow event {self.revision}: the history has a gap.")
        self.revision += 1
        self.modified = event.at
        match event:
            case Create():
                self._create(event)
            case AddLog():
                self.logs.append(event.log.model_copy(update={"index": len(self.logs), "event": self.revision}))
            case Propose():
                self._checked(proposal.integration for proposal in event.proposals)
                self._step(event, {}, {}, {proposal.integration: proposal for proposal in event.proposals})
            case Decide():
                self._decide(event)
            case Clear():
                self._step(event, dict.fromkeys(self._checked(event.integrations)), {})
            case SetParameters() | SetHeuristic() | Rename():
                self._set(event)
            case Undo():
                self._turn(event, "undo", event.undoes, self.done, self.undone)
            case Redo():
                self._turn(event, "redo", event.redoes, self.undone, self.done)
            case _:
                assert_never(event)

    def _create(self, event: Create) -> None:
        if self.revision != 1:
            raise ProjectError("A project can be created only once.")
        self.settings = {name: getattr(event, name) for name in _SETTINGS}
        self.parameter_sets = {event.fingerprint: event.parameters}

    def _decide(self, event: Decide) -> None:
        self._checked(choice.integration for choice in event.choices)
        unknown = {choice.parameters for choice in event.choices} - set(self.parameter_sets)
        if unknown:
            raise ProjectError(f"The project never had the parameters {min(unknown)!r}: set them before deciding.")
        self._step(event, {choice.integration: self._decision(choice, event) for choice in event.choices}, {})

    def _decision(self, choice: Choice, event: Decide) -> Decision:
        made = {name: getattr(event, name) for name in ("who", "reason", "at", "version", "revision")}
        return Decision(**dict(choice), **made, seq=self.revision)

    def _checked(self, integrations: Iterable[str]) -> list[str]:
        names = list(integrations)
        for name in names:
            for scan_id in IntegrationId.parse(name):
                if scan_id.log >= len(self.logs) or scan_id.scan >= self.logs[scan_id.log].scans:
                    raise ProjectError(f"There is no integration {name}: the project has no scan {scan_id}.")
        return names

    def _set(self, event: SetParameters | SetHeuristic | Rename) -> None:
        if isinstance(event, SetParameters):
            if event.parameters == self.settings["parameters"]:
                return  # whatever the name: a step would change nothing
            self.parameter_sets[event.fingerprint] = event.parameters
        self._step(event, {}, _settings(event))

    def _step(
        self,
        event: Event,
        decisions: Mapping[str, Decision | None],
        settings: Mapping[str, Any],
        proposals: Mapping[str, Proposal] = MappingProxyType({}),
    ) -> None:
        """Do what can be undone; what changes nothing is no step."""
        changed = _differences(self.decisions, decisions)
        set_: _Change[Any] = _differences(self.settings, settings)
        asked: _Change[Proposal | None] = _differences(self.proposals, proposals)
        if changed or set_ or asked:
            described = _described_proposals(asked) if asked else _described(changed, set_)
            step = Step(self.revision, event.who, described, changed, set_, asked)
            self._put(step, 1, event.who)
            self.done.append(step)
            self.undone.clear()

    def _turn(self, event: Undo | Redo, verb: str, seq: int | None, source: list[Step], target: list[Step]) -> None:
        if not source:
            raise ProjectError(f"There is nothing to {verb}.")
        step = source.pop()
        if seq not in (None, step.seq):
            raise ConflictError(
                f"The step to {verb} is no longer the one you saw: now it is"
                f" “{step.who or 'somebody'} {step.description}” (revision {step.seq}). Look again, then decide."
            )
        target.append(step)
        self._put(step, 0 if verb == "undo" else 1, event.who, f"{'undid' if verb == 'undo' else 'redid'}: ")

    def _put(self, step: Step, side: int, who: str, turn: str = "") -> None:
        """Bring the side of a step, 0 before or 1 after, into force."""
        for name, proposal in step.proposals.items():
            _put(self.proposals, name, proposal[side])
        for name, decision in step.decisions.items():
            _put(self.decisions, name, decision[side])
            what = step.description if turn else _described({name: decision}, {})
            self.touched[name] = Touch(self.revision, who, turn + what)
        for name, setting in step.settings.items():
            self.settings[name] = setting[side]
            self.touched[name] = Touch(self.revision, who, turn + step.description)
        self.turned = Touch(self.revision, who, turn + step.description)


def _differences(held: Mapping[str, _T], wanted: Mapping[str, _T | None]) -> _Change[_T | None]:
    """What is to be another from here: before and after."""
    return {name: (old, new) for name, new in wanted.items() if (old := held.get(name)) != new}


def _put(held: dict[str, _T], name: str, value: _T | None) -> None:
    if value is None:
        del held[name]
    else:
        held[name] = value


_SETTINGS = ("name", "parameters", "fingerprint", "heuristic", "mode")


def _described(decisions: _Change[Decision | None], settings: _Change[Any]) -> str:
    """A step in words, without its subject."""
    if decisions:
        return _described_decisions(decisions)
    if "parameters" in settings:
        return _described_parameters(*settings["parameters"])
    if "name" in settings:
        return f"renamed the project to {settings['name'][1]}"
    return "changed " + " and ".join(f"the {name} to {values[1]}" for name, values in settings.items())


def _described_decisions(decisions: _Change[Decision | None]) -> str:
    """As in ``accepted 12 integrations``, ``rejected 0.1-0.2``, ``accepted 2 and rejected 3 integrations``."""
    counts = Counter(after.verdict if after else "cleared" for _, after in decisions.values())
    if len(decisions) == 1:
        return f"{next(iter(counts))} {next(iter(decisions))}"
    return " and ".join(f"{verb} {count}" for verb, count in sorted(counts.items())) + " integrations"


_PROPOSED = {"closure": "loop closures", "imported": "imported edges", "manual": "pairs"}


def _described_proposals(proposals: _Change[Proposal | None]) -> str:
    """As in ``proposed 12 loop closures``, ``proposed 0.1-0.7``."""
    kinds = {after.kind for _, after in proposals.values() if after}
    if all(after and after.nudge and after.nudge != (before and before.nudge) for before, after in proposals.values()):
        return f"laid {next(iter(proposals))} by hand"
    if len(proposals) == 1:
        return f"proposed {next(iter(proposals))}"
    return f"proposed {len(proposals)} {_PROPOSED[kinds.pop()] if len(kinds) == 1 else 'pairs'}"


def _described_parameters(before: Parameters, after: Parameters) -> str:
    values = after.model_dump()
    changed = [name for name, value in before.model_dump().items() if values[name] != value]
    if len(changed) == 1:
        return f"changed {changed[0]} to {values[changed[0]]}"
    return f"changed {len(changed)} parameters"
