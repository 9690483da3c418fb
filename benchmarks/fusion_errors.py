"""How far fused segments end up from the polyline that replaces them (Section III-C, Fig. 5).

    python benchmarks/fusion_errors.py [--every 1]

Every positive pair of the benchmark is put together under its true pose; each matching chain is fused, by the
greedy and by the plain variant. The distance of a source from its polyline is measured in three ways:
one edge: the larger of its two extremes' distances to the closest edge, what Algorithm 5 itself compares with
fusion_tolerance; extremes: the same, each extreme to its own nearest edge; everywhere: the farthest of all points
of the source, a point every 20 mm, each to its own nearest edge. A source that lies along several edges is far
from each of them, and yet near the polyline. The paper says of the greedy variant: almost always less than
40 mm. Printed: 50, 95, 99 % and the largest, the shares within fusion_tolerance and under 40 mm, and of plain how
many chains finish (every source within the tolerance of one edge) before the bound on insertions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from common import POSITIVE, LogPairs, arguments, load, markdown, percent, provenance

from segmap.benchmark import Pair
from segmap.chains import matching_chains
from segmap.fusion import closest_edges, fuse
from segmap.parameters import Parameters, preset
from segmap.pose import FloatArray, Pose2
from segmap.segments import SegmentMap

PAPER_ERROR = 0.040
"""metres"""
STEP = 0.020
"""metres between the points of a source"""
PRESETS = ("paper-lab", "default")
VARIANTS = ("greedy", "plain")
MEASURES = ("one edge", "extremes", "everywhere")


@dataclass(frozen=True, eq=False)
class Errors:
    """What fusing some pairs gave."""

    distances: FloatArray
    """shape (sources, 3), metres: from each source to its polyline, by the measures above"""
    finished: int
    chains: int

    @classmethod
    def joined(cls, parts: Sequence[Errors]) -> Errors:
        """Those of many pairs together."""
        distances = np.concatenate([np.empty((0, len(MEASURES))), *(part.distances for part in parts)])
        return cls(distances, sum(part.finished for part in parts), sum(part.chains for part in parts))


def distances(sources: FloatArray, vertices: FloatArray) -> FloatArray:
    """Distances of sources (n, 4) from a polyline (k, 2) by the three measures, shape (n, 3), metres."""
    line = shapely.linestrings(vertices)
    shapely.prepare(line)
    points, source = shapely.get_coordinates(
        shapely.segmentize(shapely.linestrings(sources.reshape(-1, 2, 2)), STEP), return_index=True
    )
    everywhere = np.zeros(len(sources))
    np.maximum.at(everywhere, source, shapely.distance(shapely.points(points), line))
    extremes = shapely.distance(shapely.points(sources.reshape(-1, 2, 2)), line).max(axis=1)
    return np.column_stack((closest_edges(sources, vertices)[0], extremes, everywhere))


def pair_errors(map_1: SegmentMap, map_2: SegmentMap, T_1_2: Pose2, parameters: Parameters) -> Errors:
    """The errors of fusing two maps under a pose; only segments of chains count, the others stay as they are."""
    chains = matching_chains(map_1, map_2, T_1_2, parameters)
    fusion = fuse(map_1, map_2, T_1_2, chains, parameters)
    moved_2 = map_2.moved(T_1_2)
    parts = [np.empty((0, len(MEASURES)))]
    for chain, line in zip(chains, fusion.polylines, strict=True):
        sources = np.concatenate((map_1.coordinates[list(chain.first)], moved_2.coordinates[list(chain.second)]))
        parts.append(distances(sources, line.vertices))
    return Errors(np.concatenate(parts), len(chains) - fusion.unfinished, len(chains))


def all_errors(logs: Sequence[LogPairs], parameters: Parameters, every: int = 1) -> Errors:
    """The errors over the positive pairs of some logs, under their true poses."""
    return Errors.joined(
        [pair_errors(*held.maps(pair, parameters), T_1_2, parameters) for held, pair, T_1_2 in _truths(logs, every)]
    )


def _truths(logs: Sequence[LogPairs], every: int) -> Iterator[tuple[LogPairs, Pair, Pose2]]:
    for held in logs:
        for pair in (pair for kind in POSITIVE for pair in held.of_kind(kind, every)):
            if pair.truth is not None:
                yield held, pair, pair.truth


def table(logs: Sequence[LogPairs], every: int = 1) -> str:
    """A row for each preset, variant and measure; distances in mm."""
    rows = []
    for name in PRESETS:
        for variant in VARIANTS:
            parameters = preset(name).replace(fusion_variant=variant)
            errors = all_errors(logs, parameters, every)
            for measure, column in zip(MEASURES, errors.distances.T, strict=True):
                rows.append([f"{name}, {variant}: {measure}", *_row(column, parameters.fusion_tolerance)])
            rows[-1] += [percent(errors.finished / max(1, errors.chains)), f"{errors.chains:,}"]
    width = max(map(len, rows))
    header = ["Preset, variant: measure", "sources", "50 %", "95 %", "99 %", "max", "within tolerance, %"]
    header += ["under 40 mm, %", "chains finished, %", "of chains"]
    return markdown(header, [row + [""] * (width - len(row)) for row in rows])


def _row(column: FloatArray, tolerance: float) -> list[str]:
    if not len(column):
        return ["0", *["-"] * 6]
    spread = 1000.0 * np.percentile(column, (50, 95, 99, 100))
    shares = float(np.mean(column <= tolerance + 1e-9)), float(np.mean(column < PAPER_ERROR))
    return [f"{len(column):,}", *(f"{one:.1f}" for one in spread), *map(percent, shares)]


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--every", type=int, default=1, help="take every so manieth pair")
    options = parser.parse_args()
    print(provenance(), end="\n\n")
    print("### Distance of sources from their polyline, mm", end="\n\n")
    print(table(load(options.logs, options.pairs), options.every))


if __name__ == "__main__":
    main()
