"""A clock that a test turns."""

from __future__ import annotations


class Clock:
    """Seconds since it began; it stands still until ``now`` is set."""

    now = 0.0

    def __call__(self) -> float:
        return self.now
