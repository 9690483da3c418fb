"""How much memory reading a large log takes: python benchmarks/large_logs.py [--mebibytes 1024]

A CARMEN log of a laser with 1,081 beams is written to a temporary folder and read. Printed: its size, scans,
what their readings alone would take, and the most memory the process had; status 1 where that is more than the file.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from segmap.logs import ANY_SIZE, read_log

BEAMS = 1081
DIFFERENT = 200
"""scans, written again and again"""


def write(path: Path, size: int) -> None:
    """A log of at least so many bytes."""
    chance = np.random.default_rng(1)
    readings = (" ".join(f"{r:.2f}" for r in chance.uniform(0.5, 30.0, BEAMS)) for _ in range(DIFFERENT))
    block = "".join(f"FLASER {BEAMS} {text} 1 2 0.5 1 2 0.5 {i} host {i}\n" for i, text in enumerate(readings)).encode()
    with path.open("wb") as file:
        while file.tell() < size:
            file.write(block)


def peak() -> int:
    """The most memory this process had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10


def main() -> int:
    """Write, read, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mebibytes", type=int, default=1024)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.log"
        write(path, given.mebibytes << 20)
        size, before, start = path.stat().st_size >> 20, peak(), time.process_time()
        log = read_log(path, limits=ANY_SIZE)
        seconds = time.process_time() - start
    print(
        f"{size} MiB, {len(log)} scans of {BEAMS} beams, {len(log) * BEAMS * 8 >> 20} MiB of readings:"
        f" {peak()} MiB at the most ({before} before), {seconds:.0f} s of processor time"
    )
    return 0 if peak() < given.mebibytes else 1


if __name__ == "__main__":
    sys.exit(main())
