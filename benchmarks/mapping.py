"""Whole logs mapped from their scans alone: what is placed, how well, how long it takes (tables in Markdown).

    python benchmarks/mapping.py                          all logs of the folder
    python benchmarks/mapping.py --only aces fr101 --out DIR     and a picture of each map beside the log's own

Poses of the logs and odometry are not used; they are what the result is compared with. A relative pose is compared
for every two scans that are within 5 m of each other by the log.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import SHARED, arguments, laid_on, markdown, provenance

from segmap.export import write_map
from segmap.fusion import fuse_all, spurious_length
from segmap.logs import read_log
from segmap.logs.tables import Trajectory, read_relations
from segmap.mapping import WholeMap, fused, map_scans
from segmap.merging import Component
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.relations import against_relations
from segmap.scans import LaserLog, ScanId
from segmap.segments import extract

NEAR = 5.0
"""metres; scans farther apart are not compared"""
FAR_OFF = 1.0
"""metres; a relative pose that is more off is wrong"""
COMPARED = 400
"""scans that are compared with all near them"""


@dataclass(frozen=True, eq=False)
class Mapped:
    """A log, its map, and what it took."""

    name: str
    log: LaserLog
    whole: WholeMap
    parts: tuple[Component, ...]
    seconds: float
    relations: Path | None

    def true(self, scan: ScanId) -> Pose2:
        """The pose the log gives."""
        pose = self.log[scan.scan].logged_pose
        return pose if pose is not None else Pose2.identity()


def run(path: Path, parameters: Parameters, workers: int) -> Mapped:
    """Map a log."""
    log = read_log(path)
    started = time.perf_counter()
    maps = {ScanId(0, i): extract(scan, parameters, 0, i) for i, scan in enumerate(log)}
    whole = map_scans(maps, parameters, workers=workers)
    parts = fused(whole, maps, parameters)
    relations = next(path.parent.glob("*.relations.gz"), None)
    timed = relations if "graph" in path.name else None
    return Mapped(path.name.split(".")[0], log, whole, parts, time.perf_counter() - started, timed)


def errors(mapped: Mapped) -> tuple[np.ndarray, list[ScanId]]:
    """Errors (m, degrees) of relative poses in the largest component, and the scans that are far off from most."""
    scans = list(mapped.parts[0].scans)
    true = [mapped.true(scan) for scan in scans]
    places = np.array([(pose.x, pose.y) for pose in true])
    found, wrong = [], []
    for i in np.random.default_rng(0).choice(len(scans), min(len(scans), COMPARED), replace=False):
        near = [j for j in np.flatnonzero(np.hypot(*(places - places[i]).T) <= NEAR) if j != i]
        own = [_off(mapped.parts[0].poses, scans, true, int(i), int(j)) for j in near]
        found.extend(own)
        if own and np.median([distance for distance, _ in own]) > FAR_OFF:
            wrong.append(scans[i])
    return np.array(found).reshape(-1, 2), wrong


def _off(poses: Mapping[ScanId, Pose2], scans: list[ScanId], true: list[Pose2], i: int, j: int) -> tuple[float, float]:
    measured = poses[scans[i]].inverse() @ poses[scans[j]]
    distance, turn = measured.distance(true[i].inverse() @ true[j])
    return distance, math.degrees(turn)


def row(mapped: Mapped) -> list[str]:
    """One line of the table."""
    whole, (off, wrong) = mapped.whole, errors(mapped)
    doubtful = whole.weakly_held()
    median, most = np.median(off, axis=0), np.percentile(off, 95, axis=0)
    unwarned = [scan for scan in wrong if scan not in doubtful]
    return [
        mapped.name,
        f"{len(whole.scans):,}",
        str(len(whole.keys)),
        f"{len(mapped.parts[0].scans) / len(whole.scans):.1%}",
        str(len(mapped.parts)),
        f"{median[0]:.3f} / {most[0]:.3f}",
        f"{median[1]:.2f} / {most[1]:.2f}",
        f"{len(wrong)} / {len(unwarned)}",
        f"{len(doubtful) / len(whole.scans):.1%}",
        *_against(mapped),
        f"{spurious_length(mapped.parts[0].map):.1f} of {mapped.parts[0].map.lengths.sum():.0f}",
        f"{mapped.seconds / 60.0:.1f}",
    ]


def _against(mapped: Mapped) -> list[str]:
    """Errors against relations people checked, where the log has some."""
    if mapped.relations is None:
        return ["", ""]
    poses = mapped.parts[0].poses
    timed = sorted((mapped.log[s.scan].time or 0.0, s) for s in poses)
    trajectory = Trajectory(
        name=mapped.name, times=np.array([t for t, _ in timed]), poses=tuple(poses[s] for _, s in timed)
    )
    found = against_relations(trajectory, read_relations(mapped.relations))
    return [
        f"{found.translation_mean_m:.3f} ± {found.translation_std_m:.3f} ({found.matched})",
        f"{found.rotation_mean_deg:.2f}",
    ]


def draw(mapped: Mapped, parameters: Parameters, folder: Path) -> None:
    """The largest component, laid on the log's own poses at best, beside the map that these give."""
    maps = {ScanId(0, i): extract(scan, parameters, 0, i) for i, scan in enumerate(mapped.log)}
    own = {scan: mapped.true(scan) for scan in maps}
    logged = Component("the log's own poses", tuple(sorted(own)), own, fuse_all(maps, own, parameters))
    part = mapped.parts[0]
    T = laid_on([part.poses[scan] for scan in part.scans], [own[scan] for scan in part.scans])
    poses = {scan: T @ pose for scan, pose in part.poses.items()}
    ours = Component("from the scans alone", part.scans, poses, part.map.moved(T))
    folder.mkdir(parents=True, exist_ok=True)
    write_map([ours, logged], folder / f"{mapped.name}.png", metadata={"title": mapped.name})


def main() -> None:
    """Print the table."""
    parser = arguments(__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="parts of the names of the logs wanted")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, help="folder for pictures")
    options = parser.parse_args()
    parameters = preset("verified")
    header = (
        "log", "scans", "keyframes", "placed", "components", "off, m: median / 95 %", "off, deg: median / 95 %",
        "over 1 m off / not warned of", "warned of", "relations: mean ± std, m", "deg", "doubles, m", "minutes",
    )  # fmt: skip
    rows = []
    for path in sorted((options.logs or SHARED).glob("*/*.log.gz")):
        if "loop5" not in path.name and (not options.only or any(name in str(path) for name in options.only)):
            mapped = run(path, parameters, options.workers)
            rows.append(row(mapped))
            print(*rows[-1], sep=" | ", flush=True)
            if options.out is not None:
                draw(mapped, parameters, options.out)
    print(f"{provenance()}\n")
    print(markdown(header, rows))


if __name__ == "__main__":
    main()
