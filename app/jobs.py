"""Long work, off the event loop: an ordered backlog, the latest of many, and the kernels' first compilation.

Work is given a ``check``: called now and then, it raises CancelledError when the work is no longer wanted.
"""

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from segmap.errors import CancelledError

__all__ = ["Backlog", "Check", "Latest", "WarmUp"]

Check = Callable[[], None]
Task = TypeVar("Task", bound=Hashable)

JOIN_SECONDS = 3.0
"""how long closing waits for work that does not look at its check"""
WARM_UP_SCRIPT = Path(__file__).with_name("warm_up.py")
log = logging.getLogger(__name__)


def _nothing() -> None:
    pass


def checker(stop: threading.Event) -> Check:
    """A check that raises once ``stop`` is set."""

    def check() -> None:
        if stop.is_set():
            raise CancelledError("The work was stopped.")

    return check


@dataclass
class _Run:
    """A task being done: told to stop or not, and whether it is to be done again when it stopped."""

    stop: threading.Event = field(default_factory=threading.Event)
    wanted: bool = True


class Backlog(Generic[Task]):
    """Tasks done one after the other by threads of its own: urgent ones first, the last asked for before all others.

    Cancelled tasks go back to where they were and are done after ``resume``. What was asked for as
    urgent is done even while the rest is cancelled: somebody is looking at it.
    """

    def __init__(
        self,
        work: Callable[[Task, Check], None],
        *,
        workers: int = 1,
        name: str = "work",
        prepare: Callable[[Check], None] | None = None,
        changed: Callable[[], None] = _nothing,
    ) -> None:
        self._work, self._prepare, self._changed = work, prepare, changed
        self._condition = threading.Condition()
        self._urgent: OrderedDict[Task, None] = OrderedDict()
        self._waiting: OrderedDict[Task, None] = OrderedDict()
        self._running: dict[Task, _Run] = {}
        self._cancelled = False
        self._preparing = workers if prepare is not None else 0
        self._closed = threading.Event()
        self._threads = [threading.Thread(target=self._run, name=f"{name}-{i}", daemon=True) for i in range(workers)]
        self._started = False

    @property
    def preparing(self) -> bool:
        """Whether no thread has begun, though there is something to do."""
        return self._preparing == len(self._threads) and self._ready()

    @property
    def cancelled(self) -> bool:
        """Whether the backlog waits for ``resume``."""
        return self._cancelled

    @property
    def running(self) -> int:
        """How many tasks are being done now."""
        return len(self._running)

    def replace(self, tasks: Iterable[Task]) -> None:
        """Forget everything that waits, stop what runs and is not among the tasks, and start on these."""
        with self._condition:
            wanted = OrderedDict.fromkeys(tasks)
            for task, run in self._running.items():
                run.wanted = task in wanted
                if not run.wanted:
                    run.stop.set()
                wanted.pop(task, None)
            self._urgent.clear()
            self._waiting = wanted
            self._start()
            self._condition.notify_all()

    def ask(self, task: Task) -> None:
        """Do this task next, before everything that waits."""
        with self._condition:
            run = self._running.get(task)
            if run is not None and not run.stop.is_set():
                return
            self._waiting.pop(task, None)
            self._urgent[task] = None
            self._urgent.move_to_end(task)
            self._start()
            self._condition.notify()

    def cancel(self) -> None:
        """Stop what runs and start nothing more until ``resume``."""
        with self._condition:
            self._cancelled = True
            for run in self._running.values():
                run.stop.set()
            while self._urgent:
                self._put_back(self._urgent.popitem(last=False)[0])
        self._changed()

    def resume(self) -> None:
        """Go on after ``cancel``."""
        with self._condition:
            self._cancelled = False
            self._condition.notify_all()
        self._changed()

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until there is nothing left to do; False when the time, in seconds, ran out before."""
        with self._condition:
            return self._condition.wait_for(lambda: not self._running and not self._ready(), timeout)

    def close(self) -> None:
        """Stop everything and end the threads."""
        with self._condition:
            self._closed.set()
            for run in self._running.values():
                run.stop.set()
            self._condition.notify_all()
        _join(self._threads)

    def _start(self) -> None:
        """Threads begin with the first task: by then, whoever made the backlog is ready for its calls."""
        if not self._started:
            self._started = True
            for thread in self._threads:
                thread.start()

    def _ready(self) -> bool:
        return bool(self._urgent) or (bool(self._waiting) and not self._cancelled)

    def _put_back(self, task: Task) -> None:
        if task not in self._urgent:
            self._waiting[task] = None
            self._waiting.move_to_end(task, last=False)

    def _run(self) -> None:
        try:
            self._get_ready()
        except CancelledError:
            return
        while (taken := self._take()) is not None:
            self._do(*taken)

    def _get_ready(self) -> None:
        if self._prepare is not None:
            self._prepare(checker(self._closed))
            with self._condition:
                self._preparing -= 1
            self._changed()

    def _take(self) -> tuple[Task, _Run] | None:
        with self._condition:
            self._condition.wait_for(lambda: self._closed.is_set() or self._ready())
            if self._closed.is_set():
                return None
            task, _ = self._urgent.popitem() if self._urgent else self._waiting.popitem(last=False)
            run = self._running[task] = _Run()
            return task, run

    def _do(self, task: Task, run: _Run) -> None:
        stopped = False
        try:
            self._work(task, checker(run.stop))
        except CancelledError:
            stopped = True
        except Exception:
            log.exception("A task failed in a way it does not handle: %s", task)
        with self._condition:
            del self._running[task]
            if stopped and run.wanted:
                self._put_back(task)
            self._condition.notify_all()
        self._changed()


class Latest:
    """One job that is done again whenever it is asked for; while it runs, many askings become one.

    A run that was overtaken is stopped, but never two in a row: who decides faster than a run takes
    still sees results.
    """

    def __init__(self, job: Callable[[Check], None], name: str = "latest") -> None:
        self._job = job
        self._condition = threading.Condition()
        self._asked = self._running = self._threw_away = False
        self._stop = threading.Event()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether a run is under way or asked for."""
        return self._asked or self._running

    def ask(self) -> None:
        """Do the job, with what is known from now on."""
        with self._condition:
            self._asked = True
            if self._running and not self._threw_away:
                self._stop.set()
            self._condition.notify_all()

    def settle(self, timeout: float | None = None) -> bool:
        """Wait until the last run asked for has ended; False when the time, in seconds, ran out before."""
        with self._condition:
            return self._condition.wait_for(lambda: self._closed or not self.busy, timeout)

    def close(self) -> None:
        """Stop the run and end the thread."""
        with self._condition:
            self._closed = True
            self._stop.set()
            self._condition.notify_all()
        _join([self._thread])

    def _run(self) -> None:
        while self._take():
            try:
                self._job(checker(self._stop))
                self._threw_away = False
            except CancelledError:
                self._threw_away = True
            except Exception:
                log.exception("A background job failed in a way it does not handle.")
            with self._condition:
                self._running = False
                self._condition.notify_all()

    def _take(self) -> bool:
        with self._condition:
            self._condition.wait_for(lambda: self._asked or self._closed)
            if self._closed:
                return False
            self._asked, self._running = False, True
            self._stop.clear()
            return True


class WarmUp:
    """Compiles the kernels in processes of their own, so that threads find them compiled on disk.

    Compilation takes seconds and holds the interpreter: in a thread it would hold up every page. What matching
    needs is waited for; what only some of it needs is compiled meanwhile.
    """

    def __init__(self, script: Path = WARM_UP_SCRIPT) -> None:
        self._script = script
        self._processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> None:
        """Begin; returns at once."""
        self._processes = [self._compile("first"), self._compile("rest")]

    def _compile(self, part: str) -> subprocess.Popen[bytes]:
        nowhere = subprocess.DEVNULL
        return subprocess.Popen(
            [sys.executable, "-P", str(self._script), part],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=nowhere,
            stdout=nowhere,
            stderr=nowhere,
        )

    def wait(self, check: Check = _nothing) -> None:
        """Wait until the first kernels are there. Should the process fail, threads compile for themselves."""
        process = self._processes[0] if self._processes else None
        while process is not None and process.poll() is None:
            check()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(0.05)
        if process is not None and process.returncode:
            log.warning("Compiling ahead ended with status %s: kernels are compiled when needed.", process.returncode)

    def close(self) -> None:
        """Stop the processes that still run."""
        for process in self._processes:
            process.kill()
            process.wait()


def _join(threads: list[threading.Thread]) -> None:
    for thread in threads:
        if thread.is_alive() and thread is not threading.current_thread():
            thread.join(JOIN_SECONDS)
