"""The pairs of the benchmark, with the segments of their scans."""

from functools import cache
from pathlib import Path

from segmap.benchmark import Pair, PairSet
from segmap.logs import read_log
from segmap.parameters import Parameters
from segmap.scans import LaserLog
from segmap.segments import SegmentMap, extract

NAMES = ("aces", "csail", "fr079", "fr101", "intel")


@cache
def pair_set(benchmarks: Path, datasets: Path, name: str) -> tuple[PairSet, LaserLog]:
    """One log of the benchmark, and its pairs."""
    pairs = PairSet.from_json((benchmarks / "pairs" / f"{name}.json").read_text(), name)
    return pairs, read_log(datasets / pairs.log)


def maps(pair: Pair, log: LaserLog, parameters: Parameters) -> tuple[SegmentMap, SegmentMap]:
    """The segment maps of a pair's two scans."""
    return extract(log[pair.i], parameters), extract(log[pair.j], parameters)


def some(benchmarks: Path, datasets: Path, each: int, kinds=("consecutive", "wide", "negative")):
    """``each`` pairs of every kind of every log: (log, pair)."""
    for name in NAMES:
        pairs, log = pair_set(benchmarks, datasets, name)
        for kind in kinds:
            for pair in [p for p in pairs.pairs if p.kind == kind][:each]:
                yield log, pair
