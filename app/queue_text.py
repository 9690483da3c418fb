"""The review queue as the pages get it: written once for all, and to who has an earlier one only what changed."""

from __future__ import annotations

import gzip
import json
import secrets
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field

from app.review import Row

__all__ = ["QueueText", "QueueTexts"]

PACKING = 1
"""gzip's quickest: rows are much alike"""
EARLIER = 16
"""queues that changes are told since"""
FEW = 0.5
"""of the rows; where more are others, all are sent"""


@dataclass(frozen=True)
class QueueText:
    """The queue as JSON."""

    tag: str
    """another one for every other queue"""
    plain: bytes
    packed: bytes
    """the same, gzipped"""


@dataclass(frozen=True)
class _Changes:
    """What makes one queue of another: rows taken out, and rows put in at their places, from the first to the last."""

    since: str | None = None
    rows: Sequence[Row] = ()
    places: Sequence[int] = ()
    gone: Sequence[str] = field(default=())

    @classmethod
    def between(cls, tag: str, before: Sequence[Row], after: Sequence[Row]) -> _Changes | None:
        """What changed; None where it is as well to send all, or what did not change comes in another order."""
        held, left = {row.id: row for row in before}, {row.id for row in after}
        places = [place for place, row in enumerate(after) if held.get(row.id) is not row]
        if len(places) > FEW * len(after):
            return None
        new = {after[place].id for place in places}
        stayed = (row for row in before if row.id in left and row.id not in new)
        if any(one is not other for one, other in zip(stayed, (r for r in after if r.id not in new), strict=True)):
            return None
        return cls(tag, [after[place] for place in places], places, [row.id for row in before if row.id not in left])


class QueueTexts:
    """The texts of a queue, kept until its rows are others. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._mark, self._number = secrets.token_hex(4), 0
        self._rows: tuple[Row, ...] | None = None
        self._earlier: OrderedDict[str, tuple[Row, ...]] = OrderedDict()
        self._written: dict[str, tuple[Row, str]] = {}
        self._texts: dict[str, QueueText] = {}

    def of(self, rows: tuple[Row, ...], since: str = "") -> QueueText:
        """The text of these rows, in this order; to who has the queue of the tag ``since``, of what changed."""
        with self._lock:
            if rows is not self._rows:
                self._turn(rows)
            known = since if since in self._earlier else ""
            if known not in self._texts:
                self._texts[known] = self._text(rows, known)
            return self._texts[known]

    def _turn(self, rows: tuple[Row, ...]) -> None:
        self._number += 1
        self._rows, self._texts = rows, {}
        self._earlier[self._tag] = rows
        while len(self._earlier) > EARLIER:
            self._earlier.popitem(last=False)

    @property
    def _tag(self) -> str:
        return f"{self._mark}-{self._number}"

    def _text(self, rows: tuple[Row, ...], since: str) -> QueueText:
        found = _Changes.between(since, self._earlier[since], rows) if since else None
        changes = found or _Changes(rows=rows)
        told = {"tag": self._tag, "since": changes.since, "places": changes.places, "gone": changes.gone}
        head = json.dumps(told, separators=(",", ":"))
        plain = f'{head[:-1]},"integrations":[{",".join(map(self._row, changes.rows))}]}}'.encode()
        return QueueText(self._tag, plain, gzip.compress(plain, PACKING, mtime=0))

    def _row(self, row: Row) -> str:
        held = self._written.get(row.id)
        if held is None or held[0] is not row:
            text = json.dumps(row.to_json(), separators=(",", ":"), allow_nan=False)
            held = self._written[row.id] = (row, text)
        return held[1]
