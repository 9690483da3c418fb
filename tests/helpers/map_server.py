"""Reads a map as ROS's map_server does: YAML file, picture beside it, thresholds, mode; row 0 is the lowest."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from ruamel.yaml import YAML

OCCUPIED, FREE, UNKNOWN = 100, 0, -1


@dataclass(frozen=True)
class OccupancyGrid:
    """What map_server would publish."""

    cells: np.ndarray
    """(height, width), 100, 0 or -1; cell (0, 0) is the lower left one"""
    resolution: float
    origin: tuple[float, float, float]

    def at(self, x: float, y: float) -> int:
        """The cell at a place of the map's frame; outside the grid everything is unknown."""
        assert self.origin[2] == 0.0
        column = int(np.floor((x - self.origin[0]) / self.resolution))
        row = int(np.floor((y - self.origin[1]) / self.resolution))
        inside = 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]
        return int(self.cells[row, column]) if inside else UNKNOWN


def load_map(path: Path) -> OccupancyGrid:
    """A map by its YAML file; fails where map_server would, and where it would fall back to a default."""
    said = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    assert set(said) == {"image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"}
    assert said["mode"] == "trinary"
    assert said["negate"] in (0, 1)
    with Image.open(path.parent / said["image"]) as image:
        assert image.format == "PPM"
        assert image.mode == "L"
        grey = np.asarray(image, dtype=np.float64)
    grey = 255.0 - grey if said["negate"] else grey
    occupancy = (255.0 - grey) / 255.0
    cells = np.full(grey.shape, UNKNOWN)
    cells[occupancy > said["occupied_thresh"]] = OCCUPIED
    cells[occupancy < said["free_thresh"]] = FREE
    x, y, yaw = map(float, said["origin"])
    return OccupancyGrid(cells[::-1], float(said["resolution"]), (x, y, yaw))
