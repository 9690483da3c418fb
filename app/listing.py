"""The review queue in order, kept so row by row: what changed is put in its place, the rest stays. Not thread-safe."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import TypeAlias

from app.review import Key, Row, counts

__all__ = ["Listed", "Listing"]

KeyOf: TypeAlias = Callable[[Row], Key]


@dataclass(frozen=True, eq=False)
class Listed:
    """The queue at one moment; the same object as long as it holds the same rows in the same order."""

    rows: tuple[Row, ...]

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Where each integration stands, from 0."""
        return {row.id: place for place, row in enumerate(self.rows)}

    @cached_property
    def counts(self) -> Mapping[str, int]:
        """How many integrations there are, in all and in each state."""
        return counts(self.rows)

    def row(self, integration: str) -> Row | None:
        """The row of an integration; None where it is not listed."""
        place = self.places.get(integration)
        return None if place is None else self.rows[place]


class Listing:
    """Rows sorted by a key, of which some change now and then."""

    def __init__(self) -> None:
        self._keyed: list[tuple[Key, Row]] = []
        self.now = Listed(())

    def replace(self, rows: Iterable[Row], key: KeyOf) -> None:
        """Hold these rows and no others."""
        self._take(sorted(((key(row), row) for row in rows), key=_BY_KEY))

    def update(self, rows: Iterable[Row], key: KeyOf) -> None:
        """Hold these instead of what is held of the same integrations; the keys of all others are what they were."""
        new = {row.id: row for row in rows if self.now.row(row.id) is not row}
        if new:
            kept = (pair for pair in self._keyed if pair[1].id not in new)
            self._take(sorted([*kept, *((key(row), row) for row in new.values())], key=_BY_KEY))

    def _take(self, keyed: list[tuple[Key, Row]]) -> None:
        self._keyed, rows = keyed, tuple(row for _, row in keyed)
        if rows != self.now.rows:
            self.now = Listed(rows)


_BY_KEY = itemgetter(0)
