"""How fast: the value of every candidate, the exact best of all, and a pair from ranges to verdict.

    python benchmarks/speed.py [--parts evaluation exact pairs] [--repeats 5]

evaluation: the value of about 41,000 candidates between real scans trimmed to 47 and 36 segments (the size of
the paper's S4 and S5) at the paper's parameters, no candidate left out, after warm-up; and the plain numpy twin
of the tests (tests/helpers/plain_reading.py) on every 40th of the same candidates, extrapolated, as a ratio. A
candidate that long crossing segments discard costs less; without discarding, all pairs of segments are summed.
The least time is beside the median: on a machine that others use it says more of the program.
exact: from two maps to the best of all candidates, for 47 x 36 and 63 x 63 segments, `all`, paper mode; of that,
finding the candidates and searching them; beside the search the value of every candidate (brute force) and the
numpy twin, as ratios. That all give the same best is checked first.
pairs: every pair of the benchmark from ranges to verdict on one thread, each the median of its repeats.
Medians throughout; the load of the machine is printed with them.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from types import ModuleType

import numpy as np
from common import LogPairs, arguments, load, markdown, provenance, trimmed

from segmap.benchmark import run_pairs
from segmap.candidates import Candidates, candidates
from segmap.evaluation import best, evaluate, search
from segmap.integration import DEFAULT_HEURISTIC, match_maps
from segmap.parameters import Parameters, preset
from segmap.pose import FloatArray
from segmap.segments import SegmentMap

PAPER_SIZES = (47, 36)
PAPER_CANDIDATES = 41_260
LARGE_SIZES = (63, 63)
TWIN_SHARE = 40
"""the twin evaluates every so manieth candidate"""
TWIN_LEAST = 1000
"""candidates the twin evaluates where the exact best is sought"""
NO_DISCARD = 100.0
"""metres; no segment is longer, so none discards"""
THREADS = 2
MODES = {"paper": "default", "verified": "verified"}
"""mode -> preset"""

Maps = tuple[SegmentMap, SegmentMap]


@dataclass(frozen=True)
class Timing:
    """Times of some runs, in seconds."""

    median: float
    least: float

    def shown(self, unit: float = 1.0, digits: int = 3) -> str:
        """Median and least, in seconds times ``unit``."""
        return f"{self.median * unit:.{digits}f} ({self.least * unit:.{digits}f})"


def timed(run: Callable[[], object], repeats: int) -> Timing:
    """The times of some runs, after one to warm up."""
    run()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        run()
        times.append(time.perf_counter() - started)
    return Timing(median(times), min(times))


# --- the value of every candidate -----------------------------------------------------------------


def poses_between(maps: Maps, count: int, parameters: Parameters) -> FloatArray:
    """``count`` of all candidates, evenly spread; fewer where there are fewer."""
    poses = _all_candidates(maps, parameters).poses
    chosen: FloatArray = poses[np.unique(np.linspace(0, len(poses) - 1, min(count, len(poses))).astype(int))]
    return chosen


def evaluation_table(maps: Maps, poses: FloatArray, parameters: Parameters, repeats: int) -> str:
    """Seconds for every candidate's value, median (least), and how much longer the plain twin takes."""
    header = ["Reading", "candidates", "discarded", *(f"{n} thread{'s' * (n > 1)}, s" for n in (1, THREADS))]
    header += ["numpy twin, s (extrapolated)", "twin / 1 thread", f"twin / {THREADS} threads"]
    without = parameters.replace(segment_length_refuse=NO_DISCARD)
    readings = {"crossings discard": parameters, "no candidate discarded": without}
    rows = [[name, *_evaluation_row(maps, poses, chosen, repeats)] for name, chosen in readings.items()]
    return markdown(header, rows)


def _evaluation_row(maps: Maps, poses: FloatArray, parameters: Parameters, repeats: int) -> list[str]:
    values = evaluate(*maps, poses, parameters)
    few, twin = poses[::TWIN_SHARE], plain_reading().values
    if not np.allclose(twin(*maps, few, parameters), values[::TWIN_SHARE], rtol=0.0, atol=1e-9, equal_nan=True):
        raise SystemExit("The plain reading gives other values: the times cannot be compared.")
    plain = timed(lambda: twin(*maps, few, parameters), repeats).median * len(poses) / len(few)
    ours = [timed(partial(evaluate, *maps, poses, parameters, workers=n), repeats) for n in (1, THREADS)]
    counts = [f"{len(poses):,}", f"{int(np.isnan(values).sum()):,}"]
    return [*counts, *(one.shown() for one in ours), f"{plain:.1f}", *(f"{plain / one.median:.0f}" for one in ours)]


def plain_reading() -> ModuleType:
    """The plain numpy twin, which lies with the tests."""
    folder = str(Path(__file__).resolve().parents[1] / "tests" / "helpers")
    if folder not in sys.path:
        sys.path.append(folder)
    return importlib.import_module("plain_reading")


# --- the exact best -------------------------------------------------------------------------------


def exact_table(sized: Sequence[Maps], parameters: Parameters, repeats: int) -> str:
    """Milliseconds from two maps to the best of all candidates on one thread and two, and of what: median (least)."""
    header = ["Segments", "candidates", "best, m", "1 thread, ms", f"{THREADS} threads, ms", "candidates alone, ms"]
    header += [f"{what}, {THREADS} threads, ms" for what in ("search alone", "every value")]
    return markdown(
        [*header, "every value / search", "numpy twin / search"], [_exact_row(m, parameters, repeats) for m in sized]
    )


def _exact_row(maps: Maps, parameters: Parameters, repeats: int) -> list[str]:
    wanted = parameters.ranked_candidates
    tried = partial(_all_candidates, maps, parameters)
    poses = tried().poses
    values, found = evaluate(*maps, poses, parameters), search(*maps, poses, parameters, wanted)
    if not (np.array_equal(found.rows, best(values, wanted)) and np.array_equal(found.values, values[found.rows])):
        raise SystemExit("The search gives other candidates than all values: the times cannot be compared.")
    whole = [timed(partial(match_maps, *maps, parameters, "all", workers=n), repeats) for n in (1, THREADS)]
    alone = timed(partial(search, *maps, poses, parameters, wanted, workers=THREADS), repeats)
    every = timed(partial(evaluate, *maps, poses, parameters, workers=THREADS), repeats)
    few = poses[:: max(1, len(poses) // TWIN_LEAST)]
    plain = timed(lambda: plain_reading().values(*maps, few, parameters), 1).median * len(poses) / len(few)
    shown = [one.shown(1000.0, 1) for one in (*whole, timed(tried, repeats), alone, every)]
    ratios = [f"{every.median / alone.median:.1f}", f"{plain / alone.median:.0f}"]
    size = " x ".join(str(len(scan)) for scan in maps)
    return [size, f"{len(poses):,}", f"{max(found.values, default=0.0):.2f}", *shown, *ratios]


def _all_candidates(maps: Maps, parameters: Parameters) -> Candidates:
    return Candidates.joined(list(candidates(*maps, "all", parameters)))


# --- a pair, from ranges to verdict ---------------------------------------------------------------


def pair_times(held: LogPairs, mode: str, repeats: int, every: int = 1) -> FloatArray:
    """Milliseconds of each pair of a log on one thread: the median of its repeats."""
    chosen = held.pair_set(every)
    run_pairs(chosen.model_copy(update={"pairs": chosen.pairs[:3]}), held.log, preset(MODES[mode]), mode=mode)
    runs = [
        run_pairs(chosen, held.log, preset(MODES[mode]), DEFAULT_HEURISTIC[mode], mode) for _ in range(max(1, repeats))
    ]
    return np.median([[outcome.milliseconds for outcome in run] for run in runs], axis=0)


def pairs_table(logs: Sequence[LogPairs], repeats: int, every: int = 1) -> str:
    """Median and 95th percentile by log and mode, all kinds of pairs together."""
    rows: list[list[object]] = []
    everything: dict[str, list[FloatArray]] = {mode: [] for mode in MODES}
    for held in logs:
        times = {mode: pair_times(held, mode, repeats, every) for mode in MODES}
        for mode in MODES:
            everything[mode].append(times[mode])
        rows.append([held.name, len(times["paper"]), *_spread(times)])
    together = {mode: np.concatenate(parts) for mode, parts in everything.items()}
    rows.append(["all", len(together["paper"]), *_spread(together)])
    return markdown(["Log", "pairs", *(f"{mode}: {what}" for mode in MODES for what in ("median ms", "95 % ms"))], rows)


def _spread(times: dict[str, FloatArray]) -> list[str]:
    return [f"{share:.1f}" for held in times.values() for share in np.percentile(held, (50, 95))]


# --- all of it ------------------------------------------------------------------------------------


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--parts", nargs="+", choices=("evaluation", "exact", "pairs"), default=None)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    parts = options.parts or ("evaluation", "exact", "pairs")
    logs = load(options.logs, options.pairs)
    print(provenance(), end="\n\n", flush=True)
    parameters = preset("paper-lab")
    if "evaluation" in parts:
        maps = trimmed(logs, PAPER_SIZES, parameters)
        poses = poses_between(maps, PAPER_CANDIDATES, parameters)
        _print("Every candidate's value", evaluation_table(maps, poses, parameters, options.repeats))
    if "exact" in parts:
        sized = [trimmed(logs, sizes, parameters) for sizes in (PAPER_SIZES, LARGE_SIZES)]
        _print("The exact best", exact_table(sized, parameters, options.repeats))
    if "pairs" in parts:
        _print("From ranges to verdict, one thread", pairs_table(logs, options.repeats))


def _print(title: str, table: str) -> None:
    print(f"### {title}", table, provenance(), sep="\n\n", end="\n\n", flush=True)


if __name__ == "__main__":
    main()
