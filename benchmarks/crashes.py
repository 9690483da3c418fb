"""Kill servers and writers at random moments: python benchmarks/crashes.py [--crashes 1000]

Half of the crashes are of a server (kill -9 of its process) while three people decide, put logs in
and make projects through its API and it matches in the background; half are of a process that writes
into a project without pause. After each, every project file of the folder is opened and compared with
what was acknowledged. Printed: crashes, what was acknowledged, what of it was lost, files that do not
open. Exit status 1 when there is any. The same --seed gives the same moments, as far as the system does.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

import crashing
import test_store_crash as writing

from app.resources import samples_folder
from segmap.store import Store

SCANS = 7
FRESH = 50
"""crashes of one project, before another takes its place"""


def log_of(scans: int) -> bytes:
    """The first scans of a sample."""
    lines = (samples_folder() / "hall.log").read_bytes().splitlines(keepends=True)
    laser = [line for line in lines if line.startswith(b"FLASER")]
    return b"".join([line for line in lines if not line.startswith(b"FLASER")] + laser[:scans])


def servers(workspace: Path, crashes: int, seed: int) -> tuple[int, list[str]]:
    """How much killed servers had acknowledged, and what of it is lost."""
    log, count, losses, project = log_of(SCANS), 0, list[str](), ""
    workspace.mkdir()
    with crashing.victims(workspace) as process:
        for turn in range(crashes):
            if turn % FRESH == 0:
                crashing.clean(workspace, "-")
                project = crashing.new_project(workspace, log, f"victim-{turn}")
            done = crashing.crash(process, project, log, seed + turn)
            count += done.count
            losses += crashing.lost(workspace, done)
            crashing.clean(workspace, project)
    return count, losses


def writers(folder: Path, crashes: int, seed: int) -> tuple[int, list[str]]:
    """The same of processes that write into a project without pause."""
    count, losses = 0, list[str]()
    folder.mkdir()
    for turn in range(crashes):
        if turn % FRESH == 0:
            path = folder / f"{turn}.segmap"
            with Store.create(path, "Hall") as store:
                store.add_log("hall.log", b"0", scans=50)
            with writing.victims(path) as process:
                for each in range(turn, min(turn + FRESH, crashes)):
                    said = writing.killed(process, seed + each)
                    count += len(said)
                    losses += _lost(path, said)
    return count, losses


def _lost(path: Path, said: list[str]) -> list[str]:
    try:
        writing.check(path, said)
    except Exception as error:
        return [f"{path.name}: {error!r}"]
    return []


def main() -> int:
    """Crash, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--crashes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(f"{'killed':8} {'crashes':>8} {'acknowledged':>13} {'lost':>5} {'time':>8}")
    losses = []
    with tempfile.TemporaryDirectory() as folder:
        for name, kind in (("servers", servers), ("writers", writers)):
            start = time.monotonic()
            crashes = given.crashes // 2
            count, lost = kind(Path(folder) / name, crashes, given.seed)
            print(f"{name:8} {crashes:8} {count:13} {len(lost):5} {time.monotonic() - start:6.0f} s", flush=True)
            losses += lost
    for loss in losses:
        print(f"    {loss}")
    return 1 if losses else 0


if __name__ == "__main__":
    sys.exit(main())
