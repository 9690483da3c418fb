"""Ours beside two matchers from PyPI: same pairs, same core, ranges only, no starting guess.

    pip install -e '.[bench]'
    python benchmarks/peers.py [--pairs N] [--repeats N] [--names intel fr079 ...]

small_gicp from 36 starting headings, and more thoroughly from 24 at each of five places; open3d with 100,000 tries
of RANSAC at a confidence of 0.999, and more thoroughly with 400,000 at 0.99999 (benchmarks/peer_matchers.py).
Both were tuned for success on the very pairs they are measured on here; ours is at shipped defaults.

Of each log: N pairs (80) with more than 50 % overlap, drawn with a fixed seed; where the set does not say how much
its pairs overlap, from all its positive pairs. Right: within 0.25 m and 5 degrees. Every pair goes to each matcher
in turn, in one process pinned to one core, so that other load is shared fairly; times are medians of the repeats,
of the processor and by the clock.
"""

from __future__ import annotations

import argparse
import importlib
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import product
from statistics import fmean
from types import ModuleType

import numpy as np
from common import LogPairs, load, markdown, percent, provenance
from common import arguments as common_arguments
from peer_matchers import AROUND, HERE, Run, open3d_matcher, small_gicp_matcher

from segmap.benchmark import NEGATIVE, Pair, is_right
from segmap.integration import match_maps
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import extract

MOST_OVERLAP = 0.5
"""pairs overlap more than this"""
SEED = 0
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "TBB_NUM_THREADS")
OURS = "segmap, verified mode"


@dataclass(frozen=True)
class Matcher:
    """Something that finds ``T_1_2`` of two scans."""

    name: str
    run: Run


@dataclass(frozen=True)
class Answer:
    """What a matcher said of one pair."""

    right: bool
    cpu_ms: float
    wall_ms: float


Answers = Mapping[str, Mapping[str, Sequence[Answer]]]
"""matcher -> log -> answers, in the order of the pairs"""


# --- ours -----------------------------------------------------------------------------------------


def ours(scan_1: LaserScan, scan_2: LaserScan) -> Pose2 | None:
    """Verified mode at its shipped defaults, from ranges to verdict."""
    parameters = preset("verified")
    return match_maps(extract(scan_1, parameters), extract(scan_2, parameters), parameters, mode="verified").T_1_2


# --- the comparison -------------------------------------------------------------------------------


def _quiet_open3d(o3d: ModuleType) -> ModuleType:
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    return o3d


def _small_gicp(sg: ModuleType) -> Iterator[Matcher]:
    yield Matcher("small_gicp, 36 headings", small_gicp_matcher(sg, 36, HERE))
    yield Matcher("small_gicp, 24 headings at 5 places", small_gicp_matcher(sg, 24, AROUND))


def _open3d(o3d: ModuleType) -> Iterator[Matcher]:
    quiet = _quiet_open3d(o3d)
    yield Matcher("open3d, RANSAC", open3d_matcher(quiet, 100_000, 0.999))
    yield Matcher("open3d, RANSAC, thorough", open3d_matcher(quiet, 400_000, 0.99999))


PEERS = {"small_gicp": _small_gicp, "open3d": _open3d}


def matchers() -> tuple[list[Matcher], list[str]]:
    """Ours and the peers that are installed; and in words which are not, and why."""
    found, said = [Matcher(OURS, ours)], []
    for package, made in PEERS.items():
        try:
            module = importlib.import_module(package)
        except ImportError as error:
            said.append(f"{package} is left out, as it cannot be imported ({error}): pip install -e '.[bench]'")
            continue
        found += made(module)
        said.append(f"{package} {version(package)}")
    return found, said


def chosen(held: LogPairs, most: int) -> tuple[list[Pair], str]:
    """At most so many pairs with more than 50 % overlap, drawn with the seed, in file order; and which, in words."""
    positive = [pair for pair in held.pairs if pair.kind != NEGATIVE]
    known = [pair for pair in positive if pair.overlap is not None]
    enough = [pair for pair in known if pair.overlap is not None and pair.overlap > MOST_OVERLAP]
    pool = enough if known else positive
    drawn = sorted(np.random.default_rng(SEED).permutation(len(pool))[:most])
    which = f"with more than {MOST_OVERLAP:.0%} overlap" if known else "positive (their overlap is not known)"
    return [pool[k] for k in drawn], f"{held.name}: {len(drawn)} of {len(pool)} pairs {which}"


def compare(logs: Sequence[LogPairs], tried: Sequence[Matcher], most: int, repeats: int) -> Answers:
    """Every matcher on every chosen pair, one after the other."""
    found: dict[str, dict[str, list[Answer]]] = {one.name: {held.name: [] for held in logs} for one in tried}
    for held in logs:
        pairs, _ = chosen(held, most)
        for matcher in tried if pairs else ():
            answer(matcher, held, pairs[0], 1)  # to warm up
        for pair, matcher in product(pairs, tried):
            found[matcher.name][held.name].append(answer(matcher, held, pair, repeats))
    return found


def answer(matcher: Matcher, held: LogPairs, pair: Pair, repeats: int) -> Answer:
    """What a matcher says of a pair, and its times: the median of the repeats."""
    scans = held.log.scan(pair.i), held.log.scan(pair.j)
    times = []
    for _ in range(repeats):
        started = time.process_time(), time.perf_counter()
        pose = matcher.run(*scans)
        times.append((time.process_time() - started[0], time.perf_counter() - started[1]))
    cpu, wall = 1000.0 * np.median(times, axis=0)
    return Answer(is_right(pose, pair.truth), float(cpu), float(wall))


# --- tables ---------------------------------------------------------------------------------------


def success_table(found: Answers) -> str:
    """Percent right, by log and the mean; and on how many pairs only ours or only the other is right."""
    logs = list(next(iter(found.values())))
    rows = []
    for name, by_log in found.items():
        shares = [fmean(one.right for one in by_log[log]) for log in logs]
        rows.append([name, *map(percent, (fmean(shares), *shares)), *_only(found[OURS], by_log)])
    return markdown(["Matcher", "right: mean %", *logs, "only ours right", "only this right"], rows)


def _only(mine: Mapping[str, Sequence[Answer]], other: Mapping[str, Sequence[Answer]]) -> tuple[int, int]:
    both = [(a.right, b.right) for log in mine for a, b in zip(mine[log], other[log], strict=True)]
    return sum(a and not b for a, b in both), sum(b and not a for a, b in both)


def time_table(found: Answers) -> str:
    """Milliseconds a pair, of all logs and the range of the logs' medians; and how often ours they are."""
    header = ["Matcher", "CPU: median ms", "of the logs", "95 %", "times ours", "clock: median ms", "95 %"]
    return markdown(header, [[name, *_times(by_log, found[OURS])] for name, by_log in found.items()])


def _times(by_log: Mapping[str, Sequence[Answer]], mine: Mapping[str, Sequence[Answer]]) -> list[str]:
    cpu, wall, own = (
        np.array([getattr(one, field) for answers in held.values() for one in answers])
        for field, held in (("cpu_ms", by_log), ("wall_ms", by_log), ("cpu_ms", mine))
    )
    medians = [float(np.median([one.cpu_ms for one in answers])) for answers in by_log.values()]
    spread = f"{min(medians):.0f} to {max(medians):.0f}"
    ratio = f"{float(np.median(cpu / own)):.2f}"
    numbers = (f"{np.median(cpu):.1f}", spread, f"{np.percentile(cpu, 95):.1f}", ratio)
    return [*numbers, f"{np.median(wall):.1f}", f"{np.percentile(wall, 95):.1f}"]


# --- all of it ------------------------------------------------------------------------------------


def pin_to_one_core() -> str:
    """Keep this process, and the libraries it has yet to load, to one core; what was done, in words."""
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    if not hasattr(os, "sched_setaffinity"):
        return "one thread"
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    return "one thread, pinned to one core"


def arguments() -> argparse.ArgumentParser:
    """Folders, logs, how many pairs and how often."""
    parser = common_arguments(__doc__, pairs="--pair-sets")
    parser.add_argument("--pairs", type=int, default=80, help="at most so many pairs of each log")
    parser.add_argument("--repeats", type=int, default=1, help="runs of each pair; the median time counts")
    parser.add_argument("--names", nargs="+", default=None, help="only these logs")
    return parser


def main() -> None:
    """Measure and print."""
    options = arguments().parse_args()
    pinned = pin_to_one_core()
    logs = [one for one in load(options.logs, options.pair_sets) if not options.names or one.name in options.names]
    tried, said = matchers()
    print(provenance(), pinned, *said, sep="; ", end="\n\n")
    print(*(chosen(held, options.pairs)[1] for held in logs), sep="; ", end="\n\n", flush=True)
    found = compare(logs, tried, options.pairs, max(1, options.repeats))
    print(success_table(found), time_table(found), provenance(), sep="\n\n")


if __name__ == "__main__":
    main()
