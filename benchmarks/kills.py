"""Kill -9 a server while it matches and right after clicks: python benchmarks/kills.py [--kills 50]

One project, a person who accepts, rejects and clears through the API while parameters that change at every start have
all pairs matched again. Half of the kills come right after a click was acknowledged, half at a random moment. After
each, every acknowledged decision must be in the history, and the map that the next server shows must have the hash
that `segmap replay` prints. Printed: kills, clicks acknowledged, lost ones, maps compared and different ones. Exit
status 1 where there is any. The same --seed gives the same moments, as far as the system does.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from common import provenance

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

from crashing import new_project, victims
from killing import kill, lost, replayed

from app.resources import samples_folder

SCANS = 7


def log_of(scans: int) -> bytes:
    """The first scans of a sample."""
    lines = (samples_folder() / "hall.log").read_bytes().splitlines(keepends=True)
    laser = [line for line in lines if line.startswith(b"FLASER")]
    return b"".join([line for line in lines if not line.startswith(b"FLASER")] + laser[:scans])


def main() -> int:
    """Kill, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    losses, clicked, maps, different, before, start = list[str](), 0, 0, 0, "", time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        workspace = Path(folder)
        project = new_project(workspace, log_of(SCANS))
        path = workspace / f"{project}.segmap"
        with victims(workspace) as process:
            for turn in range(given.kills):
                clicks = kill(process, project, given.seed + turn)
                losses += lost(path, clicks)
                clicked += len(clicks.made)
                maps += bool(before)
                different += clicks.map_before != before
                before = replayed(path)
    print(provenance())
    print(
        f"{given.kills} kills in {time.monotonic() - start:.0f} s; {clicked} clicks acknowledged, {len(losses)} lost;"
    )
    print(f"{maps} maps compared with their replay, {different} different.")
    for loss in losses:
        print(f"    {loss}")
    return 1 if losses or different else 0


if __name__ == "__main__":
    sys.exit(main())
