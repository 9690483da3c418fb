"""What a person decides in a view: accept, reject, skip, undo, redo, and where the view goes then."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from app.looks import Looks
from segmap.errors import ConflictError, ProjectError

if TYPE_CHECKING:
    from app.evidence import Evidence
    from app.session import Session

__all__ = ["DOUBLE_CLICK_SECONDS", "REACTION_SECONDS", "Judging", "News"]

DOUBLE_CLICK_SECONDS = 0.35
"""a decision so soon after the last one was meant for the pair that has just gone"""
REACTION_SECONDS = 1.0
"""a decision so soon after somebody else's on the same pair was made without having seen that one"""


@dataclass(frozen=True)
class News:
    """What somebody else did to the pair that is looked at."""

    integration: str
    text: str
    at: float
    """by the view's clock, seconds"""


class Judging(ABC):
    """The decisions of a view; what they act on is the view's."""

    session: Session
    who: str
    _acting: threading.RLock
    _clock: Callable[[], float]
    _evidence: Evidence
    _looks: Looks
    _seen: int
    _decided_at = -DOUBLE_CLICK_SECONDS
    _news: News | None = None
    _own: int | None = None
    """the thread in which a step of this view is being made"""

    @abstractmethod
    def _at(self, integration: str, notice: str = "") -> Looks: ...

    @abstractmethod
    def _look(self, looks: Looks) -> None: ...

    @abstractmethod
    def _change(self, **changes: Any) -> None: ...

    @abstractmethod
    def _present(self, looks: Looks) -> Looks: ...

    @abstractmethod
    def _order(self) -> Sequence[str]: ...

    @abstractmethod
    def _count(self) -> int: ...

    @abstractmethod
    def _rank(self) -> int: ...

    def set_who(self, who: str) -> None:
        """Whose decisions the next ones are."""
        self.who = who.strip()[:255]
        self._change()

    def set_reason(self, reason: str) -> None:
        """Why the next decision on this pair is made; another pair begins without a reason."""
        with self._acting:
            self._look(replace(self._looks, reason=reason[:10_000]))

    def accept(self, integration: str | None = None, revision: int | None = None, who: str | None = None) -> None:
        """Accept the candidate shown and go on to the next pending integration.

        With ``integration``, only if that is the one looked at: so that a late click decides nothing else.
        ``revision`` is the one the person saw; default: the one this view has told of last. ``who`` they are, where
        several work in one view; default: whoever said so last.

        Raises:
            ConflictError: somebody else decided on it since; the second of two decisions is told so.
        """
        self._decide("accepted", integration, revision, who)

    def reject(self, integration: str | None = None, revision: int | None = None, who: str | None = None) -> None:
        """Reject the integration and go on to the next pending one; the rest as for :meth:`accept`."""
        self._decide("rejected", integration, revision, who)

    def decide_many(
        self, integrations: Sequence[str], verdict: str, revision: int | None = None, who: str | None = None
    ) -> None:
        """Accept or reject the best candidates of many, or make them undecided again: one step, one undo."""
        with self._acting:
            told: dict[str, Any] = {"who": self.who if who is None else who, "expected_revision": revision}
            with self._stepping():
                if verdict == "undecided":
                    change = self.session.clear(integrations, **told)
                else:
                    change = self.session.decide(integrations, verdict, **told)
            count = len(change.integrations)
            word = {"undecided": "To be decided again"}.get(verdict, verdict.capitalize())
            self._change(notice=f"{word}: {count} integration{'' if count == 1 else 's'}.")

    def skip(self) -> None:
        """Leave the integration undecided, for later, and go on to the next pending one."""
        with self._acting:
            order, here = self._order(), self._looks.integration
            if here is not None:
                self.session.put_off(here)
            self._go_on(order, "")

    def undo(self) -> None:
        """Take the last step back, and look at what it was about."""
        self._turn_back(self.session.undo, self.session.state.can_undo, "Undone")

    def redo(self) -> None:
        """Do again what was undone, and look at what it is about."""
        self._turn_back(self.session.redo, self.session.state.can_redo, "Redone")

    def _decide(self, verdict: str, integration: str | None, revision: int | None, who: str | None) -> None:
        with self._acting:
            if self._late(integration):
                return
            looks, order = self._looks, self._order()
            if looks.integration is None:
                raise ProjectError("There is no pair to decide on.")
            if looks.trial is not None:
                raise ProjectError("These parameters are on trial: apply them or put them back, then decide.")
            self._refuse_unseen(looks.integration)
            if verdict == "accepted" and not self._count():
                raise ProjectError(
                    "There is no transformation to accept: reject the pair, skip it, or try another heuristic."
                )
            with self._stepping():
                self.session.decide(
                    [looks.integration],
                    verdict,
                    candidate=self._rank() if self._count() else None,
                    heuristic=self._evidence.heuristic(looks),
                    reason=looks.reason,
                    who=self.who if who is None else who,
                    expected_revision=self._seen if revision is None else revision,
                )
            self._decided_at = self._clock()
            self._go_on(order, f"{verdict.capitalize()}: {looks.integration}.")

    def _late(self, integration: str | None) -> bool:
        """Whether a click came for a pair that has gone already."""
        if integration is not None:
            return integration != self._looks.integration
        return self._clock() - self._decided_at < DOUBLE_CLICK_SECONDS

    def _refuse_unseen(self, integration: str) -> None:
        """A click that crossed somebody else's decision was made on what was shown before it."""
        news = self._news
        if news and news.integration == integration and self._clock() - news.at < REACTION_SECONDS:
            raise ConflictError(f"{news.text} That was just before you: look again, then decide.")

    def _go_on(self, before: Sequence[str], notice: str) -> None:
        following = self._following(before)
        if following is None:
            self._change(notice=f"{notice} {self._no_other(before)}".strip())
        else:
            self._look(self._at(following, notice))

    def _no_other(self, order: Sequence[str]) -> str:
        outside = sum(row.state == "pending" and row.id not in order for row in self.session.rows())
        if outside:
            return f"No other pair of those listed waits for a decision; {outside} that are not listed do."
        return "No other pair waits for a decision."

    def _following(self, order: Sequence[str]) -> str | None:
        """The next integration that waits for a decision, in the order the person saw; what was skipped comes last."""
        waiting = {row.id: row.later for row in self.session.rows() if row.state == "pending"}
        here = self._looks.integration
        place = order.index(here) + 1 if here in order else 0
        found = [id for id in (*order[place:], *order[:place]) if id in waiting and id != here]
        return min(found, key=lambda id: waiting[id], default=None)

    def _turn_back(self, turn: Callable[..., Any], what: str | None, done: str) -> None:
        with self._acting:
            with self._stepping():
                change = turn(self.who)
            listed = set(self.session.integrations)
            changed = [id for id in change.integrations if id in listed]
            here = self._present(self._looks).integration
            target = here if here in changed or not changed else changed[0]
            looks = self._looks if target is None else self._at(target)
            self._look(replace(looks, notice=f"{done}: {what}."))

    @contextmanager
    def _stepping(self) -> Iterator[None]:
        """While a step is made here: what the session tells of it in this thread is no news."""
        before, self._own = self._own, threading.get_ident()
        try:
            yield
        finally:
            self._own = before

    def _heard(self, event: Mapping[str, Any]) -> None:
        """Somebody else may have decided on the pair that is looked at."""
        here = self._looks.integration
        if self._own == threading.get_ident() or here is None or here not in event.get("integrations", ()):
            return
        touch = self.session.state.touched.get(here)
        if touch and touch.revision == event.get("revision"):
            self._news = News(here, f"{touch.who or 'Somebody else'} {touch.what}.", self._clock())

    def _said(self, looks: Looks) -> Looks:
        """With what somebody else did, as long as the same pair is looked at and nothing else has happened."""
        news = self._news
        if news is None or news.integration != looks.integration:
            return looks
        return replace(looks, notice=" ".join(text for text in (looks.notice, news.text) if text))
