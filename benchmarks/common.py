"""What the benchmarks share: the real logs and their pairs, Markdown tables, and where numbers come from."""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from segmap.benchmark import NEGATIVE, Pair, PairSet
from segmap.logs import read_log
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserLog
from segmap.segments import Order, SegmentMap, extract

SHARED = Path(__file__).resolve().parents[2] / "shared"
POSITIVE = ("consecutive", "wide")
PACKAGES = ("segmap", "numpy", "numba", "scipy", "shapely")


@dataclass(frozen=True)
class LogPairs:
    """One real log and its pairs of scans with known truth."""

    name: str
    log: LaserLog
    pairs: tuple[Pair, ...]

    def pair_set(self, every: int = 1) -> PairSet:
        """Every ``every``-th pair, of all kinds."""
        return PairSet(log=self.name, pairs=self.pairs[::every])

    def of_kind(self, kind: str, every: int = 1) -> tuple[Pair, ...]:
        """The pairs of one kind in file order, or every ``every``-th of them, the first included."""
        return tuple(pair for pair in self.pairs if pair.kind == kind)[::every]

    def maps(self, pair: Pair, parameters: Parameters) -> tuple[SegmentMap, SegmentMap]:
        """The segments of a pair's two scans, from their ranges alone."""
        return extract(self.log.scan(pair.i), parameters), extract(self.log.scan(pair.j), parameters)


def arguments(about: str | None, pairs: str = "--pairs") -> argparse.ArgumentParser:
    """A parser with the folders of the logs and of their pairs; ``pairs`` is the latter's option."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=Path, default=SHARED / "datasets", help="folder of the logs")
    parser.add_argument(pairs, type=Path, default=SHARED / "benchmarks" / "pairs", help="folder of the pair sets")
    return parser


def load(logs: Path, pairs: Path) -> list[LogPairs]:
    """Every pair set of a folder with its log, by name."""
    sets = [(path.stem, PairSet.from_json(path.read_bytes(), path.name)) for path in sorted(pairs.glob("*.json"))]
    if not sets:
        raise SystemExit(f"There are no pair sets (*.json) in {pairs}: give their folder with --pairs.")
    return [LogPairs(name, read_log(logs / pair_set.log), pair_set.pairs) for name, pair_set in sets]


def laid_on(found: Sequence[Pose2], true: Sequence[Pose2]) -> Pose2:
    """The motion that lays poses on those they should be at, at best: the least squares of their distances."""
    a, b = (np.array([(pose.x, pose.y) for pose in poses]) for poses in (found, true))
    centre_a, centre_b = a.mean(axis=0), b.mean(axis=0)
    u, v = (a - centre_a) @ (1, 1j), (b - centre_b) @ (1, 1j)
    turn = float(np.angle(np.vdot(u, v)))
    x, y = centre_b - Pose2(0.0, 0.0, turn) @ centre_a
    return Pose2(float(x), float(y), turn)


def trimmed(logs: Sequence[LogPairs], sizes: tuple[int, int], parameters: Parameters) -> tuple[SegmentMap, SegmentMap]:
    """Two overlapping real scans with exactly so many segments: the smallest pair that has them, the longest kept.

    Raises:
        LookupError: no pair has that many.
    """
    enough = []
    for held in logs:
        for pair in held.pairs:
            maps = held.maps(pair, parameters)
            if pair.kind != NEGATIVE and len(maps[0]) >= sizes[0] and len(maps[1]) >= sizes[1]:
                enough.append(maps)
    if not enough:
        raise LookupError(f"No pair of scans has {sizes[0]} and {sizes[1]} segments.")
    first, second = min(enough, key=lambda maps: len(maps[0]) + len(maps[1]))
    return _longest(first, sizes[0]), _longest(second, sizes[1])


def _longest(scan: SegmentMap, count: int) -> SegmentMap:
    """A scan's longest segments, still in beam order."""
    rows = sorted((-scan.lengths).argsort(kind="stable")[:count])
    return SegmentMap(scan.coordinates[rows], Order.BEAMS)


def markdown(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; the first column is text, the others are numbers."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def percent(share: float) -> str:
    """A share in 0..1, in percent.

    >>> percent(0.8333)
    '83.3'
    """
    return f"{100.0 * share:.1f}"


def provenance() -> str:
    """When and on what numbers were made: date, cores, load, versions."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    today = datetime.now(UTC).date().isoformat()
    return f"{today}, {os.cpu_count()} cores, load {load:.1f}; Python {platform.python_version()}, {versions}"
