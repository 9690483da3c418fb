"""Maps for ROS, read back by map_server's rules."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from map_server import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, load_map

from segmap.errors import ExportError
from segmap.export import Content, export_files, write_files, write_map
from segmap.export._raster import draw_lines, fill_triangles
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan, ScanId
from segmap.segments import SegmentMap, Sight, extract

SOMEWHERE = Pose2(5.0, -2.0, 0.6)


def room_scan(half: float = 3.0, beams: int = 360) -> LaserScan:
    """All round in the middle of a square room."""
    step = 2.0 * math.pi / beams
    angles = -math.pi + step * np.arange(beams)
    return LaserScan(half / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))), -math.pi, step)


def written(folder: Path, *parts, **options) -> OccupancyGrid:
    write_files(Content(parts, **options), folder / "map.yaml")
    return load_map(folder / "map.yaml")


@pytest.fixture(scope="session")
def room(part):
    """A room as one scan saw it, its frame turned and moved."""

    def make(T: Pose2 = SOMEWHERE, scan: LaserScan | None = None):
        made = part("room", (0.0, 0.0, 1.0, 0.0))
        return type(made)("room", (ScanId(0, 0),), extract(scan or room_scan(), Parameters()).moved(T), {})

    return make


def test_free_inside_occupied_along_walls_unknown_elsewhere(room, tmp_path):
    """Every point within the room is free, every wall closed, everything behind a wall unknown."""
    T, part = SOMEWHERE, room()
    grid = written(tmp_path, part)
    assert grid.resolution == 0.05
    inside = T @ np.random.default_rng(1).uniform(-2.9, 2.9, (500, 2))
    assert {grid.at(x, y) for x, y in inside} == {FREE}
    walls = part.map.coordinates.reshape(-1, 2, 2)
    along = np.concatenate([a + (b - a) * np.linspace(0.0, 1.0, 200)[:, None] for a, b in walls])
    assert {grid.at(x, y) for x, y in along} == {OCCUPIED}
    behind = T @ np.array([[3.3, 0.0], [0.0, -3.3], [4.0, 4.0], [-3.4, 1.0]])
    assert {grid.at(x, y) for x, y in behind} == {UNKNOWN}


def test_without_beams_nothing_is_free(corner, tmp_path):
    """Walls alone say nothing of the space between them."""
    grid = written(tmp_path, corner)
    assert set(np.unique(grid.cells)) == {UNKNOWN, OCCUPIED}
    assert grid.at(2.0, 0.0) == OCCUPIED


def test_beams_without_returns_free_nothing(room, tmp_path):
    """Where a beam came back from nowhere, nobody knows how far it went."""
    ranges = np.array(room_scan().ranges)
    ranges[170:190] = np.nan
    grid = written(tmp_path, room(Pose2.identity(), LaserScan(ranges, -math.pi, 2.0 * math.pi / 360)))
    assert grid.at(1.5, 0.0) == UNKNOWN
    assert grid.at(-1.5, 0.0) == FREE


def test_free_stops_at_the_nearer_of_two_surfaces(part, tmp_path):
    """Between a beam that met something near and one that went on, only what lies before the near thing is free."""
    scan = LaserScan(np.array([4.0, 4.0, 1.0, 1.0, 4.0, 4.0]), -0.25, 0.1)
    held = SegmentMap(np.array([[4.0, -1.0, 4.0, 1.0]]), sights=(Sight(Pose2.identity(), scan),))
    made = part("a", (0.0, 0.0, 1.0, 0.0))
    grid = written(tmp_path, type(made)("a", (ScanId(0, 0),), held, {}))
    assert grid.at(3.0 * math.cos(0.2), 3.0 * math.sin(0.2)) == FREE
    assert grid.at(3.0 * math.cos(0.1), 3.0 * math.sin(0.1)) == UNKNOWN
    assert grid.at(0.9 * math.cos(0.1), 0.9 * math.sin(0.1)) == FREE
    assert grid.at(3.0, 0.0) == UNKNOWN


def test_a_return_in_no_segment_leaves_its_cell_unknown(room, tmp_path):
    """A post that one scan saw is not painted over by another that looked past it."""
    ranges = np.array(room_scan().ranges)
    ranges[180] = 1.52
    seen = room(Pose2.identity(), LaserScan(ranges, -math.pi, 2.0 * math.pi / 360))
    past = room(Pose2.identity())
    both = SegmentMap(past.map.coordinates, sights=(*seen.map.sights, *past.map.sights))
    grid = written(tmp_path, type(past)("room", (ScanId(0, 0),), both, {}))
    assert grid.at(1.52, 0.0) == UNKNOWN
    assert grid.at(1.52, 0.2) == FREE


def test_several_components(room, corner, tmp_path):
    """Each component has its own picture and YAML, as each has its own frame."""
    write_map([room(), corner], tmp_path / "floor.yaml")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        *("floor-2.pgm", "floor-2.yaml"),
        *("floor.pgm", "floor.yaml"),
    ]
    assert load_map(tmp_path / "floor-2.yaml").at(2.0, 0.0) == OCCUPIED


def test_provenance_is_in_comments_of_both_files(corner):
    """Names of projects cannot break out of their comment."""
    told = {"title": "a\nimage: /etc/passwd\r\x85\u2028b", "map_hash": "5f3a"}
    files = export_files(Content([corner], told), "ros")
    assert list(files) == ["map.yaml", "map.pgm"]
    for content in files.values():
        lines = content.split(b"\nimage" if content[:1] == b"#" else b"\n255\n")[0].decode().splitlines()
        assert all(line[:1] == "#" for line in lines if not line[:1].isdigit() and line != "P5")
        assert any("5f3a" in line for line in lines)


def test_hostile_names_of_files(corner, tmp_path):
    """A picture is found again whatever its name."""
    write_map([corner], tmp_path / 'a: #"b\u00e4.yaml')
    assert load_map(tmp_path / 'a: #"b\u00e4.yaml').at(2.0, 0.0) == OCCUPIED


def test_asked_for_by_the_picture(corner, tmp_path):
    """Where the picture is named, the YAML file stands beside it."""
    write_map([corner], tmp_path / "floor.pgm", "ros")
    assert load_map(tmp_path / "floor.yaml").at(2.0, 0.0) == OCCUPIED


def test_empty(tmp_path):
    """No components, or one without anything in it, are a valid map of nothing."""
    assert written(tmp_path).cells.tolist() == [[UNKNOWN]]


@pytest.mark.slow
def test_resolution(corner, tmp_path):
    """The resolution is what was asked for; too fine or impossible ones are refused with one that works."""
    assert written(tmp_path, corner, resolution=0.2).resolution == 0.2
    with pytest.raises(ExportError, match=r"choose a resolution of (\S+) m or more") as refused:
        export_files(Content([corner], resolution=0.0002), "ros")
    better = float(str(refused.value).split("resolution of ")[1].split()[0])
    assert export_files(Content([corner], resolution=better), "ros")
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ExportError, match="choose one between"):
            export_files(Content([corner], resolution=wrong), "ros")


def test_far_returns_do_not_blow_up_the_grid(part, tmp_path):
    """A beam through a window, a kilometre long, is cut off near the walls."""
    scan = LaserScan(np.full(20, 900.0), -0.1, 0.01)
    held = SegmentMap(np.array([[0.0, 1.0, 2.0, 1.0]]), sights=(Sight(Pose2.identity(), scan),))
    made = part("a", (0.0, 0.0, 1.0, 0.0))
    assert max(written(tmp_path, type(made)("a", (), held, {})).cells.shape) < 22.0 / 0.05


COORDINATES = st.floats(-3.0, 12.0)
POINTS = st.tuples(COORDINATES, COORDINATES)


@given(st.tuples(POINTS, POINTS, POINTS))
def test_fill_triangles_agrees_with_its_plain_twin(corners):
    """A cell is set exactly where its centre lies inside; within rounding of an edge either is right."""
    cells = np.zeros((9, 8), np.uint8)
    triangle = np.array(corners)
    fill_triangles(cells, triangle[None], 1)
    edges = np.roll(triangle, -1, axis=0) - triangle
    for row, column in np.ndindex(cells.shape):
        away = np.array((column + 0.5, row + 0.5)) - triangle
        sides = edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0]
        if np.abs(sides).min() > 1e-9:
            assert cells[row, column] == ((sides > 0).all() or (sides < 0).all())


@given(POINTS, POINTS)
def test_draw_lines_agrees_with_its_plain_twin(start, end):
    """Every cell that a point of the line lies in is set, and no cell that the line stays out of."""
    cells = np.zeros((9, 8), np.uint8)
    draw_lines(cells, np.array([[*start, *end]]), 1)
    line = np.array(start) + (np.array(end) - np.array(start)) * np.linspace(0.0, 1.0, 500)[:, None]
    for x, y in line:
        column, row = math.floor(x), math.floor(y)
        surely = min(x - column, column + 1 - x, y - row, row + 1 - y) > 1e-9
        if surely and 0 <= row < 9 and 0 <= column < 8:
            assert cells[row, column]
    for row, column in np.argwhere(cells):
        centre = np.array((column + 0.5, row + 0.5))
        direction = np.array(end) - np.array(start)
        share = np.clip(np.dot(centre - start, direction) / max(np.dot(direction, direction), 1e-300), 0.0, 1.0)
        assert np.hypot(*(np.array(start) + share * direction - centre)) <= math.sqrt(0.5) + 1e-9
