"""Worlds, laser, robots, and the sample logs made with them."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely

from segmap.logs import read_log
from segmap.pose import Pose2
from segmap.simulate import (
    INDEX,
    SAMPLES,
    Laser,
    Noise,
    Sample,
    Session,
    World,
    box,
    cast,
    chair,
    disc,
    odometry,
    outline,
    walk,
    write_samples,
)

FIRST_UNIFORM = [0.87197636583648, 0.5590716210743839, 0.302660786568971, 0.35819783558822926]
COMMITTED = Path(__file__).resolve().parents[1] / "sample_logs"
SHARP = Laser(deviation=0.0, dropouts=0.0, footprint=0.0)


@pytest.fixture(scope="module")
def room() -> World:
    return World.build("room", [(0.0, 0.0, 6.0, 4.0)], [(2.0, 0.0, 2.4, 0.3)], [box(4.0, 2.0, 0.8, 0.4, 0.3)])


@pytest.fixture(scope="module")
def sessions() -> dict[str, Session]:
    return {session.file: session for sample in SAMPLES for session in sample.make()}


# --- worlds ---------------------------------------------------------------------------------------


def test_outline_joins_boxes_and_puts_solid_ones_back() -> None:
    """Two rooms and a door are one free space; a pillar is none of it."""
    rooms = [(0.0, 0.0, 3.0, 3.0), (3.1, 0.0, 6.0, 3.0), (3.0, 1.0, 3.1, 2.0)]
    pillar = (5.0, 0.0, 5.5, 0.5)
    polygon = shapely.union_all([shapely.box(*r) for r in rooms]) - shapely.box(*pillar)
    lines = shapely.linestrings(outline(rooms, [pillar]).reshape(-1, 2, 2))
    assert shapely.union_all(lines).normalize().equals(polygon.boundary)
    assert shapely.length(lines).sum() == pytest.approx(polygon.length)


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_free_space_is_on_the_left_of_every_segment_a_robot_sees(sample: Sample) -> None:
    """The side of each segment that a beam meets is its left one."""
    for session in sample.make():
        for pose in session.poses:
            _, met = cast(session.world.segments, pose, Laser().angles)
            x1, y1, x2, y2 = session.world.segments[met[met >= 0]].T
            assert ((x2 - x1) * (pose.y - y1) - (y2 - y1) * (pose.x - x1) > 0.0).all()


def test_cast_agrees_with_shapely(room: World) -> None:
    """A beam ends at the nearest intersection that shapely finds."""
    walls = shapely.multilinestrings([shapely.linestrings(room.segments.reshape(-1, 2, 2))])[0]
    pose = Pose2(1.3, 1.7, 0.4)
    ranges, met = cast(room.segments, pose, Laser().angles)
    for angle, length, index in zip(Laser().angles, ranges, met, strict=True):
        beam = shapely.linestrings(pose @ np.array([[0.0, 0.0], [30 * np.cos(angle), 30 * np.sin(angle)]]))
        assert shapely.distance(beam.intersection(walls), shapely.Point(pose.x, pose.y)) == pytest.approx(length)
        end = shapely.Point(pose @ np.array([length * np.cos(angle), length * np.sin(angle)]))
        assert shapely.distance(shapely.linestrings(room.segments[index].reshape(2, 2)), end) < 1e-9


def test_beams_that_meet_nothing_are_endless() -> None:
    """No walls, or none ahead: infinite ranges, no segment."""
    ahead = np.zeros(1)
    for walls in (np.empty((0, 4)), np.array([[-1.0, -1.0, -1.0, 1.0]])):
        ranges, met = cast(walls, Pose2.identity(), ahead)
        assert ranges.tolist() == [np.inf]
        assert met.tolist() == [-1]


def test_shapes_are_solid_and_where_they_were_put() -> None:
    """Boxes, discs and chair legs are counter-clockwise polygons about their place."""
    for shape in (box(1.0, 2.0, 0.6, 0.4, 0.7), disc(1.0, 2.0, 0.3), *chair(1.0, 2.0)):
        ring = shapely.Polygon(shape)
        assert shapely.is_ccw(ring.exterior)
        assert ring.distance(shapely.Point(1.0, 2.0)) < 0.35


# --- laser ----------------------------------------------------------------------------------------


def test_a_perfect_laser_only_rounds(room: World) -> None:
    """Without noise a reading is the true range to the nearest centimetre."""
    pose = Pose2(1.3, 1.7, 0.4)
    truth, _ = cast(room.segments, pose, SHARP.angles)
    assert np.abs(SHARP.ranges(room, pose, Noise(1)) - truth).max() <= 0.005 + 1e-9


def test_noise_is_about_a_centimetre(room: World) -> None:
    """Readings of surfaces have the deviation asked for, a little more for the rounding."""
    laser = Laser(dropouts=0.0, footprint=0.0)
    truth, _ = cast(room.segments, Pose2(1.3, 1.7, 0.4), laser.angles)
    noise = Noise(5)
    errors = np.concatenate([laser.ranges(room, Pose2(1.3, 1.7, 0.4), noise) - truth for _ in range(50)])
    assert np.std(errors) == pytest.approx(0.0085, abs=0.0004)
    assert np.mean(errors) == pytest.approx(0.0, abs=0.0005)


def test_some_readings_are_no_returns_and_some_lie_between_two_things(room: World) -> None:
    """Dropouts read 81.83, and a wide beam at an edge reads something that is not there."""
    laser = Laser(deviation=0.0, dropouts=0.02, footprint=np.deg2rad(2.0))
    pose, noise = Pose2(1.0, 1.7, 0.1), Noise(3)
    readings = np.stack([laser.ranges(room, pose, noise) for _ in range(100)])
    assert (readings == 81.83).mean() == pytest.approx(0.02, abs=0.004)
    near, far = (np.stack([cast(room.segments, pose, laser.angles + s)[0] for s in np.deg2rad([-1, 1])]) for _ in "12")
    jump = np.ptp(near, axis=0) > 1.0
    between = (readings > near.min(axis=0) + 0.1) & (readings < far.max(axis=0) - 0.1)
    assert jump.any()
    assert 0.2 < between[:, jump].mean() < 0.45


def test_beyond_its_reach_a_laser_sees_nothing() -> None:
    """A wall farther away than the laser's reach gives no return, and so does no wall."""
    wall = World("wall", np.array([[40.0, 50.0, 40.0, -50.0]]))
    assert np.isnan(Laser().scan(wall, Pose2.identity(), Noise(0)).ranges).all()


def test_random_numbers_never_change() -> None:
    """The first numbers of a seed are written here: samples made years apart must be the same."""
    noise = Noise(2006)
    assert noise.uniform(2, 2).ravel().tolist() == FIRST_UNIFORM
    assert abs(Noise(1).normal(20_000)).max() <= 6.0
    assert np.std(Noise(1).normal(20_000)) == pytest.approx(1.0, abs=0.02)


# --- robots ---------------------------------------------------------------------------------------


def test_a_walk_keeps_its_steps() -> None:
    """No two scans are farther apart than a step and a turn, each a little disturbed; the way is kept to."""
    way = [(0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (2.0, 5.0), (6.0, 5.0)]
    poses = walk(way, Noise(4), step=0.8, turn=0.5)
    apart = [a.distance(b) for a, b in pairwise(poses)]
    assert max(d for d, _ in apart) < 0.8 + 0.3
    assert max(t for _, t in apart) < 0.5 + 0.17
    line = shapely.LineString(way)
    assert max(line.distance(shapely.Point(pose.x, pose.y)) for pose in poses) < 0.2


def test_odometry_starts_at_the_origin_and_drifts() -> None:
    """Over 40 m poor odometry is off by more than a metre, and never by more than a few percent a step."""
    poses = walk([(1.0, 1.0), (41.0, 1.0)], Noise(4))
    believed = odometry(poses, Noise(4))
    assert believed[0] == Pose2.identity()
    away, _ = (poses[0].inverse() @ poses[-1]).distance(believed[-1])
    assert away > 1.0


# --- samples --------------------------------------------------------------------------------------


def test_the_committed_samples_are_what_the_seeds_make(tmp_path: Path) -> None:
    """Byte for byte, and no file more or less."""
    written = write_samples(tmp_path / "new" / "folder")
    assert sorted(path.name for path in written) == sorted(path.name for path in COMMITTED.iterdir())
    for path in written:
        assert path.read_bytes() == (COMMITTED / path.name).read_bytes(), path.name


def test_the_index_names_what_is_there() -> None:
    """Every sample of the index has its logs and its truth, with as many poses as scans."""
    samples = json.loads((COMMITTED / INDEX).read_text())["samples"]
    assert [entry["name"] for entry in samples] == ["office", "laboratory", "hall", "two-robots"]
    for entry in samples:
        truth = json.loads((COMMITTED / entry["truth"]).read_text())
        scans = [(COMMITTED / file).read_text().count("\nFLASER 180 ") for file in entry["files"]]
        assert [len(session["poses"]) for session in truth["sessions"]] == scans
        assert [session["log"] for session in truth["sessions"]] == entry["files"]
        assert sum(scans) == entry["scans"]


def test_samples_have_the_paper_s_displacements(sessions: dict[str, Session]) -> None:
    """30 to 80 scans a session, neighbours up to 1.3 m and 0.67 rad apart, no robot in a wall."""
    for session in sessions.values():
        assert 30 <= len(session.poses) <= 80
        apart = [a.distance(b) for a, b in pairwise(session.poses)]
        assert max(d for d, _ in apart) < 1.3
        assert max(t for _, t in apart) < 0.67
        everywhere = np.arange(0.0, 2 * np.pi, 0.1)
        assert min(cast(session.world.segments, pose, everywhere)[0].min() for pose in session.poses) > 0.25


def test_written_poses_are_no_truth(sessions: dict[str, Session]) -> None:
    """The poses of the logs are off by metres, or all the same."""
    for session in sessions.values():
        errors = [
            (session.poses[0].inverse() @ t).distance(b) for t, b in zip(session.poses, session.believed, strict=True)
        ]
        assert max(d for d, _ in errors) > 1.0


def test_truth_puts_the_returns_on_the_walls(sessions: dict[str, Session]) -> None:
    """Moved by the written truth, at least 95 % of the returns lie within 5 cm of the written walls."""
    for name, session in sessions.items():
        walls = shapely.STRtree(shapely.linestrings(session.world.segments.reshape(-1, 2, 2)))
        points = np.concatenate([_points(r, pose) for r, pose in zip(session.ranges, session.poses, strict=True)])
        _, distance = walls.query_nearest(shapely.points(points), return_distance=True, all_matches=False)
        assert (distance < 0.05).mean() > 0.95, name


def _points(ranges: np.ndarray, pose: Pose2) -> np.ndarray:
    seen = ranges < Laser().no_return
    angles = Laser().angles[seen]
    return pose @ (ranges[seen, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1))


def test_the_reader_reads_what_the_simulator_wrote(sessions: dict[str, Session]) -> None:
    """Ranges, angles and the no-return reading of every scan come back from the committed logs."""
    for name, session in sessions.items():
        log = read_log(COMMITTED / name)
        assert (log.format, log.no_return, log.problems) == ("CARMEN", Laser().no_return, ())
        assert len(log) == len(session.ranges)
        for scan, ranges in zip(log, session.ranges, strict=True):
            np.testing.assert_allclose(scan.ranges, np.where(ranges < Laser().no_return, ranges, np.nan), atol=1e-9)
            np.testing.assert_allclose(scan.angles, Laser().angles, atol=1e-12)
