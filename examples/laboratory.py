"""From a log to a map somebody can check, step by step: python examples/laboratory.py [LOG] [--out FOLDER]

Cells begin with ``# %%``: editors that know notebooks run them one by one.
"""

# %% What is in the log
import argparse
import math
from pathlib import Path

from segmap import ScanId, extract, fused, integrate, map_hash, map_scans, merge, preset, read_log, write_map

SAMPLE = Path(__file__).resolve().parents[1] / "sample_logs" / "laboratory.log"
parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("log", type=Path, nargs="?", default=SAMPLE)
parser.add_argument("--out", type=Path, default=Path("laboratory-map"), help="folder for what is written")
given = parser.parse_args()

log = read_log(given.log)
print(f"{log.name}: {len(log)} scans ({log.format}), readings from {log.no_return} m on are no returns")
for problem in log.problems:
    print(f"  {problem}")

# %% Segments of two scans
parameters = preset("verified")
first, second = extract(log[0], parameters), extract(log[1], parameters)
print(f"scan 0 has {len(first)} segments, {first.lengths.sum():.1f} m; scan 1 has {len(second)}")

# %% INTEGRATE: how the second lies in the frame of the first, and why
found = integrate(first, second, parameters, mode="verified")
match = found.match
print(f"{match.verdict}, {match.candidates} candidates by the heuristic {match.heuristic}")
if match.T_1_2 is not None:
    print(f"x {match.T_1_2.x:.2f} m, y {match.T_1_2.y:.2f} m, {math.degrees(match.T_1_2.theta):.1f} degrees")
print(*(f"  {reason}" for reason in match.reasons), sep="\n")

# %% The same as the paper has it: any transformation above a value, no evidence asked for
as_paper = integrate(first, second, preset("default"), "all", mode="paper").match
print(f"paper mode: {as_paper.verdict}, value {as_paper.value:.2f} m")

# %% The paper's merging of a sequence
few = {ScanId(0, i): extract(scan, parameters, 0, i) for i, scan in enumerate(log[:8])}
by_pivots = merge(few, parameters, mode="verified", method="pivot")
print(
    f"8 scans, {len(by_pivots.calls)} calls of INTEGRATE, components of {[len(c.scans) for c in by_pivots.components]}"
)

# %% The whole log: keyframes, loop closures, one pose graph, one clean map
scans = {ScanId(0, i): extract(scan, parameters, 0, i) for i, scan in enumerate(log)}
whole = map_scans(scans, parameters, workers=1)
parts = fused(whole, scans, parameters)
for part in parts:
    print(f"{part.name}: {len(part.scans)} scans, {len(part.map)} segments, {part.map.lengths.sum():.1f} m")
print(f"map {map_hash(parts)[:12]}, {len(whole.links)} links, {len(whole.optimised.silenced)} of them silenced")

# %% Files other programs open
given.out.mkdir(parents=True, exist_ok=True)
for name in ("map.svg", "map.dxf", "map.geojson", "map.yaml", "map.csv"):
    write_map(parts, given.out / name, metadata={"title": log.name, "map_hash": map_hash(parts)})
print(f"written to {given.out}: {', '.join(sorted(path.name for path in given.out.iterdir()))}")
