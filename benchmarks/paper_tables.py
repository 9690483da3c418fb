"""The paper's Tables 1, 2, 5 and 3 on public logs, as Markdown.

    python benchmarks/paper_tables.py [--tables 1 2 3] [--presets default paper-lab] [--threads 1]

Table 1: number and length of segments by log. Tables 2 and 5: the share of pairs whose pose is found within
0.25 m and 5 degrees, by heuristic, and by "the best heuristic" (any one right). Table 3: time and number of
transformations tried on three contrasting pairs. Paper mode throughout: ranges in, the best value out.

The paper's literal parameters keep every short segment, and `all` then tries up to millions of transformations
a pair; with them it runs on every 5th pair of each kind and log (--every), the others on every pair.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from statistics import fmean, median

import numpy as np
from common import POSITIVE, LogPairs, arguments, load, markdown, percent, provenance

from segmap.benchmark import Pair, is_right
from segmap.integration import Match, match_maps
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.scans import LaserLog
from segmap.segments import extract

HEAVY = "paper-lab"
EVERY = 5
REPEATS = 3


@dataclass(frozen=True)
class Trial:
    """A row of Table 2: a heuristic, with some parameters changed."""

    name: str
    heuristic: str
    changes: Mapping[str, object] = field(default_factory=dict)


ALL = Trial("All transformations", "all")
HEURISTICS = (
    ALL,
    Trial("Consecutive line segments", "consecutive"),
    Trial("Random line segments", "random"),
    Trial("Histogram", "histogram"),
)
"""the rows of the paper, in its order"""
VARIANTS = (
    Trial("Consecutive, immediate neighbours", "consecutive", {"consecutive_over_short": False}),
    Trial("Consecutive, refuse_angle 0", "consecutive", {"refuse_angle": 0.0}),
    Trial("Consecutive, refuse_angle 0.2", "consecutive", {"refuse_angle": 0.2}),
)
"""other readings of the same"""
EXAMPLES = (("cluttered", "intel", (47, 36)), ("corridor", "aces", (24, 24)), ("hall", "fr101", (10, 12)))
"""Table 3: a place, a log, and the segments that the paper's pair has there"""


# --- Table 1 --------------------------------------------------------------------------------------


def table_1(logs: Mapping[str, LaserLog], presets: Sequence[str]) -> str:
    """Scans, mean number of segments and their mean length in mm, by log."""
    header = ["Log", "Scans", *(f"{name}: {what}" for name in presets for what in ("segments", "length, mm"))]
    rows = []
    for name, log in logs.items():
        cells = [cell for chosen in presets for cell in _segments(log, preset(chosen))]
        rows.append([name, len(log), *(f"{cell:.1f}" for cell in cells)])
    return markdown(header, rows)


def _segments(log: LaserLog, parameters: Parameters) -> tuple[float, float]:
    """Mean number of segments, and the mean over scans of their mean length, as the paper's total is formed."""
    maps = [extract(scan, parameters) for scan in log]
    lengths = [1000.0 * float(scan.lengths.mean()) for scan in maps if len(scan)]
    return fmean(len(scan) for scan in maps), fmean(lengths)


# --- Tables 2 and 5 -------------------------------------------------------------------------------

Rights = dict[str, dict[str, list[bool]]]
"""trial -> log -> whether each pair was right"""


def rights(logs: Sequence[LogPairs], kind: str, trials: Sequence[Trial], parameters: Parameters, **how: int) -> Rights:
    """Whether each trial finds each pair; ``how``: every (n-th pair), threads."""
    found: Rights = {trial.name: {} for trial in trials}
    with ThreadPoolExecutor(how.get("threads", 1)) as pool:
        for held in logs:
            pairs = held.of_kind(kind, how.get("every", 1))
            rows = pool.map(lambda pair, held=held: _tried(held, pair, trials, parameters), pairs)
            for name, column in zip(found, np.array(list(rows)).T, strict=True):
                found[name][held.name] = column.tolist()
    return found


def _tried(held: LogPairs, pair: Pair, trials: Sequence[Trial], parameters: Parameters) -> list[bool]:
    return [is_right(_match(held, pair, trial, parameters).T_1_2, pair.truth) for trial in trials]


def _match(held: LogPairs, pair: Pair, trial: Trial, parameters: Parameters) -> Match:
    chosen = parameters.replace(**trial.changes)
    return match_maps(*held.maps(pair, chosen), chosen, trial.heuristic)


def any_right(found: Rights, trials: Iterable[Trial]) -> dict[str, list[bool]]:
    """Whether any of some trials is right, by log."""
    columns = [found[trial.name] for trial in trials if trial.name in found]
    return {name: np.any([column[name] for column in columns], axis=0).tolist() for name in columns[0]}


def success_table(found: Rights, logs: Sequence[str]) -> str:
    """Success in percent: the mean of the logs, then each log."""
    counted = [trial for trial in HEURISTICS if trial.name in found]
    best = f"Using the best of these {len(counted)}"
    ordered = {trial.name: found[trial.name] for trial in counted}
    ordered[best] = any_right(found, counted)
    ordered |= {name: by_log for name, by_log in found.items() if name not in ordered}
    rows = [[name, *map(percent, _shares(by_log, logs))] for name, by_log in ordered.items()]
    return markdown(["Heuristic", "mean %", *logs], rows)


def _shares(by_log: Mapping[str, Sequence[bool]], logs: Sequence[str]) -> list[float]:
    shares = [fmean(by_log[name]) for name in logs]
    return [fmean(shares), *shares]


def table_2(logs: Sequence[LogPairs], chosen: str, every: int, threads: int) -> Iterator[str]:
    """Tables 2 and 5 with one preset, for consecutive and wide pairs; where it is heavy, `all` on a subset."""
    for kind in POSITIVE:
        heavy = chosen == HEAVY and every > 1
        trials = [trial for trial in (*HEURISTICS, *VARIANTS) if not (heavy and trial is ALL)]
        yield _titled_success(logs, kind, trials, chosen, 1, threads)
        if heavy:
            yield _titled_success(logs, kind, HEURISTICS, chosen, every, threads)


def _titled_success(
    logs: Sequence[LogPairs], kind: str, trials: Sequence[Trial], chosen: str, every: int, threads: int
) -> str:
    found = rights(logs, kind, trials, preset(chosen), every=every, threads=threads)
    counts = ", ".join(f"{len(held.of_kind(kind, every))} of {held.name}" for held in logs)
    which = "every pair" if every == 1 else f"every {every}th pair"
    title = f"**{kind}, {chosen}, {which}** ({counts})"
    return f"{title}\n\n{success_table(found, [held.name for held in logs])}"


# --- Table 3 --------------------------------------------------------------------------------------


def table_3(logs: Sequence[LogPairs], chosen: str = HEAVY, repeats: int = REPEATS) -> str:
    """Time and transformations tried by heuristic, on the pair of each place nearest to the paper's in segments."""
    parameters = preset(chosen)
    header, captions, sizes_row, columns = ["Heuristic"], [], ["Number of line segments"], []
    for place, held, pair in _examples(logs, parameters):
        n_1, n_2 = map(len, held.maps(pair, parameters))
        header += [f"{place}: ms", "tried", "right"]
        captions.append(f"{place}: scans {pair.i} and {pair.j} of {held.name}")
        sizes_row += [f"{n_1}, {n_2}", "", ""]
        columns.append([_cost(held, pair, trial, parameters, repeats) for trial in HEURISTICS])
    rows = [[trial.name, *chain(*cells)] for trial, *cells in zip(HEURISTICS, *columns, strict=True)]
    return "; ".join(captions) + "\n\n" + markdown(header, [sizes_row, *rows])


def _examples(logs: Sequence[LogPairs], parameters: Parameters) -> Iterator[tuple[str, LogPairs, Pair]]:
    for place, name, sizes in EXAMPLES:
        for held in logs:
            if held.name == name:
                yield place, held, nearest(held, sizes, parameters)


def nearest(held: LogPairs, sizes: tuple[int, int], parameters: Parameters) -> Pair:
    """The positive pair whose numbers of segments are nearest to some sizes; the first of equals."""
    positive = [pair for kind in POSITIVE for pair in held.of_kind(kind)]
    counts = np.array([[len(scan) for scan in held.maps(pair, parameters)] for pair in positive])
    return positive[int(np.abs(counts - sizes).sum(axis=1).argmin())]


def _cost(held: LogPairs, pair: Pair, trial: Trial, parameters: Parameters, repeats: int) -> list[str]:
    """Median time of some runs after one to warm up, transformations tried, and whether the pose is right."""
    matches = [_match(held, pair, trial, parameters) for _ in range(repeats + 1)][1:]
    match = matches[-1]
    tried = f"{match.candidates:,}" + (f" of {match.draws:,} draws" if match.draws is not None else "")
    right = "yes" if is_right(match.T_1_2, pair.truth) else "no"
    return [f"{median(one.milliseconds for one in matches):.2f}", tried, right]


# --- all of it ------------------------------------------------------------------------------------


def log_files(folder: Path) -> dict[str, LaserLog]:
    """Every log below a folder, by file name."""
    return {path.name.split(".")[0]: read_log(path) for path in sorted(folder.glob("*/*.log*"))}


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--tables", nargs="+", type=int, choices=(1, 2, 3), default=(1, 2, 3))
    parser.add_argument("--presets", nargs="+", default=("default", HEAVY))
    parser.add_argument("--every", type=int, default=EVERY, help=f"`all` with {HEAVY}: every so manieth pair")
    parser.add_argument("--threads", type=int, default=1, help="pairs matched at a time for Tables 2 and 5")
    options = parser.parse_args()
    print(provenance(), end="\n\n", flush=True)
    if 1 in options.tables:
        print("### Table 1", table_1(log_files(options.logs), options.presets), sep="\n\n", end="\n\n", flush=True)
    logs = load(options.logs, options.pairs) if {2, 3} & {*options.tables} else []
    for chosen in options.presets if 2 in options.tables else ():
        print(f"### Tables 2 and 5, preset {chosen}", end="\n\n")
        for table in table_2(logs, chosen, options.every, options.threads):
            print(table, end="\n\n", flush=True)
    if 3 in options.tables:
        print(f"### Table 3, preset {HEAVY}", table_3(logs), sep="\n\n")


if __name__ == "__main__":
    main()
