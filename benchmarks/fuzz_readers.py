"""Try every reader on files changed at random: python benchmarks/fuzz_readers.py [--minutes 10] [--readers MCAP CSV]

Each reader runs in a process of its own, with bounds on time and memory. Printed: how many files it
read and refused, and how many made it fail (anything but a log or one of segmap's errors), hang (more
than SECONDS on one file) or want more than MEBIBYTES. Files that did are kept in --keep. Exit status
1 when there is one. The same --seed gives the same files.
"""

from __future__ import annotations

import argparse
import multiprocessing
import random
import resource
import signal
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

from fuzzing import changed, outcome, readers

SECONDS = 20
MEBIBYTES = 1536
"""above what the process has before it begins"""
BAD = ("fails", "hangs", "wants memory")


class _TooSlowError(Exception):
    """One file takes too long."""


def _stop(_: int, __: FrameType | None) -> None:
    raise _TooSlowError


def run(name: str, minutes: float, seed: int, keep: Path) -> tuple[Counter[str], float, int]:
    """Outcomes of a reader, the longest time a file took in seconds, and the largest size of the process in MiB."""
    everything = readers()
    read, good = everything[name]
    others = [content for other, (_, content) in everything.items() if other != name]
    chance, counts, slowest = random.Random(f"{seed} {name}"), Counter[str](), 0.0
    warnings.simplefilter("error")
    assert outcome(read, good) == "read"
    _bound()
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        content = changed(good, chance, chance.choice(others))
        start = time.process_time()
        result = _tried(read, content)
        slowest = max(slowest, time.process_time() - start)
        counts[result] += 1
        if result.startswith(BAD):
            keep.mkdir(parents=True, exist_ok=True)
            (keep / f"{name.replace(' ', '-')}-{sum(counts.values())}").write_bytes(content)
    return counts, slowest, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10


def _bound() -> None:
    signal.signal(signal.SIGALRM, _stop)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (MEBIBYTES << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _tried(read: object, content: bytes) -> str:
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        return outcome(read, content)  # type: ignore[arg-type]
    except _TooSlowError:
        return "hangs"
    except MemoryError:
        return "wants memory"
    except Exception as error:
        return f"fails: {type(error).__name__}: {str(error)[:60]}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def main() -> int:
    """Run them all, two at a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="for each reader")
    parser.add_argument("--readers", nargs="*", default=None, metavar="NAME", help="default: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"), help="folder for files that are too much")
    given = parser.parse_args()
    names = given.readers or list(readers())
    print(f"{'reader':16} {'files':>9} {'read':>9} {'refused':>9} {'bad':>5} {'slowest':>8} {'size':>9}")
    bad = 0
    with multiprocessing.get_context("spawn").Pool(given.workers, maxtasksperchild=1) as pool:
        jobs = {name: pool.apply_async(run, (name, given.minutes, given.seed, given.keep)) for name in names}
        for name, job in jobs.items():
            counts, slowest, size = job.get()
            found = {result: count for result, count in counts.items() if result.startswith(BAD)}
            bad += sum(found.values())
            numbers = f"{counts.total():9} {counts['read']:9} {counts['refused']:9} {sum(found.values()):5}"
            print(f"{name:16} {numbers} {slowest:6.2f} s {size:5} MiB", flush=True)
            for result, count in found.items():
                print(f"    {count} x {result}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
