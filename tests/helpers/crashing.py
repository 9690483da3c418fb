"""Servers killed at random moments while people decide, add logs and make projects; what was acknowledged is there."""

from __future__ import annotations

import hashlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from segmap.store import Store

VICTIM = Path(__file__).with_name("server_victim.py")
LONGEST = 0.8
"""seconds that a server works at most before it is killed"""
PATIENCE = 60.0


@dataclass
class Acknowledged:
    """What a server said was done."""

    decisions: list[tuple[str, str]] = field(default_factory=list)
    """project, and who decided: another name each time"""
    logs: list[tuple[str, str]] = field(default_factory=list)
    """project, and the digest of a log in it"""

    @property
    def count(self) -> int:
        return len(self.decisions) + len(self.logs)


@contextmanager
def victims(workspace: Path) -> Iterator[subprocess.Popen[str]]:
    """The parent of servers that can be killed."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, VICTIM, workspace]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1, env=environment
    ) as process:
        assert _line(process) == "ready"
        yield process
        assert process.stdin is not None
        process.stdin.close()


def crash(process: subprocess.Popen[str], project: str, log: bytes, seed: int) -> Acknowledged:
    """Let people work with a server, kill it at a random moment, and return what it acknowledged."""
    numbers, done = random.Random(seed), Acknowledged()
    assert process.stdin is not None
    process.stdin.write("go\n")
    server = int(_line(process).removeprefix("pid "))
    url = f"http://127.0.0.1:{_line(process).removeprefix('at ')}/api/projects"
    people = (_decider(project, seed, done), _decider(project, -seed, done), _maker(project, log, seed, done))
    threads = [threading.Thread(target=_work, args=(person, url)) for person in people]
    for thread in threads:
        thread.start()
    time.sleep(numbers.random() * LONGEST)
    os.kill(server, signal.SIGKILL)
    for thread in threads:
        thread.join(PATIENCE)
    while _line(process) != "dead":
        pass
    return done


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().rstrip("\n")


def _work(step: Callable[[httpx.Client, str, int], None], url: str) -> None:
    """One step after the other until the server is gone."""
    with httpx.Client(timeout=PATIENCE, trust_env=False) as client, suppress(httpx.HTTPError):
        for turn in range(100_000):
            step(client, url, turn)


def _decider(project: str, seed: int, done: Acknowledged) -> Callable[[httpx.Client, str, int], None]:
    """Rejects, clears and takes back."""
    numbers = random.Random(seed)

    def step(client: httpx.Client, url: str, turn: int) -> None:
        who, scan = f"{seed}.{turn}", numbers.randrange(6)
        body: dict[str, Any] = {"who": who}
        where = numbers.choice(("decisions", "decisions", "decisions", "undo", "redo"))
        if where == "decisions":
            body |= {"integrations": [f"0.{scan}-0.{scan + 1}"], "reason": who}
            body |= {"verdict": numbers.choice(("rejected", "rejected", "undecided"))}
        answer = client.post(f"{url}/{project}/{where}", json=body)
        if answer.status_code == 200 and (where != "decisions" or answer.json()["rows"]):  # else it was so already
            done.decisions.append((project, who))

    return step


def _maker(project: str, log: bytes, seed: int, done: Acknowledged) -> Callable[[httpx.Client, str, int], None]:
    """Makes projects and puts more logs into one."""

    def step(client: httpx.Client, url: str, turn: int) -> None:
        content = log + b"# %d.%d\n" % (seed, turn)
        files = {"files": (f"{seed}.{turn}.log", content)}
        into = turn % 4 == 3
        answer = client.post(f"{url}/{project}/logs" if into else url, files=files)
        if answer.status_code in (200, 201):
            done.logs.append((project if into else answer.json()["id"], hashlib.sha256(content).hexdigest()))

    return step


def lost(workspace: Path, done: Acknowledged) -> list[str]:
    """What was acknowledged and is not there, and files that do not open."""
    found = []
    held: dict[str, tuple[set[str], set[str]]] = {}
    for path in workspace.glob("*.segmap"):
        try:
            with Store.open(path) as store:
                held[path.stem] = {e.who for e in store.events()}, {log.sha256 for log in store.state.logs}
                for log in store.state.logs:
                    store.log_bytes(log.index)
        except Exception as error:
            found.append(f"{path.name} does not open: {error}")
    nothing: tuple[set[str], set[str]] = (set(), set())
    found += [f"decision {who} in {id}" for id, who in done.decisions if who not in held.get(id, nothing)[0]]
    found += [f"log {digest} in {id}" for id, digest in done.logs if digest not in held.get(id, nothing)[1]]
    return found


def new_project(workspace: Path, log: bytes, name: str = "victim") -> str:
    """A project to decide in; its id."""
    workspace.mkdir(parents=True, exist_ok=True)
    with Store.create(workspace / f"{name}.segmap", name) as store:
        store.add_log("hall.log", log, scans=7, format="CARMEN")
    return name


def clean(workspace: Path, keep: str) -> None:
    """Remove all projects but one, and what a kill left of those that were being made."""
    for path in workspace.iterdir():
        if not path.name.startswith(f"{keep}.segmap"):
            path.unlink()
