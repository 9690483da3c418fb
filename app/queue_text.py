"""The review queue as the pages get it: written once for all who ask, and of it only the rows that changed."""

from __future__ import annotations

import gzip
import json
import secrets
import threading
from dataclasses import dataclass

from app.review import Row

__all__ = ["QueueText", "QueueTexts"]

PACKING = 1
"""gzip's quickest: rows are much alike"""


@dataclass(frozen=True)
class QueueText:
    """The queue as JSON."""

    tag: str
    """another one for every other text"""
    plain: bytes
    packed: bytes
    """the same, gzipped"""


class QueueTexts:
    """The text of a queue, kept until its rows are others. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._mark, self._number = secrets.token_hex(4), 0
        self._rows: tuple[Row, ...] | None = None
        self._written: dict[str, tuple[Row, str]] = {}
        self._text = QueueText("", b"", b"")

    def of(self, rows: tuple[Row, ...]) -> QueueText:
        """The text of these rows, in this order."""
        with self._lock:
            if rows is not self._rows:
                plain = f'{{"integrations":[{",".join(map(self._row, rows))}]}}'.encode()
                self._number += 1
                self._text = QueueText(f'"{self._mark}-{self._number}"', plain, gzip.compress(plain, PACKING, mtime=0))
                self._rows = rows
            return self._text

    def _row(self, row: Row) -> str:
        held = self._written.get(row.id)
        if held is None or held[0] is not row:
            text = json.dumps(row.to_json(), separators=(",", ":"), allow_nan=False)
            held = self._written[row.id] = (row, text)
        return held[1]
