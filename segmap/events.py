"""What can happen to a project: its events, as they are written into its history.

    Propose                pairs beyond neighbours are put into the review queue, any number in one step
    Decide, Clear          about integrations; any number of them is one step
    SetParameters,
    SetHeuristic, Rename   about the project
    Undo, Redo             of the steps above; a new step ends what can be redone
    Create, AddLog         kept as they are, never undone

What they amount to is in :mod:`segmap.project`. A change of these models is a change of the
project file: it needs a migration in :mod:`segmap.store`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from segmap.errors import ProjectError, ScanError
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId

__all__ = [
    "AddLog",
    "Choice",
    "Clear",
    "Covariance",
    "Create",
    "Decide",
    "Decision",
    "Event",
    "Grounds",
    "IntegrationId",
    "LogInfo",
    "Nudge",
    "Proposal",
    "Propose",
    "Redo",
    "Rename",
    "SetHeuristic",
    "SetParameters",
    "Undo",
    "event_from_json",
    "fingerprint",
]


class IntegrationId(NamedTuple):
    """The two scans of an integration, the earlier one first; its text is ``first-second``.

    >>> str(IntegrationId(ScanId(0, 12), ScanId(0, 13)))
    '0.12-0.13'
    >>> IntegrationId.parse("0.12-1.3").second
    ScanId(log=1, scan=3)
    """

    first: ScanId
    second: ScanId

    def __str__(self) -> str:
        return f"{self.first}-{self.second}"

    @classmethod
    def parse(cls, text: str) -> IntegrationId:
        """The integration a text such as ``0.12-0.13`` names.

        Raises:
            ProjectError: it names none, or not the earlier scan first.
        """
        return _parsed(text)


@lru_cache(1 << 16)  # the names of a project are read again with every decision
def _parsed(text: str) -> IntegrationId:
    first, _, second = text.partition("-")
    try:
        pair = IntegrationId(ScanId.parse(first), ScanId.parse(second))
    except ScanError:
        raise ProjectError(f"{text[:80]!r} names no integration: write two scans, as in 0.12-0.13.") from None
    if pair.first >= pair.second:
        raise ProjectError(f"{text} names no integration: write two different scans, the earlier one first.")
    return pair


def fingerprint(parameters: Parameters) -> str:
    """A short name for a set of parameters: equal for equal values."""
    text = json.dumps(parameters.model_dump(mode="json"), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _known(text: str) -> str:
    return str(IntegrationId.parse(text))


def _storable(text: Any) -> Any:
    """File names can hold what no file format can: lone surrogates become question marks."""
    return text.encode("utf-8", "replace").decode() if isinstance(text, str) else text


_Id: TypeAlias = Annotated[str, AfterValidator(_known)]
_Name: TypeAlias = Annotated[str, Field(max_length=255), BeforeValidator(_storable)]
_Text: TypeAlias = Annotated[str, Field(max_length=10_000), BeforeValidator(_storable)]
_Three: TypeAlias = tuple[float, float, float]
Covariance: TypeAlias = tuple[_Three, _Three, _Three]
"""of x, y (metres) and theta (radians) of a ``T_1_2``"""


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="wrap")
    @classmethod
    def _explained(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        try:
            return handler(data)
        except ValidationError as error:
            raise ProjectError(f"This is not a valid {cls.__name__} of a project: {_sentence(error)}") from None


def _sentence(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    return f"{where + ': ' if where else ''}{first['msg'].lower()}."


class LogInfo(_Model):
    """A log of the project; its bytes are in the store."""

    name: _Name
    sha256: str
    """of the bytes as they were read, hexadecimal"""
    size: int = Field(ge=0)
    """bytes"""
    scans: int = Field(ge=0)
    format: _Name = ""
    """for people: ``CARMEN``, ..."""
    topic: _Name = ""
    """of a recording of several topics, the one its scans were published on"""
    index: int = Field(default=0, ge=0)
    """its place among the project's logs, from 0: the ``log`` of a ScanId; given when it is added"""
    event: int = Field(default=0, ge=0)
    """sequence number of the event that added it; given when it is added"""


class Grounds(_Model):
    """The evidence a decision was made on, as the program had it then; None: not told in that mode."""

    verdict: str | None = None
    """the program's own, on the pose decided on: accepted, review or rejected"""
    confidence: float | None = None
    """that the pose is right, in 0..1"""
    score: float | None = None
    """support less conflict, metres"""
    supported: float | None = None
    """metres of wall, as lines of sight have it; so are the next five"""
    contradicted: float | None = None
    shadowed: float | None = None
    unseen: float | None = None
    off_two: float | None = None
    """supported off the two strongest walls"""
    off_three: float | None = None
    candidates: int | None = None
    """poses that were tried"""


class Choice(_Model):
    """What somebody decides about one integration, with what it takes to do it again without a search."""

    integration: _Id
    verdict: Literal["accepted", "rejected"]
    parameters: str
    """fingerprint of the parameters it was computed with, one of ``ProjectState.parameter_sets``"""
    T_1_2: Pose2 | None = None
    """the pose accepted, or the one rejected"""
    value: float | None = None
    """metres"""
    heuristic: _Name = ""
    mode: _Name = ""
    candidate: int | None = Field(default=None, ge=0)
    """rank of the candidate, 0 for the best; None: not one of the ranked candidates"""
    covariance: Covariance | None = None
    """how well ``T_1_2`` is known, as the pose graph weighs it; None: nothing told"""
    origin: Literal["found", "claimed", "nudged"] = "found"
    """whether our search on the pair found the pose, somebody claimed it, or it was laid by hand"""
    grounds: Grounds | None = None

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if self.verdict == "accepted" and self.T_1_2 is None:
            raise ProjectError(
                f"{self.integration} cannot be accepted without a transformation: reject it, or choose one."
            )
        _refuse_unplaced(self.integration, self.T_1_2)
        return self


class Decision(Choice):
    """A choice with the circumstances it was made in."""

    who: str = ""
    reason: str = ""
    at: str = ""
    """UTC, ISO 8601; for people: the order is ``seq``"""
    version: str = ""
    """of segmap"""
    revision: int | None = None
    """the revision its maker looked at"""
    seq: int = 0
    """the event that made it"""


class _Recorded(_Model):
    """What every event says; all but ``who`` and ``reason`` is filled in when it is recorded."""

    seq: int = Field(default=0, ge=0)
    """its place in the history, from 1; 0: not recorded yet"""
    revision: int | None = None
    """the revision its maker looked at"""
    who: _Name = ""
    reason: _Text = ""
    at: str = ""
    """UTC, ISO 8601"""
    version: str = ""
    """of segmap"""


class _Parametrised(_Recorded):
    parameters: Parameters
    fingerprint: str = ""
    """the name decisions call these parameters by; kept, so that later parameters do not change it"""

    @model_validator(mode="after")
    def _named(self) -> Self:
        if not self.fingerprint:
            object.__setattr__(self, "fingerprint", fingerprint(self.parameters))
        return self


class Create(_Parametrised):
    """The project begins; always the first event."""

    kind: Literal["create"] = "create"
    name: _Name
    heuristic: _Name = "all"
    mode: _Name = "paper"


class AddLog(_Recorded):
    """A log is put into the project, after those it has."""

    kind: Literal["add_log"] = "add_log"
    log: LogInfo


class Nudge(_Model):
    """Where a person laid the second scan of a pair."""

    T_1_2: Pose2
    """where it came to rest"""
    start: Pose2
    """where it was let go; the best nearby is where it came to rest"""
    ties: tuple[tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]], ...] = ()
    """the segments, of the first and of the second scan, that were laid on each other; none where it was dragged"""


class Proposal(_Model):
    """A pair of scans that somebody, or a search, asks to be looked at."""

    integration: _Id
    kind: Literal["closure", "imported", "manual"]
    """found by our own search, an edge of another program's pose graph, or asked for by hand"""
    T_1_2: Pose2 | None = None
    """where whoever proposes it says that scan 2 lies; None: says nothing"""
    covariance: Covariance | None = None
    """how well that is known"""
    source: _Name = ""
    """for people: the file it came from, or what found it"""
    nudge: Nudge | None = None
    """where a person laid it, last"""

    @model_validator(mode="after")
    def _placed(self) -> Self:
        laid = () if self.nudge is None else (self.nudge.T_1_2, self.nudge.start)
        for T_1_2 in (self.T_1_2, *laid):
            _refuse_unplaced(self.integration, T_1_2)
        return self


class Propose(_Recorded):
    """Pairs beside the neighbours of each log are put into the review queue, all in one step."""

    kind: Literal["propose"] = "propose"
    proposals: tuple[Proposal, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _once_each(self) -> Self:
        _refuse_twice([proposal.integration for proposal in self.proposals])
        return self


class Decide(_Recorded):
    """Integrations are accepted or rejected, all in one step."""

    kind: Literal["decide"] = "decide"
    choices: tuple[Choice, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _once_each(self) -> Self:
        _refuse_twice([choice.integration for choice in self.choices])
        return self


class Clear(_Recorded):
    """Integrations are undecided again; those that were anyway stay so."""

    kind: Literal["clear"] = "clear"
    integrations: tuple[_Id, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _once_each(self) -> Self:
        _refuse_twice(self.integrations)
        return self


class Undo(_Recorded):
    """The last step is taken back."""

    kind: Literal["undo"] = "undo"
    undoes: int | None = None
    """sequence number of the step; None: whichever is last"""


class Redo(_Recorded):
    """The step undone last is in force again."""

    kind: Literal["redo"] = "redo"
    redoes: int | None = None
    """sequence number of the step; None: whichever was undone last"""


class SetParameters(_Parametrised):
    """These parameters, all of them, are in force from here."""

    kind: Literal["set_parameters"] = "set_parameters"


class SetHeuristic(_Recorded):
    """The heuristic, or the mode, is another from here."""

    kind: Literal["set_heuristic"] = "set_heuristic"
    heuristic: _Name | None = None
    mode: _Name | None = None


class Rename(_Recorded):
    """The project has another name."""

    kind: Literal["rename"] = "rename"
    name: _Name


Event: TypeAlias = Create | AddLog | Propose | Decide | Clear | Undo | Redo | SetParameters | SetHeuristic | Rename

_EVENT: TypeAdapter[Event] = TypeAdapter(Annotated[Event, Field(discriminator="kind")])


def event_from_json(text: str | bytes) -> Event:
    """The event that ``event.model_dump_json()`` wrote.

    Raises:
        ProjectError: it is none.
    """
    try:
        return _EVENT.validate_json(text)
    except ValidationError as error:
        raise ProjectError(f"This is no event of a project: {_sentence(error)}") from None


def _refuse_twice(integrations: Sequence[str]) -> None:
    if len(set(integrations)) < len(integrations):
        twice = next(name for i, name in enumerate(integrations) if name in integrations[:i])
        raise ProjectError(f"{twice} is named twice in one step: name each integration once.")


def _refuse_unplaced(integration: str, T_1_2: Pose2 | None) -> None:
    if T_1_2 is not None and not all(abs(number) < float("inf") for number in T_1_2):
        raise ProjectError(f"The transformation of {integration} is not finite.")
