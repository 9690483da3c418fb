"""Components as maps for ROS: for each one a PGM picture and the YAML file that map_server takes.

The frame's rotation is in the picture: the origin's yaw is 0, which every program understands. The
grey levels, thresholds and mode are written so that no program's defaults matter.
"""

from __future__ import annotations

import json
from pathlib import PurePath

from segmap.export.components import Content, ExportFormat, MapComponent, told_of
from segmap.export.grid import FREE, OCCUPIED, UNKNOWN, Grid, grid_of
from segmap.segments import SegmentMap

__all__ = ["ROS_MAP", "write_ros"]

WHITE = 255
OCCUPIED_ABOVE, FREE_BELOW = 0.65, 0.196
"""of (255 - grey) / 255; unknown, grey 205, lies between them"""


def write_ros(content: Content) -> dict[str, bytes]:
    """``stem.yaml`` and ``stem.pgm``; the second component's are called ``stem-2``, and so on.

    Raises:
        ExportError: the map takes too many cells.
    """
    files: dict[str, bytes] = {}
    for number, component in enumerate(content.components or [None], start=1):
        stem = content.stem if number == 1 else f"{content.stem}-{number}"
        grid = grid_of(component.map if component else SegmentMap.empty(), content.resolution)
        told = [*told_of(content.metadata), *_about(component)]
        files[f"{stem}.yaml"] = _yaml(grid, f"{stem}.pgm", told)
        files[f"{stem}.pgm"] = _pgm(grid, told)
    return files


def _about(component: MapComponent | None) -> list[str]:
    if component is None:
        return ["no segments"]
    scans = [str(scan) for scan in component.scans]
    frame = f"frame: the sensor's of scan {scans[0]}; {len(scans)} scans" if scans else "frame: the map's own"
    return [*told_of({"component": component.name}), frame]


def _yaml(grid: Grid, image: str, told: list[str]) -> bytes:
    lines = [f"# {line}" for line in told]
    lines += [
        f"image: {json.dumps(PurePath(image).name)}",
        "mode: trinary",
        f"resolution: {grid.resolution!r}",
        f"origin: [{grid.x:.6f}, {grid.y:.6f}, 0.0]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED_ABOVE}",
        f"free_thresh: {FREE_BELOW}",
    ]
    return ("\n".join(lines) + "\n").encode("utf-8", "replace")


def _pgm(grid: Grid, told: list[str]) -> bytes:
    rows, columns = grid.cells.shape
    levels = f"occupied {OCCUPIED}, unknown {UNKNOWN}, free {FREE}; {grid.resolution!r} m a pixel"
    comments = "".join(f"# {line}\n" for line in (*told, levels)).encode("ascii", "replace")
    return b"P5\n%b%d %d\n%d\n%b" % (comments, columns, rows, WHITE, grid.cells[::-1].tobytes())


ROS_MAP = ExportFormat(
    name="ros",
    suffix=".yaml",
    media_type="application/yaml",
    title="ROS",
    use="for navigation: PGM and YAML as map_server takes them",
    write=write_ros,
    several=True,
)
