"""A program that works on a project until it is killed; driven by test_store_crash.

    python store_victim.py PROJECT

For each line on standard input a child opens PROJECT, says its process id, and writes into the
project without end, saying after each success what it was. When it is dead, ``dead`` is said.
"""

from __future__ import annotations

import itertools
import os
import random
import sys
from pathlib import Path

from segmap.errors import ProjectError
from segmap.pose import Pose2
from segmap.project import Choice, Decide, Undo
from segmap.store import Store

SCANS = 50


def say(line: str) -> None:
    os.write(1, (line + "\n").encode())


def work(path: Path, seed: int) -> None:
    """Write and say so, for ever."""
    numbers = random.Random(seed)
    with Store.open(path) as store:
        for turn in itertools.count():
            event = store.append(_event(store, numbers))
            say(f"event {event.model_dump_json()}")
            if turn % 5 == 3:
                store.put_result(f"result {turn}", numbers.randbytes(200_000).hex())  # makes SQLite move its log
            if turn % 7 == 5:
                say(f"log {store.add_log('more', numbers.randbytes(1_200_000), scans=0).index}")
            if turn % 11 == 7:
                new = path.with_name(f"new-{seed}-{turn}.segmap")
                Store.create(new, "new").close()
                say(f"project {new}")


def _event(store: Store, numbers: random.Random) -> Decide | Undo:
    if store.state.can_undo and numbers.random() < 0.2:
        return Undo()
    first = numbers.sample(range(SCANS - 1), numbers.randint(1, 5))
    return Decide(choices=tuple(_choice(store, scan, numbers) for scan in first), who="victim")


def _choice(store: Store, scan: int, numbers: random.Random) -> Choice:
    T_1_2 = Pose2(numbers.random(), numbers.random(), numbers.random())
    name = f"0.{scan}-0.{scan + 1}"
    return Choice(integration=name, verdict="accepted", T_1_2=T_1_2, parameters=store.state.fingerprint)


def main() -> None:
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            say(f"pid {os.getpid()}")
            try:
                work(Path(sys.argv[1]), int(line))
            except ProjectError as error:
                say(f"error {error}")
            os._exit(1)
        os.waitpid(child, 0)
        say("\ndead")


if __name__ == "__main__":
    main()
