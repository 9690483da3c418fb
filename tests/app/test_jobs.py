"""Long work: order, cancelling, and the latest of many askings."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.jobs import Backlog, Check, Latest, WarmUp
from app.warm_up import first, rest
from segmap import _bound_kernels, _search_kernels, _value_kernels
from segmap.errors import CancelledError
from segmap.graph import _inverse

PATIENCE = 60.0


class Work:
    """Work that can be held back, and remembers what it did."""

    def __init__(self) -> None:
        self.done: list[str] = []
        self.stopped: list[str] = []
        self.started = threading.Semaphore(0)
        self.go = threading.Event()
        self.go.set()

    def hold(self) -> None:
        self.go.clear()

    def wait_until_started(self) -> None:
        assert self.started.acquire(timeout=PATIENCE)

    def __call__(self, task: str, check: Check) -> None:
        self.started.release()
        try:
            while not self.go.wait(0.005):
                check()
        except CancelledError:
            self.stopped.append(task)
            raise
        self.done.append(task)


@pytest.fixture
def work() -> Iterator[Work]:
    work = Work()
    yield work
    work.go.set()


@pytest.fixture
def backlog(work: Work) -> Iterator[Backlog[str]]:
    backlog: Backlog[str] = Backlog(work)
    yield backlog
    backlog.close()


def finish(backlog: Backlog[str], work: Work) -> list[str]:
    work.go.set()
    assert backlog.settle(PATIENCE)
    return work.done


def test_tasks_are_done_in_order(backlog: Backlog[str], work: Work) -> None:
    """Without anything urgent, the backlog is worked off from its front."""
    backlog.replace("abc")
    assert finish(backlog, work) == ["a", "b", "c"]


def test_what_was_asked_for_last_comes_first(backlog: Backlog[str], work: Work) -> None:
    """What somebody looks at overtakes the rest, the newest question first, and nothing is done twice."""
    work.hold()
    backlog.replace("abcd")
    work.wait_until_started()
    backlog.ask("c")
    backlog.ask("x")
    backlog.ask("c")
    backlog.ask("a")  # it runs already
    assert finish(backlog, work) == ["a", "c", "x", "b", "d"]


def test_cancel_stops_what_runs_and_resume_does_it_again(backlog: Backlog[str], work: Work) -> None:
    """After cancel the running task has stopped and nothing new starts; resume loses nothing."""
    work.hold()
    backlog.replace("abc")
    work.wait_until_started()
    backlog.cancel()
    assert backlog.settle(PATIENCE)
    assert (work.stopped, work.done, backlog.running, backlog.cancelled) == (["a"], [], 0, True)
    backlog.resume()
    assert finish(backlog, work) == ["a", "b", "c"]


def test_resume_before_the_stop_was_noticed_loses_nothing(backlog: Backlog[str], work: Work) -> None:
    """A task told to stop is done again even when resume comes before it noticed."""
    work.hold()
    backlog.replace("ab")
    work.wait_until_started()
    backlog.cancel()
    backlog.resume()
    work.wait_until_started()
    assert finish(backlog, work) == ["a", "b"]


def test_urgent_tasks_are_done_while_the_rest_is_cancelled(backlog: Backlog[str], work: Work) -> None:
    """Somebody who cancelled the rest can still look at one."""
    backlog.cancel()
    backlog.replace("abc")
    backlog.ask("b")
    assert finish(backlog, work) == ["b"]


def test_cancel_puts_urgent_tasks_back(backlog: Backlog[str], work: Work) -> None:
    """Cancel stops urgent tasks too; they come first after resume."""
    work.hold()
    backlog.replace("ab")
    work.wait_until_started()
    backlog.ask("x")
    backlog.cancel()
    assert backlog.settle(PATIENCE)
    backlog.resume()
    assert sorted(finish(backlog, work)) == ["a", "b", "x"]


def test_replace_stops_what_is_no_longer_wanted(backlog: Backlog[str], work: Work) -> None:
    """Tasks that are not in the new list are stopped and forgotten, one that is goes on."""
    work.hold()
    backlog.replace("ab")
    work.wait_until_started()
    backlog.replace("xa")
    backlog.replace("xy")
    work.wait_until_started()  # the next one, once the first has stopped
    assert finish(backlog, work) == ["x", "y"]
    assert work.stopped == ["a"]


def test_a_task_that_fails_stops_nothing_else(caplog: pytest.LogCaptureFixture) -> None:
    """An unexpected failure is logged, and the next task is done."""
    done = []

    def work(task: str, check: Check) -> None:
        if task == "bad":
            raise ValueError("no good")
        done.append(task)

    backlog: Backlog[str] = Backlog(work)
    backlog.replace(["bad", "good"])
    assert backlog.settle(PATIENCE)
    backlog.close()
    assert done == ["good"]
    assert "no good" in caplog.text


def test_close_stops_what_runs(work: Work) -> None:
    """Closing does not wait for long work to finish."""
    work.hold()
    backlog: Backlog[str] = Backlog(work, workers=2)
    backlog.replace("abcd")
    work.wait_until_started()
    backlog.close()
    assert work.done == []
    assert work.stopped


def test_preparing_comes_first_and_can_be_stopped(work: Work) -> None:
    """Nothing is done before the preparation, and closing ends one that takes long."""
    preparing = threading.Event()

    def prepare(check: Check) -> None:
        preparing.set()
        while True:
            check()

    backlog: Backlog[str] = Backlog(work, prepare=prepare)
    backlog.replace("a")
    assert preparing.wait(PATIENCE)
    backlog.close()
    assert work.done == []


# --- the latest of many ---------------------------------------------------------------------------


@pytest.fixture
def latest(work: Work) -> Iterator[Callable[[], Latest]]:
    made: list[Latest] = []

    def make() -> Latest:
        made.append(Latest(lambda check: work("run", check)))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_many_askings_become_one_run(latest: Callable[[], Latest], work: Work) -> None:
    """While a run is under way, any number of askings leads to one more run."""
    work.hold()
    job = latest()
    job.ask()
    work.wait_until_started()
    for _ in range(5):
        job.ask()
    work.go.set()
    assert job.settle(PATIENCE)
    assert len(work.done) + len(work.stopped) == 2


def test_never_two_runs_in_a_row_are_thrown_away(latest: Callable[[], Latest], work: Work) -> None:
    """The run after one that was overtaken is left to finish, so that there are results to see."""
    work.hold()
    job = latest()
    job.ask()
    work.wait_until_started()
    job.ask()  # stops the first
    work.wait_until_started()
    job.ask()  # the second goes on
    work.go.set()
    assert job.settle(PATIENCE)
    assert (work.stopped, work.done) == (["run"], ["run", "run"])


def test_a_job_that_fails_can_be_asked_again(caplog: pytest.LogCaptureFixture) -> None:
    """An unexpected failure ends the run, not the thread."""
    runs = []

    def job(check: Check) -> None:
        runs.append(1)
        raise ValueError("no good")

    latest = Latest(job)
    for _ in range(2):
        latest.ask()
        assert latest.settle(PATIENCE)
    latest.close()
    assert len(runs) == 2
    assert "no good" in caplog.text


# --- compiling ahead ------------------------------------------------------------------------------


def test_warming_up_is_waited_for(tmp_path: Path) -> None:
    """What the process did is there when waiting ends, and it imports what this one can."""
    script = tmp_path / "script.py"
    script.write_text(f"import segmap.pose, pathlib; pathlib.Path({str(tmp_path / 'done')!r}).touch()")
    warm_up = WarmUp(script)
    warm_up.start()
    warm_up.wait()
    warm_up.close()
    assert (tmp_path / "done").exists()


@pytest.mark.slow
def test_what_only_large_searches_need_is_compiled_too() -> None:
    """Bounds are used for many candidates only; small maps alone would leave their kernels to the first user."""
    first()
    rest()
    kernels = (_bound_kernels.paint, _search_kernels.look_up, _search_kernels.outlast, _value_kernels.crossing)
    assert all(kernel.signatures for kernel in kernels)


def test_what_the_graph_takes_is_compiled_before_anything_else() -> None:
    """It is optimised as soon as a project is open: a request must never wait for its compiler."""
    first()
    kernels = (_inverse.column_starts, _inverse.factorise, _inverse.invert, _inverse.looked_up)
    assert all(kernel.signatures for kernel in kernels)


def test_a_failing_warm_up_is_told_and_survived(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Kernels are then compiled when they are needed."""
    script = tmp_path / "script.py"
    script.write_text("raise SystemExit(3)")
    warm_up = WarmUp(script)
    warm_up.start()
    warm_up.wait()
    warm_up.close()
    assert "status 3" in caplog.text


def test_waiting_for_the_warm_up_can_be_stopped(tmp_path: Path) -> None:
    """A server that is ended at once does not wait for the compiler."""

    def check() -> None:
        raise CancelledError("stop")

    script = tmp_path / "script.py"
    script.write_text("import time; time.sleep(600)")
    warm_up = WarmUp(script)
    warm_up.start()
    with pytest.raises(CancelledError):
        warm_up.wait(check)
    warm_up.close()
