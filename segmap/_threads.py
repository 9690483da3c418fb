"""Work spread over threads, block by block; the kernels let go of the interpreter lock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

__all__ = ["Crew", "crew"]

T = TypeVar("T")
R = TypeVar("R")


class Crew:
    """Some threads, and a look before each task at whether to stop."""

    def __init__(self, workers: int, check: Callable[[], None] | None, pool: ThreadPoolExecutor | None) -> None:
        self.workers = workers
        self._check = check
        self._pool = pool

    def run(self, work: Callable[[T], R], tasks: Sequence[T]) -> list[R]:
        """The results of all tasks, in their order."""

        def checked(task: T) -> R:
            if self._check is not None:
                self._check()
            return work(task)

        if self._pool is None or len(tasks) < 2:
            return [checked(task) for task in tasks]
        return list(self._pool.map(checked, tasks))

    def blocks(self, count: int, most: int, least: int = 1) -> list[slice]:
        """``count`` rows in blocks: at least as many as there are threads, none above ``most``, few below ``least``."""
        size = min(most, max(least, -(-count // self.workers)))
        return [slice(start, min(start + size, count)) for start in range(0, count, size)]


@contextmanager
def crew(workers: int, check: Callable[[], None] | None = None) -> Iterator[Crew]:
    """Threads for as long as they are needed; one worker is the caller's own thread.

    >>> with crew(2) as threads:
    ...     threads.run(lambda block: block.stop - block.start, threads.blocks(10, 4))
    [4, 4, 2]
    """
    if workers <= 1:
        yield Crew(1, check, None)
        return
    with ThreadPoolExecutor(workers) as pool:
        yield Crew(workers, check, pool)
