"""Fuzz every reader, guided by what of its code a file reaches: python benchmarks/fuzz_readers.py [--minutes 10]

Needs atheris (`pip install atheris`). Each reader runs in a process of its own, with bounds on time and
memory, on files that the fuzzer and `tests/helpers/fuzzing.py` change; a file that reaches code no file
has reached before is kept and changed further. Printed: how many files a reader read and refused, how
many new ways through its code they found, and how many made it fail (anything but a log or one of
segmap's errors), hang (more than SECONDS on one file) or want more than MEBIBYTES; those files are put
into --keep. Exit status 1 when there is one.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))

SECONDS = 20
MEBIBYTES = 1536
"""above what the process has before it begins"""
LONGEST = 1 << 20
"""bytes of a file"""
GUIDED = ["segmap", "rosbags"]
"""packages whose code guides the fuzzer"""
BAD = ("fails", "hangs", "wants memory", "stops")


# --- in the process of a reader -------------------------------------------------------------------


def fuzz(name: str, minutes: float, seed: int, keep: Path) -> None:
    """Fuzz one reader until the time is over; the process ends here. Counts are written as they change."""
    import atheris

    with atheris.instrument_imports(include=GUIDED):
        from fuzzing import changed, outcome, readers
    everything = readers()
    read, good = everything[name]
    others = [content for other, (_, content) in everything.items() if other != name]
    counts, written = Counter[str](), [0.0]
    warnings.simplefilter("error")
    assert outcome(read, good) == "read"

    def change(content: bytes, most: int, number: int) -> bytes:
        chance = random.Random(number)
        if chance.random() < 0.5:
            return atheris.Mutate(content, most)
        return changed(content or good, chance, chance.choice(others))[:most]

    def once(content: bytes) -> None:
        result = _tried(lambda: outcome(read, content))
        counts[result] += 1
        if result.startswith(BAD):
            (keep / f"{name.replace(' ', '-')}-{sum(counts.values())}").write_bytes(content)
        if result.startswith(BAD) or time.monotonic() > written[0] + 1.0:
            Path("counts.json").write_text(json.dumps(counts))
            written[0] = time.monotonic()

    Path("corpus").mkdir()
    Path("corpus/good").write_bytes(good)
    _bound()
    bounds = [f"-max_total_time={60 * minutes:.0f}", f"-timeout={SECONDS}", "-rss_limit_mb=0", f"-max_len={LONGEST}"]
    known = [f"-seed={seed}", f"-artifact_prefix={keep}/{name.replace(' ', '-')}-", "-print_final_stats=1", "corpus"]
    atheris.Setup([sys.argv[0], *bounds, *known], once, custom_mutator=change)
    atheris.Fuzz()


def _bound() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (MEBIBYTES << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _tried(read: Callable[[], str]) -> str:
    try:
        return read()
    except MemoryError:
        return "wants memory"
    except Exception as error:
        return f"fails: {type(error).__name__}: {str(error)[:60]}"


# --- all of them ----------------------------------------------------------------------------------


def run(name: str, given: argparse.Namespace) -> tuple[Counter[str], dict[str, int]]:
    """Outcomes of a reader, and what the fuzzer says of it at the end."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, "--one", name, *_passed_on(given)],
            cwd=folder,
            env={**os.environ, "TMPDIR": folder},
            capture_output=True,
            text=True,
            errors="replace",
        )
        held = Path(folder) / "counts.json"
        counts = Counter[str](json.loads(held.read_text()) if held.exists() else {})
    if done.returncode:
        counts[f"{'hangs' if 'timeout' in done.stderr else 'stops'}: {done.stderr[-2000:]}"] += 1
    stats = {key: int(number) for key, number in re.findall(r"stat::(\w+): +(\d+)", done.stderr)}
    return counts, stats


def _passed_on(given: argparse.Namespace) -> list[str]:
    return ["--minutes", str(given.minutes), "--seed", str(given.seed), "--keep", str(given.keep.resolve())]


def main() -> int:
    """Run them all, two at a time."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=10.0, help="for each reader")
    parser.add_argument("--readers", nargs="*", default=None, metavar="NAME", help="default: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"), help="folder for files that are too much")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        fuzz(given.one, given.minutes, given.seed, given.keep)
    from fuzzing import readers

    names = given.readers or list(readers())
    given.keep.mkdir(parents=True, exist_ok=True)
    print(f"{'reader':16} {'files':>9} {'read':>9} {'refused':>9} {'new ways':>9} {'bad':>5} {'size':>9}", flush=True)
    bad = 0
    with ThreadPoolExecutor(given.workers) as pool:
        jobs = {name: pool.submit(run, name, given) for name in names}
        for name, job in jobs.items():
            counts, stats = job.result()
            found = {result: count for result, count in counts.items() if result.startswith(BAD)}
            bad += sum(found.values())
            numbers = f"{stats.get('number_of_executed_units', 0):9} {counts['read']:9} {counts['refused']:9}"
            new, size = stats.get("new_units_added", 0), stats.get("peak_rss_mb", 0)
            print(f"{name:16} {numbers} {new:9} {sum(found.values()):5} {size:5} MiB", flush=True)
            for result, count in found.items():
                print(f"    {count} x {result}", flush=True)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
