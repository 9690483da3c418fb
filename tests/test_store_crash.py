"""Nothing acknowledged is lost when the program is killed, whenever that is."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from segmap.errors import ProjectError
from segmap.project import event_from_json
from segmap.store import Store

VICTIM = Path(__file__).parent / "helpers" / "store_victim.py"
ROUNDS = int(os.environ.get("SEGMAP_CRASHES", "30"))

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the victim is forked, which this system cannot do")


@contextmanager
def victims(path: Path) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, VICTIM, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    )
    with process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def killed(process: subprocess.Popen[str], seed: int) -> list[str]:
    """Let a victim work, kill it at a random moment, and return the lines it said in full."""
    assert process.stdin is not None
    assert process.stdout is not None
    numbers = random.Random(seed)
    process.stdin.write(f"{seed}\n")
    victim = int(process.stdout.readline().removeprefix("pid "))
    said = [process.stdout.readline() for _ in range(numbers.randrange(12))]
    time.sleep(numbers.random() * 0.02)
    os.kill(victim, signal.SIGKILL)
    while (line := process.stdout.readline()) != "dead\n":
        said.append(line)
    said.pop()  # the victim may have been killed while it said it
    return [line.rstrip("\n") for line in said]


def check(path: Path, said: list[str]) -> None:
    """Everything said to be written is there, and every project file opens or says that it was never finished."""
    with Store.open(path) as store:
        events = {event.seq: event for event in store.events()}
        for line in said:
            kind, _, what = line.partition(" ")
            if kind == "event":
                acknowledged = event_from_json(what)
                assert events[acknowledged.seq] == acknowledged
            elif kind == "log":
                assert store.log_bytes(int(what))
            else:
                assert kind == "project", line
                Store.open(what).close()


def opens(path: Path) -> bool:
    try:
        Store.open(path).close()
    except ProjectError:
        return False
    return True


def why_not(path: Path) -> str:
    with pytest.raises(ProjectError) as caught:
        Store.open(path)
    return str(caught.value)


@pytest.mark.slow
def test_every_acknowledged_event_survives_a_kill(tmp_path: Path) -> None:
    """Killed at random moments while it writes, again and again on one file: nothing it acknowledged is lost."""
    path = tmp_path / "p.segmap"
    with Store.create(path, "Hall") as store:
        store.add_log("hall.log", b"0", scans=50)
    with victims(path) as process:
        for seed in range(ROUNDS):
            check(path, killed(process, seed))
    with Store.open(path) as store:
        assert len(store.events()) > ROUNDS
        assert [len(store.log_bytes(log.index)) for log in store.state.logs] == [log.size for log in store.state.logs]


def test_a_project_killed_while_it_is_made_is_whole_or_says_so(tmp_path: Path) -> None:
    """Whatever a kill leaves of a new project either opens or is told to be unfinished."""
    path = tmp_path / "p.segmap"
    with Store.create(path, "Hall") as store:
        store.add_log("hall.log", b"0", scans=50)
    with victims(path) as process:
        for seed in range(1000, 1000 + ROUNDS // 4):
            killed(process, seed)
    for new in tmp_path.glob("new-*.segmap"):
        assert opens(new) or "its making was interrupted" in why_not(new)
