"""Merging on public logs, as Markdown: the paper's Section V-B, Table 4, Figs. 16 and 17, and clean maps of whole logs.

    python benchmarks/merging.py [--tables methods online robots fusion] [--logs DIR] [--names intel aces ...]

``methods``: sequential, tree and pivot on stretches of 29 scans, as many as the paper merged. ``online``: milliseconds
for each new scan, by method. ``robots``: four local maps of ten scans, two shared with the next, all pairs integrated.
``fusion``: doubles along walls before and after all scans of a log are fused at once, at the log's own poses.

Merging gets ranges and nothing else; a neighbour is right within 0.25 m and 5 degrees of the log's own poses, which
are good to about 0.1 m. Times are processor seconds of one thread, kernels compiled.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path
from statistics import median

import shapely
from common import SHARED, markdown, provenance

from segmap.benchmark import is_right
from segmap.fusion import fuse_all, spurious_length
from segmap.integration import match_maps
from segmap.logs import read_log
from segmap.merging import METHODS, Component, Merge, extend, merge
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.scans import LaserLog, ScanId
from segmap.segments import SegmentMap, extract

LOGS = {
    "intel": ("intel/intel-corrected.log.gz", 3),
    "aces": ("aces/aces-corrected.log.gz", 2),
    "csail": ("csail/csail-corrected.log.gz", 2),
    "fr101": ("fr101/freiburg-101-corrected.log.gz", 2),
    "fr079": ("fr079/fr079-graph.log.gz", 4),
}
"""file, and every which scan is taken: about a metre apart"""
SCANS = 29
"""in a stretch, as in the paper's Section V-B"""
NEW = 7
"""scans merged one by one, as in the paper's Table 4"""
NEAR = 0.3
"""metres; walls of two local maps nearer than this are one"""
LOCAL, SHARED_SCANS, ROBOTS = 10, 2, 4
PLACED = 0.5, math.radians(5.0)
"""metres and radians; two local maps nearer than this to the log's poses are placed right: each has drifted a little"""
MODES: tuple[tuple[str, str | None], ...] = (("verified", None), ("paper", None))
PAPER_HEURISTICS = ("consecutive", "histogram", "random")
"""for partial maps in paper mode: what the paper used, and the others that do not try everything"""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Some scans of a log."""

    name: str
    log: LaserLog
    start: int
    stride: int
    count: int

    @property
    def ids(self) -> list[ScanId]:
        """The scans."""
        last = min(len(self.log), self.start + self.stride * self.count)
        return [ScanId(0, index) for index in range(self.start, last, self.stride)]

    def maps(self, parameters: Parameters) -> dict[ScanId, SegmentMap]:
        """The segments of its scans."""
        return {scan: extract(self.log[scan.scan], parameters, 0, scan.scan) for scan in self.ids}

    def between(self, parameters: Parameters) -> dict[ScanId, SegmentMap]:
        """The segments of all scans from its first to its last."""
        return replace(self, stride=1, count=(len(self.ids) - 1) * self.stride + 1).maps(parameters)

    def truth(self, a: ScanId, b: ScanId) -> Pose2:
        """``T_a_b`` by the log's own poses."""
        T_w_a, T_w_b = (self.log[scan.scan].logged_pose for scan in (a, b))
        assert T_w_a is not None
        assert T_w_b is not None
        return T_w_a.inverse() @ T_w_b


def timed(work: Callable[[], Merge]) -> tuple[Merge, float]:
    """What some work gives, and the processor seconds it takes."""
    started = time.process_time()
    result = work()
    return result, time.process_time() - started


# --- the three methods (Section V-B) --------------------------------------------------------------


def methods(stretches: Iterable[Stretch]) -> Iterator[str]:
    """A table for each mode and stretch: calls, seconds, segments, doubles, components, and neighbours placed wrong."""
    header = [
        "Scans",
        "Method",
        *("calls", "s", "slowest call, s", "components", "largest", "wrong neighbours", "for review"),
        *("segments", "length, m", "spurious, m", "fused at once: segments", "spurious, m"),
    ]
    stretches = list(stretches)
    for mode, heuristic in MODES:
        for stretch in stretches:
            yield f"**{mode} mode**\n\n{markdown(header, list(_rows(stretch, mode, heuristic)))}"


def _rows(stretch: Stretch, mode: str, heuristic: str | None) -> Iterator[list[object]]:
    parameters = _parameters(mode)
    maps, between = stretch.maps(parameters), stretch.between(parameters)
    for method in METHODS:
        made, seconds = timed(lambda method=method: merge(maps, parameters, heuristic, mode, method, between=between))
        yield [_about(stretch), method, *_cost(made, seconds), *_result(made, stretch, between, parameters)]


def _about(stretch: Stretch) -> str:
    ids = stretch.ids
    return f"{stretch.name} {ids[0].scan} to {ids[-1].scan}, every {stretch.stride}."


def _cost(made: Merge, seconds: float) -> list[str]:
    slowest = max((call.match.milliseconds for call in made.calls), default=0.0) / 1000.0
    return [str(len(made.calls)), f"{seconds:.1f}", f"{slowest:.2f}"]


def _result(made: Merge, stretch: Stretch, maps: Mapping[ScanId, SegmentMap], parameters: Parameters) -> list[str]:
    held = [component for component in made.components if len(component.scans) > 1]
    clean = [fuse_all(maps, component.poses, parameters) for component in held]
    steps = [node.step for part in made.components if part.tree for node in part.tree.nodes() if node.step]
    return [
        str(len(made.components)),
        str(max(len(component.scans) for component in made.components)),
        str(sum(_wrong(component, stretch) for component in held)),
        str(sum(step.review for step in steps)),
        str(sum(len(component.map) for component in held)),
        f"{sum(component.map.lengths.sum() for component in held):.0f}",
        f"{sum(spurious_length(component.map) for component in held):.1f}",
        str(sum(map(len, clean))),
        f"{sum(map(spurious_length, clean)):.1f}",
    ]


def _wrong(component: Component, stretch: Stretch) -> int:
    """How many scans are placed wrong beside the one before."""
    order, poses = sorted(component.scans), component.poses
    return sum(not is_right(poses[a].inverse() @ poses[b], stretch.truth(a, b)) for a, b in pairwise(order))


# --- one scan more (Table 4) ----------------------------------------------------------------------


def online(logs: Mapping[str, LaserLog], repeats: int = 3) -> Iterator[str]:
    """Milliseconds for each new scan, the median of some runs, where every pair of neighbours integrates."""
    for mode, heuristic in (("paper", "consecutive"), ("paper", "all"), ("verified", None)):
        for name, log in logs.items():
            how = f"{name}, {mode} mode, {heuristic or 'automatic'}"
            stretch = _held(name, log, mode, heuristic)
            if stretch is None:
                yield f"**{how}**: no {NEW} scans in a row integrate."
                continue
            columns = [_added(stretch, method, mode, heuristic, repeats) for method in METHODS]
            cells = [
                [f"scan {scan.scan}", *(f"{1000.0 * seconds:.1f}" for seconds in row)]
                for scan, row in zip(stretch.ids[1:], zip(*columns, strict=True), strict=True)
            ]
            yield f"**{how}**\n\n{markdown(['New scan', *METHODS], cells)}"


def _held(name: str, log: LaserLog, mode: str, heuristic: str | None) -> Stretch | None:
    """The first stretch whose neighbours all integrate."""
    parameters = _parameters(mode)
    for start in range(0, len(log) - LOGS[name][1] * NEW, NEW):
        stretch = Stretch(name, log, start, LOGS[name][1], NEW)
        if len(merge(stretch.maps(parameters), parameters, heuristic, mode).components) == 1:
            return stretch
    return None


def _added(stretch: Stretch, method: str, mode: str, heuristic: str | None, repeats: int) -> list[float]:
    """Seconds for each scan but the first; one run before those that count, to warm up.

    A scan that the method does not integrate is placed by the pair for the next one, at no cost.
    """
    parameters = _parameters(mode)
    maps = stretch.maps(parameters)
    by_pair = merge(maps, parameters, heuristic, mode).matches
    runs: list[list[float]] = []
    for _ in range(repeats + 1):
        first, *new = stretch.ids
        made = merge({first: maps[first]}, parameters, heuristic, mode, method)
        runs.append([])
        for scan in new:
            started = time.process_time()
            grown = extend(made, scan, maps[scan], parameters, heuristic, mode)
            runs[-1].append(time.process_time() - started)
            if len(grown.components) > 1:
                grown = extend(made, scan, maps[scan], parameters, heuristic, mode, given=by_pair)
            made = grown
    return [median(times) for times in zip(*runs[1:], strict=True)]


def _parameters(mode: str) -> Parameters:
    return preset("verified" if mode == "verified" else "default")


# --- many robots (Figs. 16 and 17) ----------------------------------------------------------------


def robots(logs: Mapping[str, LaserLog]) -> Iterator[str]:
    """All pairs of four local maps: values of right and wrong integrations."""
    header = ["Pair", "scans shared", "overlap, %", "segments", *PAPER_HEURISTICS, "verified: confidence", "value", "s"]
    for name, log in logs.items():
        found = _local_maps(name, log)
        if found is None:
            yield f"**{name}**: no {ROBOTS} local maps of {LOCAL} scans each hold together."
            continue
        stretch, parts = found
        lengths = ", ".join(f"{part.map.lengths.sum():.0f} m" for part in parts)
        rows = [_pair(stretch, parts, i, j) for i, j in combinations(range(ROBOTS), 2)]
        yield f"**{_about(stretch)}** Length of the local maps: {lengths}.\n\n{markdown(header, rows)}"


def _local_maps(name: str, log: LaserLog) -> tuple[Stretch, list[Component]] | None:
    """The first stretch of a log whose four local maps each hold together, and those maps.

    Scans as far apart as elsewhere if there is such a stretch; else, as in cluttered rooms, closer together.
    """
    for stride in range(LOGS[name][1], 0, -1):
        step = (LOCAL - SHARED_SCANS) * stride
        parts: list[Component] = []
        for start in range(0, len(log) - (LOCAL - 1) * stride, step):
            part = _local_map(Stretch(name, log, start, stride, LOCAL))
            parts = [*parts, part] if part else []
            if len(parts) == ROBOTS:
                count = ROBOTS * (LOCAL - SHARED_SCANS) + SHARED_SCANS
                return Stretch(name, log, start - (ROBOTS - 1) * step, stride, count), parts
    return None


def _local_map(stretch: Stretch) -> Component | None:
    """The map of a stretch if it holds together and every scan of it is right beside the one before."""
    parameters = preset("verified")
    between = stretch.between(parameters)
    components = merge(stretch.maps(parameters), parameters, None, "verified", between=between).components
    return None if len(components) > 1 or _wrong(components[0], stretch) else components[0]


def _pair(stretch: Stretch, parts: Sequence[Component], i: int, j: int) -> list[object]:
    """Value of the best transformation by heuristic, and what verified mode says; wrong ones in brackets."""
    first, second = parts[i], parts[j]
    truth = stretch.truth(first.scans[0], second.scans[0])
    overlap = set(first.scans) & set(second.scans)
    common = _overlap(first.map, second.map.moved(truth))
    cells: list[object] = [f"L{i + 1}, L{j + 1}", len(overlap), f"{100.0 * common:.0f}"]
    cells.append(f"{len(first.map)}, {len(second.map)}")
    for heuristic in PAPER_HEURISTICS:
        match = match_maps(first.map, second.map, Parameters(), heuristic)
        cells.append(_told(f"{match.value:.1f} m", match.T_1_2, truth))
    started = time.process_time()
    match = match_maps(first.map, second.map, preset("verified"), None, "verified")
    seconds = time.process_time() - started
    sure = f"{match.confidence or 0.0:.3f} {match.verdict}"
    return [*cells, _told(sure, match.T_1_2, truth), f"{match.value:.1f} m", f"{seconds:.2f}"]


def _overlap(map_1: SegmentMap, map_2: SegmentMap) -> float:
    """Share of the length of the smaller of two maps of one frame that lies near the other."""
    lines_1, lines_2 = (shapely.multilinestrings(m.coordinates.reshape(-1, 2, 2)) for m in (map_1, map_2))
    small, large = sorted((lines_1, lines_2), key=lambda lines: lines.length)
    return float(small.intersection(large.buffer(NEAR)).length / small.length)


def _told(text: str, T_1_2: Pose2 | None, truth: Pose2) -> str:
    metres, radians = T_1_2.distance(truth) if T_1_2 else (math.inf, math.inf)
    return text if metres <= PLACED[0] and radians <= PLACED[1] else f"({text})"


# --- whole logs -----------------------------------------------------------------------------------


def fusion(logs: Mapping[str, LaserLog]) -> str:
    """Doubles along walls before and after."""
    header = ["Log", "scans", "segments", "length, m", "spurious, m", "segments", "length, m", "spurious, m", "s"]
    whole = [(name, log, len(log)) for name, log in logs.items()]
    rows = [_fused(*row) for row in ([("intel", logs["intel"], 60)] if "intel" in logs else []) + whole]
    return markdown(header, rows)


def _fused(name: str, log: LaserLog, count: int) -> list[object]:
    parameters = preset("verified")
    stretch = Stretch(name, log, 0, 1, count)
    maps = stretch.maps(parameters)
    poses = {scan: stretch.truth(ScanId(0, 0), scan) for scan in maps}
    before = SegmentMap.joined(maps[scan].moved(poses[scan]) for scan in maps)
    started = time.process_time()
    after = fuse_all(maps, poses, parameters)
    seconds = time.process_time() - started
    return [name, len(maps), *_clean(before), *_clean(after), f"{seconds:.1f}"]


def _clean(segment_map: SegmentMap) -> list[str]:
    return [str(len(segment_map)), f"{segment_map.lengths.sum():.0f}", f"{spurious_length(segment_map):.1f}"]


# --- all of it ------------------------------------------------------------------------------------


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=Path, default=SHARED / "datasets", help="folder of the logs")
    parser.add_argument("--names", nargs="+", choices=LOGS, default=list(LOGS))
    parser.add_argument("--tables", nargs="+", default=("methods", "online", "robots", "fusion"))
    options = parser.parse_args()
    print(provenance(), end="\n\n", flush=True)
    logs = {name: read_log(options.logs / LOGS[name][0]) for name in options.names}
    stretches = [Stretch(name, log, 0, LOGS[name][1], SCANS) for name, log in logs.items()]
    tables: dict[str, tuple[str, Callable[[], Iterable[str]]]] = {
        "methods": ("The three methods side by side", lambda: methods(stretches)),
        "online": ("Table 4: milliseconds for each new scan", lambda: online(logs)),
        "robots": ("Figs. 16 and 17: four local maps", lambda: robots(logs)),
        "fusion": ("All scans at once", lambda: [fusion(logs)]),
    }
    for name in options.tables:
        title, made = tables[name]
        print(f"### {title}", end="\n\n")
        for table in made():
            print(table, end="\n\n", flush=True)


if __name__ == "__main__":
    main()
