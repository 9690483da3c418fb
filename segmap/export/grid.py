"""A component as a grid: occupied along its segments, free where its scans looked through, unknown elsewhere.

Free is what lies between two neighbouring beams that both returned, up to the surface they met, and
where a sensor stood; a beam without a return says nothing. Where a return belongs to no segment
something was seen that is not in the map: that cell is unknown, however many beams pass it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from segmap.errors import ExportError
from segmap.export import _raster
from segmap.pose import FloatArray
from segmap.segments import SegmentMap, Sight

__all__ = ["FREE", "OCCUPIED", "UNKNOWN", "Grid", "grid_of"]

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""grey levels, as map_server's own saver writes them"""
SURFACE_GAP = 0.5
"""metres; two neighbouring returns closer than this are taken as one surface"""
BEYOND = 10.0
"""metres around segments and sensors; what beams saw farther out is left off the grid"""
CELLS = 1 << 26
"""more do not fit the programs that open it"""
SENSOR = 0.01
"""metres; half the side of what a sensor takes up at the least"""
CORNERS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
NEAR = 2
"""cells; a return this near to a wall is the wall"""


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of a map; row 0 is the lowest, column 0 the leftmost."""

    cells: NDArray[np.uint8]
    """shape (rows, columns), grey levels"""
    x: float
    """metres, of the lower left corner in the component's frame"""
    y: float
    resolution: float
    """metres, the side of a cell"""


def grid_of(component_map: SegmentMap, resolution: float) -> Grid:
    """The grid of a map, its axes those of the map's frame.

    Raises:
        ExportError: the resolution is not a length, or it takes too many cells.
    """
    if not 1e-4 <= resolution <= 1e4:
        raise ExportError(f"The resolution is {resolution:g} m: choose one between 0.0001 m and 10000 m.")
    fans = [_fan(sight) for sight in _different(component_map.sights)]
    triangles = np.concatenate([fan for fan, _ in fans] or [np.empty((0, 3, 2))])
    returns = np.concatenate([points for _, points in fans] or [np.empty((0, 2))])
    x, y, columns, rows = _frame(component_map, triangles, resolution)
    cells = np.full((rows, columns), UNKNOWN, np.uint8)
    _raster.fill_triangles(cells, (triangles - (x, y)) / resolution, FREE)
    for corner in CORNERS:
        _set(cells, (_sensors(component_map) + np.array(corner) * SENSOR - (x, y)) / resolution, FREE)
    walls = np.zeros((rows, columns), np.uint8)
    _raster.draw_lines(walls, (component_map.coordinates - (x, y, x, y)) / resolution, 1)
    _forget(cells, walls, (returns - (x, y)) / resolution)
    cells[walls > 0] = OCCUPIED
    return Grid(cells, x, y, float(resolution))


def _different(sights: Sequence[Sight]) -> list[Sight]:
    """Each scan at its place once; merging by pivots sees some several times."""
    found = {(id(sight.scan), *np.round([*sight.T_map_sensor], 6)): sight for sight in sights}
    return list(found.values())


def _fan(sight: Sight) -> tuple[FloatArray, FloatArray]:
    """What a scan saw free, as triangles (n, 3, 2), and its returns (m, 2), in the map's frame."""
    scan, T = sight.scan, sight.T_map_sensor
    beams = np.arange(len(scan) if scan.all_round else max(len(scan) - 1, 0))
    pairs = np.stack((beams, (beams + 1) % max(len(scan), 1)), axis=-1)
    pairs = pairs[np.isfinite(scan.ranges[pairs]).all(axis=1)]
    ranges, headings = scan.ranges[pairs], scan.angles[pairs]
    ends = _ends(ranges, headings)
    apart = np.hypot(*(ends[:, 1] - ends[:, 0]).T) > SURFACE_GAP
    ends[apart] = _ends(np.repeat(ranges[apart].min(axis=1, keepdims=True), 2, axis=1), headings[apart])
    sensor = np.zeros((len(ends), 1, 2))
    points, _ = scan.returns()
    return T @ np.concatenate((sensor, ends), axis=1), T @ points


def _ends(ranges: FloatArray, headings: FloatArray) -> FloatArray:
    return np.stack((ranges * np.cos(headings), ranges * np.sin(headings)), axis=-1)


def _frame(component_map: SegmentMap, triangles: FloatArray, resolution: float) -> tuple[float, float, int, int]:
    """x and y of the lower left corner, metres, and the number of columns and rows."""
    known = np.concatenate((component_map.coordinates.reshape(-1, 2), _sensors(component_map)))
    if not len(known):
        return 0.0, 0.0, 1, 1
    seen = np.clip(triangles.reshape(-1, 2), known.min(axis=0) - BEYOND, known.max(axis=0) + BEYOND)
    points = np.concatenate((known, seen))
    low = np.floor(points.min(axis=0) / resolution) - 1
    columns, rows = np.floor(points.max(axis=0) / resolution) + 2 - low
    if columns * rows > CELLS:
        coarser = resolution * float(np.sqrt(columns * rows / CELLS))
        raise ExportError(
            f"At {resolution:g} m a cell the map takes {columns:.0f} x {rows:.0f} cells, more than programs open:"
            f" choose a resolution of {coarser * 1.01:.2g} m or more."
        )
    return float(low[0] * resolution), float(low[1] * resolution), int(columns), int(rows)


def _sensors(component_map: SegmentMap) -> FloatArray:
    """Where the scans were taken, (n, 2), metres."""
    places = [(sight.T_map_sensor.x, sight.T_map_sensor.y) for sight in component_map.sights]
    return np.array(places, np.float64).reshape(-1, 2)


def _forget(cells: NDArray[np.uint8], walls: NDArray[np.uint8], returns: FloatArray) -> None:
    """Cells with returns far from any wall are unknown; returns in cells, (n, 2)."""
    near = ndimage.binary_dilation(walls, np.ones((3, 3)), NEAR)
    lonely = np.zeros(cells.shape, bool)
    _set(lonely, returns, True)
    cells[lonely & ~near] = UNKNOWN


def _set(cells: NDArray[Any], points: FloatArray, value: int) -> None:
    """Set the cells of some points, (n, 2), in cells; those outside are passed over."""
    columns, rows = np.floor(points).astype(np.int64).T
    inside = (columns >= 0) & (rows >= 0) & (columns < cells.shape[1]) & (rows < cells.shape[0])
    cells[rows[inside], columns[inside]] = value
