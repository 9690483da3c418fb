"""The steps of a run, as data, for teaching: the functions that do the work report to whoever records it.

>>> with recording() as trace:
...     tell("counted", beans=3)
>>> trace.last("counted")["beans"]
3
>>> tell("counted", beans=4)  # nobody listens
>>> len(trace.events)
1

What is told are the very arrays a step worked with, never a second computation of them. Where nobody records, telling
costs a look at one variable.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Event", "Trace", "recording", "tell"]


@dataclass(frozen=True, eq=False)
class Event:
    """One step, and what it worked with."""

    what: str
    told: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.told[name]


@dataclass(frozen=True, eq=False)
class Trace:
    """What was told during a run, in order."""

    events: list[Event] = field(default_factory=list)

    def all(self, what: str) -> list[Event]:
        """Every event of a name, in order."""
        return [event for event in self.events if event.what == what]

    def last(self, what: str) -> Event | None:
        """The last event of a name; None where there is none."""
        return next((event for event in reversed(self.events) if event.what == what), None)


_LISTENING: ContextVar[Trace | None] = ContextVar("listening", default=None)


@contextmanager
def recording() -> Iterator[Trace]:
    """Record what is told in this thread while the block runs; a block within a block records for itself."""
    trace = Trace()
    token = _LISTENING.set(trace)
    try:
        yield trace
    finally:
        _LISTENING.reset(token)


def tell(what: str, /, **told: Any) -> None:
    """Report a step to whoever records; arrays that are changed later are to be told as they are, and are copied."""
    trace = _LISTENING.get()
    if trace is not None:
        trace.events.append(Event(what, {name: _kept(one) for name, one in told.items()}))


def _kept(one: Any) -> Any:
    """Something as it is now: arrays that can still be written to are copied."""
    flags = getattr(one, "flags", None)
    return one.copy() if flags is not None and flags.writeable else one
