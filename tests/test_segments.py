"""Laws of segment maps and of their extraction from scans."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from worlds import maps, poses

from segmap.errors import MapError, ScanError
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import Order, SegmentMap, Source, approximate, clusters, extract

STEP = math.radians(1.0)
anything = st.floats(allow_nan=True, allow_infinity=True)
plausible = st.floats(0.05, 30.0)
readings = npst.arrays(float, st.integers(0, 181), elements=st.one_of(plausible, anything))


def split(points, tolerance):
    """Recursive splitting as III-D describes it: the twin of what the library hands to shapely."""
    start, end = points[0], points[-1]
    along = end - start
    share = np.clip((points - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    apart = np.hypot(*(points - start - share[:, None] * along).T)
    farthest = int(np.argmax(apart))
    if apart[farthest] <= tolerance:
        return [start, end]
    return split(points[: farthest + 1], tolerance)[:-1] + split(points[farthest:], tolerance)


@given(npst.arrays(float, st.integers(0, 181), elements=plausible), st.floats(0.01, 0.2))
@settings(deadline=None)
def test_extraction_is_clustering_then_splitting(ranges, tolerance):
    """Every cluster gives the corners that recursive splitting gives, where no two points are equally far."""
    uneven = ranges + 1e-4 * np.sin(np.arange(len(ranges)) ** 2)
    points, _ = LaserScan(uneven, -math.pi / 2, STEP).returns()
    chunks = clusters(points, 0.2)
    expected = [split(c, tolerance) for c in chunks if len(c) > 1]
    rows = [np.concatenate((a, b)) for corners in expected for a, b in pairwise(corners)]
    assert approximate(chunks, tolerance) == pytest.approx(np.reshape(rows, (-1, 4)), abs=1e-9)


@given(readings)
@example(np.full(3, 1.7e-174))
@settings(deadline=None)
def test_every_clustered_return_is_within_kappa(ranges):
    """No return of a cluster lies farther from the segments than split_tolerance."""
    parameters = Parameters(min_segment_length=0.0)
    scan = LaserScan(ranges, -math.pi / 2, STEP)
    segments = extract(scan, parameters).coordinates
    points, _ = scan.returns()
    for chunk in clusters(points, parameters.cluster_distance):
        if np.ptp(chunk, axis=0).max() > 1e-6:
            assert distance_to(segments, chunk).max() <= parameters.split_tolerance + 1e-9


def distance_to(segments, points):
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    share = np.clip(((points[:, None] - start) * along).sum(2) / (along**2).sum(1), 0.0, 1.0)
    apart = points[:, None] - start - share[..., None] * along
    return np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)


@given(readings)
def test_what_is_no_return_is_no_point(ranges):
    """Zero, negative, infinite and too far readings, and NaN, never become points."""
    points, beams = LaserScan(ranges, 0.0, STEP, max_range=20.0).returns(max_range=8.0)
    expected = (ranges > 0.0) & (ranges <= 8.0)
    assert (beams == np.flatnonzero(expected)).all()
    assert np.hypot(*points.T) == pytest.approx(ranges[beams])


def test_the_sensor_is_on_the_left():
    """Segments run counter-clockwise around the sensor, whichever way the beams turn."""
    ranges = np.full(180, 2.0)
    for scan in (LaserScan(ranges, -math.pi / 2, STEP), LaserScan(ranges, math.pi / 2, -STEP)):
        x1, y1, x2, y2 = extract(scan, Parameters()).coordinates.T
        assert (x1 * y2 - y1 * x2 > 0.0).all()


def test_a_wall_over_the_seam_of_an_all_round_scan_is_one_cluster():
    """A sensor that sees all round has no first beam: no wall is cut there."""
    angles = np.arange(360) * STEP
    ranges = np.where(np.cos(angles) > 0.5, 2.0 / np.cos(angles), 9.0)
    found = extract(LaserScan(ranges, 0.0, STEP), Parameters())
    assert found.order is Order.RING
    wall = found.coordinates[(abs(found.coordinates[:, [0, 2]] - 2.0) < 0.01).all(axis=1)]
    assert len(wall) == 1
    assert found.lengths.max() == pytest.approx(2 * 2.0 * math.tan(math.radians(60)), abs=0.1)


@pytest.mark.parametrize("ranges", [[], [1.0], [np.nan] * 5, [1.0, 9.0, 1.0]])
def test_scans_without_clusters_give_the_empty_map(ranges):
    """No returns, one return, or returns all apart: an empty map, not an error."""
    found = extract(LaserScan(ranges, 0.0, STEP), Parameters())
    assert len(found) == 0
    assert found.bounds is None


def test_sources_name_log_scan_and_segment():
    """Each segment of a scan knows where it came from."""
    found = extract(LaserScan(np.full(180, 2.0), -math.pi / 2, STEP), Parameters(), log=1, index=7)
    assert found.sources == tuple((Source(1, 7, i),) for i in range(len(found)))


@given(maps(), poses)
def test_moving_keeps_lengths_and_moves_back(segment_map, T):
    """A rigid motion keeps every length; its inverse brings the map back."""
    moved = segment_map.moved(T)
    assert moved.lengths == pytest.approx(segment_map.lengths, abs=1e-9)
    assert moved.moved(T.inverse()).coordinates == pytest.approx(segment_map.coordinates, abs=1e-9)


@given(maps(), maps())
def test_joined_maps_keep_everything(map_1, map_2):
    """Joining keeps segments, directions and sources in order."""
    joined = SegmentMap.joined([map_1, map_2])
    assert (joined.coordinates == np.concatenate((map_1.coordinates, map_2.coordinates))).all()
    assert (joined.take(range(len(map_1))).directed == map_1.directed).all()


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([[0, 0, 1]], "rows of x1, y1, x2, y2"),
        ([[0, 0, 1, np.nan]], "Segment 0 has a coordinate"),
        ([[0, 0, 1, 1], [0, 0, 1, -1e308]], "Segment 1 has a coordinate"),
        ([[0, 0, 1, 1], [2, 2, 2, 2]], "Segment 1 has no length"),
    ],
)
def test_impossible_maps_are_refused(rows, told):
    """The error says which segment, and what is wrong with it."""
    with pytest.raises(MapError, match=told):
        SegmentMap(np.array(rows, dtype=float))


@pytest.mark.parametrize(
    ("ranges", "first", "step", "told"),
    [
        ([[1.0]], 0.0, STEP, "one row"),
        (["a"], 0.0, STEP, "one row of numbers"),
        ([1.0, 2.0], math.nan, STEP, "finite"),
        ([1.0, 2.0], 0.0, 0.0, "must not be 0"),
        (np.ones(100_001), 0.0, STEP, "100001 beams"),
    ],
)
def test_impossible_scans_are_refused(ranges, first, step, told):
    """The error says what a scan must be."""
    with pytest.raises(ScanError, match=told):
        LaserScan(ranges, first, step)


def test_a_moved_pose_is_not_shared():
    """Maps are immutable: their arrays cannot be written."""
    held = SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0]]))
    with pytest.raises(ValueError, match="read-only"):
        held.coordinates[0, 0] = 5.0
    assert held.moved(Pose2(1.0, 0.0, 0.0)).bounds == (1.0, 0.0, 2.0, 0.0)
