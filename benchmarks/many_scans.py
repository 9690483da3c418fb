"""Whole maps of logs in parts, and their cost as a log grows, as Markdown.

    python benchmarks/many_scans.py [--tables parts growth] [--logs DIR] [--names intel ...]

``parts``: a log split into four overlapping parts in shuffled order, as of four robots; the parts share scans, or,
harder, take turns in scans where they overlap. Every scan is compared with the log's own pose once all are laid on
these at best, and relative to those within 5 m. ``growth``: processor seconds and memory of mapping the first 100,
300, 1,000 and 3,000 scans, each in a process of its own.

A scan that is farther from the log's own pose than it may be is looked at: how far, at our poses and at the log's, is
it from where what the scans before and after it see would have it? The smaller one is right.
"""

from __future__ import annotations

import math
import multiprocessing
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from closures import LOGS, pose_of
from common import arguments, laid_on, markdown, provenance
from scipy.spatial import cKDTree

from segmap.logs import read_log
from segmap.mapping import WholeMap, map_scans
from segmap.parameters import Parameters, preset
from segmap.pose import FloatArray, Pose2
from segmap.refinement import refined
from segmap.scans import LaserLog, ScanId
from segmap.segments import SegmentMap, extract
from segmap.visibility import sighting

DENSE = ("intel/intel-graph.log.gz", "fr079/fr079-graph.log.gz")
"""logs for the growth, one after the other"""
PARTS, OVERLAP = 4, 40
"""parts of a log, and scans in which each overlaps the next"""
SIZES = (100, 300, 1000, 3000)


# --- a log in parts -------------------------------------------------------------------------------


def parts(name: str, log: LaserLog, parameters: Parameters, workers: int) -> Iterator[list[object]]:
    """A line for each way of splitting a log."""
    for how, groups in (("share scans", _sharing(len(log))), ("take turns", _taking_turns(len(log)))):
        order = np.random.default_rng(4).permutation(len(groups))
        scans = {ScanId(number, i): index for number, k in enumerate(order) for i, index in enumerate(groups[k])}
        maps = {scan: extract(log[index], parameters, *scan) for scan, index in scans.items()}
        started = time.perf_counter()
        whole = map_scans(maps, parameters, workers=workers)
        minutes = (time.perf_counter() - started) / 60.0
        largest = whole.components[0]
        off = _aligned([whole.poses[s] for s in largest], [pose_of(log, scans[s]) for s in largest])
        near = [_worst_near(whole, log, scans, largest)]
        yield [
            name,
            how,
            " ".join(str(k + 1) for k in order),
            len(maps),
            ", ".join(str(len(part)) for part in whole.components),
            f"{len(largest) / len(maps):.1%}",
            f"{np.median(off[:, 0]):.3f} / {np.percentile(off[:, 0], 95):.3f} / {off[:, 0].max():.3f}",
            f"{np.median(off[:, 1]):.2f} / {off[:, 1].max():.2f}",
            f"{1.0 - np.mean([_far(d, t) for d, t in off]):.1%}",
            "; ".join(
                _outside(maps, whole, log, scans, s) for s, (d, t) in zip(largest, off, strict=True) if _far(d, t)
            ),
            *near,
            f"{minutes:.1f}",
        ]


PARTED = (
    "log", "parts", "order", "scans", "components", "placed", "off, m: median / 95 % / most", "deg: median / most",
    "within 0.25 m and 5 deg", "the others, beside their neighbours: ours, the log's",
    "relative, within 5 m: 95 % / most, m", "minutes",
)  # fmt: skip


def _sharing(count: int) -> list[range]:
    """Parts of which each begins before the one before ends."""
    step = math.ceil(count / PARTS)
    return [range(max(0, k * step - OVERLAP // 2), min(count, (k + 1) * step + OVERLAP // 2)) for k in range(PARTS)]


def _taking_turns(count: int) -> list[list[int]]:
    """The same; of the scans where two overlap each has every other one."""
    owners = [[k for k, part in enumerate(_sharing(count)) if i in part] for i in range(count)]
    return [[i for i, own in enumerate(owners) if own[i % len(own)] == k] for k in range(PARTS)]


def _aligned(found: Sequence[Pose2], true: Sequence[Pose2]) -> FloatArray:
    """How far poses are from where they should be, metres and degrees (n, 2), once all are laid on them at best."""
    T = laid_on(found, true)
    return np.array([(d, math.degrees(t)) for p, q in zip(found, true, strict=True) for d, t in [(T @ p).distance(q)]])


def _far(metres: float, degrees: float) -> bool:
    return metres > 0.25 or degrees > 5.0


def _outside(
    maps: Mapping[ScanId, SegmentMap], whole: WholeMap, log: LaserLog, scans: Mapping[ScanId, int], scan: ScanId
) -> str:
    """How far one scan is from what its neighbours see, as we have them all and as the log has."""
    true = {other: pose_of(log, index) for other, index in scans.items()}
    found = [_askew(maps, poses, scan) for poses in (whole.poses, true)]
    return f"{scans[scan]}: " + ", ".join(f"{metres:.2f} m {degrees:.1f} deg" for metres, degrees in found)


def _askew(maps: Mapping[ScanId, SegmentMap], poses: Mapping[ScanId, Pose2], scan: ScanId) -> tuple[float, float]:
    """How far a scan moves when it is drawn to what the two before and the two after it see together."""
    around = [ScanId(scan.log, scan.scan + k) for k in (-2, -1, 1, 2) if ScanId(scan.log, scan.scan + k) in poses]
    back = poses[scan].inverse()
    view = sighting(SegmentMap.joined(maps[other].moved(back @ poses[other]) for other in around))
    seen = sighting(maps[scan])
    if view is None or seen is None:
        return math.nan, math.nan
    moved = Pose2(*map(float, refined(view, seen, np.zeros((1, 3)), 10, 0.3, 0.05)[0]))
    return math.hypot(moved.x, moved.y), math.degrees(abs(moved.theta))


def _worst_near(whole: WholeMap, log: LaserLog, scans: Mapping[ScanId, int], part: Sequence[ScanId]) -> str:
    true = [pose_of(log, scans[scan]) for scan in part]
    places = np.array([(pose.x, pose.y) for pose in true])
    off = [
        (whole.poses[part[i]].inverse() @ whole.poses[part[j]]).distance(true[i].inverse() @ true[j])[0]
        for i, j in sorted(cKDTree(places).query_pairs(5.0))[::7]
    ]
    return f"{np.percentile(off, 95):.3f} / {max(off):.3f}"


# --- cost as the log grows ------------------------------------------------------------------------


def growth(logs: Sequence[Path]) -> Iterator[list[object]]:
    """A line for each size, and one with the slopes: the power of the number of scans that cost grows with."""
    measured = []
    for size in SIZES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found = pool.apply(_cost, (logs, size))
        measured.append(found)
        seconds, megabytes, keys, matched = found[1:]
        yield [
            f"{found[0]:,}",
            keys,
            f"{matched:,}",
            f"{seconds:.1f}",
            f"{1000.0 * seconds / found[0]:.0f}",
            f"{megabytes:.0f}",
        ]
    sizes, seconds, memory = (np.log([row[k] for row in measured]) for k in (0, 1, 2))
    slopes = [float(np.polyfit(sizes, column, 1)[0]) for column in (seconds, memory)]
    last = [float(np.diff(column[-2:])[0] / np.diff(sizes[-2:])[0]) for column in (seconds, memory)]
    yield ["slope", "", "", f"{slopes[0]:.2f} (last {last[0]:.2f})", "", f"{slopes[1]:.2f} (last {last[1]:.2f})"]


GROWTH = ("scans", "keyframes", "pairs matched", "processor s", "ms a scan", "memory, MB")


def _cost(logs: Sequence[Path], size: int) -> tuple[int, float, float, int, int]:
    """Scans, processor seconds, peak memory in MB, keyframes and pairs matched: one process, kernels compiled."""
    parameters = preset("verified")
    scans = [(number, i, scan) for number, path in enumerate(logs) for i, scan in enumerate(read_log(path))][:size]
    few = {ScanId(number, i): extract(scan, parameters, number, i) for number, i, scan in scans[:12]}
    map_scans(few, parameters)
    started = time.process_time()
    maps = {ScanId(number, i): extract(scan, parameters, number, i) for number, i, scan in scans}
    whole = map_scans(maps, parameters)
    seconds = time.process_time() - started
    return len(maps), seconds, _most_memory(), len(whole.keys), len(whole.matches)


def _most_memory() -> float:
    """MB this process had at the most; what getrusage tells may be its parent's."""
    held = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(held[1]) / 1024.0 if held else math.nan


# --- all of it ------------------------------------------------------------------------------------


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--names", nargs="+", choices=LOGS, default=["intel"])
    parser.add_argument("--tables", nargs="+", default=("parts", "growth"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(provenance(), end="\n\n", flush=True)
    logs = {name: read_log(options.logs / LOGS[name]) for name in options.names}
    tables: dict[str, tuple[str, Sequence[str], Callable[[], Iterable[list[object]]]]] = {
        "parts": ("A log in four parts", PARTED, lambda: _parted(logs, preset("verified"), options.workers)),
        "growth": ("Cost as the log grows", GROWTH, lambda: growth([options.logs / path for path in DENSE])),
    }
    for name in options.tables:
        title, header, rows = tables[name]
        print(f"### {title}\n\n{markdown(header, list(rows()))}", end="\n\n", flush=True)


def _parted(logs: Mapping[str, LaserLog], parameters: Parameters, workers: int) -> Iterator[list[object]]:
    for name, log in logs.items():
        yield from parts(name, log, parameters, workers)


if __name__ == "__main__":
    main()
