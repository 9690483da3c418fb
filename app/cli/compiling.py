"""Telling that kernels are compiled, which happens once on a computer, apart from the time that matching takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from numba.core.event import Event, TimingListener, install_listener

from app.cli.output import remark

__all__ = ["Compiling", "compiling"]


class Compiling(TimingListener):
    """Hears of every kernel that is compiled, and says so when the first one is."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.told = False

    def on_start(self, event: Event) -> None:
        """A kernel is not in the cache on disk."""
        if not self.told:
            self.told = True
            remark("compiling for this computer; only the first time, some ten seconds…")
        super().on_start(event)  # type: ignore[no-untyped-call]

    @property
    def milliseconds(self) -> float:
        """How long all of it took."""
        return 1000.0 * float(self.duration) if self.done else 0.0


@contextmanager
def compiling() -> Iterator[Compiling]:
    """While this lasts, what is compiled is told and timed."""
    listener = Compiling()
    with install_listener("numba:compile", listener):
        yield listener
