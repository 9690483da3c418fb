"""All scans as one clean map: each wall once, where it is, whatever the errors of the poses."""

import math
from functools import cache

import numpy as np
import pytest
import shapely
import simulated

from segmap.errors import CancelledError, MapError
from segmap.export.components import Content
from segmap.export.geojson import write_geojson
from segmap.fusion import fuse_all, spurious_length
from segmap.fusion.corners import met
from segmap.logs import read_log
from segmap.merging import Component
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import SegmentMap, Source, extract
from segmap.simulate import World, box

P = Parameters()
THIN = 0.12
"""metres between the two faces of the wall between the rooms"""


@cache
def rooms():
    """Two rooms with a thin wall between them and a door in it; in one a step of 25 cm, in the other a cupboard."""
    free = [(0.0, 0.0, 4.0, 5.0), (4.0 + THIN, 0.0, 9.0, 5.0), (3.9, 2.0, 4.3, 3.0), (1.0, 5.0, 2.5, 5.25)]
    return World.build("rooms", free, shapes=[box(7.5, 1.2, 0.9, 0.5)])


def walk(count, seed):
    """Places in both rooms, to look from in any direction."""
    generator = np.random.default_rng(seed)
    x = np.where(np.arange(count) % 2, generator.uniform(0.8, 3.2, count), generator.uniform(5.0, 8.2, count))
    y, heading = generator.uniform(2.0, 4.2, count), generator.uniform(-3.0, 3.0, count)
    return [Pose2(*place) for place in zip(x, y, heading, strict=True)]


@cache
def seen(count=60, seed=1, metres=0.0, degrees=0.0, world=None):
    """Scans of the rooms, and poses with errors of so much (standard deviation)."""
    generator = np.random.default_rng(seed + 100)
    maps, poses = {}, {}
    for index, T in enumerate(walk(count, seed)):
        scan = simulated.noisy(world or rooms(), T, seed + index, reach=12.0)
        maps[ScanId(0, index)] = extract(scan, P, 0, index)
        x, y = generator.normal(0.0, metres or 1e-9, 2)
        poses[ScanId(0, index)] = Pose2(T.x + x, T.y + y, T.theta + generator.normal(0.0, math.radians(degrees) + 1e-9))
    return maps, poses


def lines(coordinates):
    return shapely.multilinestrings(np.asarray(coordinates).reshape(-1, 2, 2))


def coverage(wall, coordinates, apart):
    """Share of a segment that lies within a distance of some others of its direction."""
    way = (wall[2:] - wall[:2]) / np.hypot(*(wall[2:] - wall[:2]))
    ways = coordinates[:, 2:] - coordinates[:, :2]
    alike = ways @ way > 0.9 * np.hypot(*ways.T)
    near = lines(coordinates[alike]).buffer(apart, cap_style="flat") if alike.any() else shapely.Point()
    whole = shapely.linestrings(wall.reshape(2, 2))
    return whole.intersection(near).length / whole.length


@cache
def walls():
    """The walls of the rooms that are seen whole, steps and jambs left out."""
    maps, poses = seen()
    raw = np.concatenate([maps[scan].moved(poses[scan]).coordinates for scan in maps])
    long = [wall for wall in rooms().segments if np.hypot(*(wall[2:] - wall[:2])) >= 0.5]
    return [wall for wall in long if coverage(wall, raw, 0.05) > 0.95]


def length(segments):
    return np.hypot(*(segments[:, 2:] - segments[:, :2]).T).sum()


# --- walls of a known world -----------------------------------------------------------------------


@pytest.mark.parametrize(("metres", "degrees", "apart"), [(0.0, 0.0, 0.03), (0.03, 0.3, 0.05), (0.07, 0.7, 0.12)])
def test_every_wall_is_there_once_where_it_is(metres, degrees, apart):
    """With poses off by 3 or 7 cm each wall of a known world is covered, nothing is anywhere else, nothing double."""
    maps, poses = seen(metres=metres, degrees=degrees)
    whole = fuse_all(maps, poses, P)
    assert len(walls()) >= 10
    for wall in walls():
        assert coverage(wall, whole.coordinates, apart) > 0.9, wall
    near = lines(rooms().segments).buffer(apart + 0.02)
    assert lines(whole.coordinates).difference(near).length < 0.05 * whole.lengths.sum()
    raw = SegmentMap.joined(maps[scan].moved(poses[scan]) for scan in maps)
    assert spurious_length(raw) > 100.0
    assert spurious_length(whole) < 0.3
    assert len(whole) < 30
    assert whole.lengths.sum() == pytest.approx(length(rooms().segments), rel=0.2)


def test_two_faces_of_a_thin_wall_stay_two():
    """The wall between the rooms is seen from either side: two lines in opposite directions, as far apart as it is."""
    whole = fuse_all(*seen(metres=0.02, degrees=0.2), P)
    middle = whole.coordinates[:, :2] / 2.0 + whole.coordinates[:, 2:] / 2.0
    upright = (np.abs(np.cos(whole.headings)) < 0.1) & (whole.lengths > 1.0) & (np.abs(middle[:, 0] - 4.06) < 0.2)
    left, right = upright & (np.sin(whole.headings) > 0.0), upright & (np.sin(whole.headings) < 0.0)
    assert left.any()
    assert right.any()
    assert middle[left, 0].mean() == pytest.approx(4.0, abs=0.03)
    assert middle[right, 0].mean() == pytest.approx(4.0 + THIN, abs=0.03)


def test_a_doorway_stays_open():
    """Nothing is drawn across the door, however many lines end at its jambs."""
    whole = fuse_all(*seen(metres=0.04, degrees=0.4), P)
    across = shapely.LineString([(3.7, 2.5), (4.4, 2.5)]).buffer(0.35, cap_style="flat")
    assert lines(whole.coordinates).intersection(across).length == 0.0


def test_what_most_see_through_is_left_out():
    """A person who stood there in 4 scans of 60 is no wall; without the lines of sight of the others she would be."""
    maps, poses = (dict(part) for part in seen())
    person = rooms().with_shapes([box(2.0, 3.1, 0.4, 0.3, 0.4)])
    for index in (1, 3, 5, 7):
        scan = simulated.noisy(person, walk(60, 1)[index], index, reach=12.0)
        maps[ScanId(0, index)] = extract(scan, P, 0, index)
    here = shapely.Point(2.0, 3.1).buffer(0.35)
    assert lines(fuse_all(maps, poses, P).coordinates).intersection(here).length == 0.0
    blind = {scan: SegmentMap(m.coordinates, m.order, m.directed, m.sources) for scan, m in maps.items()}
    assert lines(fuse_all(blind, poses, P).coordinates).intersection(here).length > 0.5


def test_what_only_one_scan_saw_stays():
    """Where nobody else looked, one scan is enough."""
    maps, poses = seen(count=1)
    whole = fuse_all(maps, poses, P)
    for segment in (maps[ScanId(0, 0)].moved(poses[ScanId(0, 0)])).coordinates:
        assert coverage(segment, whole.coordinates, 0.04) > 0.8
    assert whole.lengths.sum() == pytest.approx(maps[ScanId(0, 0)].lengths.sum(), rel=0.1)


def test_a_curved_wall_is_followed():
    """A round room comes out as short chords within 6 cm of the circle, not as a few long ones."""
    radius, corner = 4.0, 2.0 * math.pi * np.arange(180) / 180
    ring = np.stack((radius * np.cos(corner), radius * np.sin(corner)), axis=-1)
    world = World("round", np.concatenate((ring, np.roll(ring, -1, axis=0)), axis=1))
    maps, poses = {}, {}
    generator = np.random.default_rng(3)
    for index in range(40):
        T = Pose2(*generator.uniform(-1.5, 1.5, 2), generator.uniform(-3.0, 3.0))
        maps[ScanId(0, index)] = extract(simulated.noisy(world, T, index, reach=12.0), P, 0, index)
        poses[ScanId(0, index)] = Pose2(T.x + generator.normal(0.0, 0.02), T.y + generator.normal(0.0, 0.02), T.theta)
    whole = fuse_all(maps, poses, P)
    steps = np.linspace(0.0, 1.0, 11)[:, None, None]
    points = (1.0 - steps) * whole.coordinates[:, :2] + steps * whole.coordinates[:, 2:]
    assert np.abs(np.hypot(points[..., 0], points[..., 1]) - radius).max() < 0.06
    assert whole.lengths.sum() == pytest.approx(2.0 * math.pi * radius, rel=0.05)
    assert spurious_length(whole) < 0.2


# --- what a map says of itself --------------------------------------------------------------------


def test_sources_sights_and_directions():
    """Each segment names the segments it stands for, which lie beside it; each sensor is there once."""
    maps, poses = seen(metres=0.04, degrees=0.4)
    whole = fuse_all(maps, poses, P)
    assert all(whole.sources)
    for edge, sources in zip(whole.coordinates, whole.sources, strict=True):
        assert list(sources) == sorted(set(sources))
        wall = shapely.linestrings(edge.reshape(2, 2))
        for source in sources:
            scan = ScanId(source.log, source.scan)
            segment = maps[scan].moved(poses[scan]).coordinates[source.segment]
            assert shapely.distance(wall, shapely.linestrings(segment.reshape(2, 2))) < 0.35
    named = {source for sources in whole.sources for source in sources}
    assert len(named) > 0.8 * sum(map(len, maps.values()))
    assert [sight.T_map_sensor for sight in whole.sights] == list(poses.values())
    assert whole.directed.all()
    assert write_geojson(Content([Component("whole", tuple(maps), poses, whole)], {}, ()))


def test_what_is_undirected_stays_undirected():
    """Segments that may run either way join those of both directions, and their walls may run either way too."""
    maps, poses = seen(count=30)
    unsure = {
        scan: SegmentMap(m.coordinates, directed=np.zeros(len(m), bool), sources=m.sources, sights=m.sights)
        for scan, m in maps.items()
    }
    whole = fuse_all(unsure, poses, P)
    assert not whole.directed.any()
    assert spurious_length(whole) < 0.3
    mixed = fuse_all({**maps, **dict(list(unsure.items())[:5])}, poses, P)
    assert mixed.directed.mean() > 0.8
    for wall in walls():
        assert coverage(wall, mixed.coordinates, 0.05) > 0.85


# --- laws -----------------------------------------------------------------------------------------


def test_the_same_map_every_time_and_in_every_frame():
    """Run again it is the same to the bit; with all poses moved it is the moved map."""
    maps, poses = seen(metres=0.04, degrees=0.4)
    whole, again = fuse_all(maps, poses, P), fuse_all(maps, poses, P)
    assert np.array_equal(whole.coordinates, again.coordinates)
    assert whole.sources == again.sources
    T = Pose2(30.0, -12.0, 0.0)
    moved = fuse_all(maps, {scan: T @ pose for scan, pose in poses.items()}, P)
    assert lines(whole.moved(T).coordinates).buffer(0.02).intersection(
        lines(moved.coordinates)
    ).length == pytest.approx(moved.lengths.sum(), rel=0.02)


def test_scans_without_a_pose_are_left_out():
    """Only what has a pose is fused; a pose without a map is an error that names the scan."""
    maps, poses = seen(count=30)
    some = dict(list(poses.items())[:10])
    assert {source.scan for sources in fuse_all(maps, some, P).sources for source in sources} <= set(range(10))
    with pytest.raises(MapError, match=r"0\.99"):
        fuse_all(maps, {**poses, ScanId(0, 99): Pose2.identity()}, P)


def test_nothing_and_next_to_nothing():
    """No poses, maps without segments, one segment: empty maps, and that segment."""
    assert len(fuse_all({}, {}, P)) == 0
    scan = ScanId(0, 0)
    assert len(fuse_all({scan: SegmentMap.empty()}, {scan: Pose2.identity()}, P)) == 0
    one = SegmentMap(np.array([[0.0, 0.0, 1.0, 0.0]]), sources=((Source(0, 0, 0),),))
    whole = fuse_all({scan: one}, {scan: Pose2(1.0, 1.0, math.pi / 2)}, P)
    assert whole.coordinates == pytest.approx(np.array([[1.0, 1.0, 1.0, 2.0]]), abs=1e-9)
    assert whole.sources == one.sources
    tiny = SegmentMap(np.array([[0.0, 0.0, 1e-6, 0.0]]))
    assert len(fuse_all({scan: tiny}, {scan: Pose2.identity()}, P)) <= 1


def test_it_can_be_stopped():
    """What the check raises ends it."""

    def stop():
        raise CancelledError("stopped")

    with pytest.raises(CancelledError):
        fuse_all(*seen(count=30), P, check=stop)


def test_the_share_of_witnesses_is_a_parameter():
    """At 0 all that is not seen through stays; at 1 only what every scan found."""
    maps, poses = seen(metres=0.04, degrees=0.4)
    lengths = [
        fuse_all(maps, poses, P.replace(wall_witnesses=share)).lengths.sum() for share in (0.0, P.wall_witnesses, 1.0)
    ]
    assert lengths[0] > lengths[1] > lengths[2]


# --- corners --------------------------------------------------------------------------------------


def test_ends_that_all_but_meet_are_made_to_meet():
    """A corner with a gap, a corner with an overlap, a wall that goes on, a wall that ends at another's side."""
    edges = np.array(
        [
            [0.0, 0.0, 3.9, 0.0],  # ends short of the corner
            [4.0, 0.1, 4.0, 3.1],  # begins short of it, runs past the next
            [4.1, 3.0, 2.0, 3.0],
            [1.9, 3.02, 0.0, 3.02],  # goes on
            [1.0, 0.1, 1.0, 2.0],  # stands on the first
        ]
    )
    done = met(edges, 0.05)
    assert done[0, 2:] == pytest.approx([4.0, 0.0])
    assert done[1] == pytest.approx([4.0, 0.0, 4.0, 3.0])
    assert done[2, :2] == pytest.approx([4.0, 3.0])
    assert done[2, 2:] == pytest.approx([1.95, 3.01]) == done[3, :2]
    assert done[4] == pytest.approx([1.0, 0.0, 1.0, 2.0])
    assert done[0, :2] == pytest.approx([0.0, 0.0])


def test_ends_that_are_not_near_stay():
    """Parallel walls side by side, corners half a metre open, ends that would move by a third of a short wall."""
    edges = np.array(
        [[0.0, 0.0, 2.0, 0.0], [0.0, 0.15, 2.0, 0.15], [2.5, 0.5, 2.5, 3.0], [5.0, 0.0, 5.2, 0.0], [5.3, 0.1, 5.3, 1.0]]
    )
    assert np.array_equal(met(edges, 0.05), edges)
    assert np.array_equal(met(edges[:1], 0.05), edges[:1])


# --- the measure ----------------------------------------------------------------------------------


def test_spurious_length_by_hand():
    """Overlaps count on both sides, once however many doubles there are; faces, gaps and crossings do not."""

    def double(*rows, directed=None):
        return spurious_length(SegmentMap(np.array(rows), directed=directed))

    wall, face = (0.0, 0.0, 4.0, 0.0), (4.0, 0.01, 0.0, 0.01)
    assert double(wall) == 0.0
    assert double(wall, (1.0, 0.04, 3.0, 0.04)) == pytest.approx(4.0)
    assert double(wall, (1.0, 0.06, 3.0, 0.06)) == 0.0
    assert double(wall, (3.5, 0.0, 6.0, 0.0)) == pytest.approx(1.0)
    assert double(wall, (4.0, 0.0, 6.0, 0.0)) == pytest.approx(0.0)
    assert double(wall, (1.0, 0.01, 2.0, 0.01), (1.5, -0.01, 3.0, -0.01)) == pytest.approx(2.0 + 1.0 + 1.5)
    assert double(wall, face) == 0.0
    assert double(wall, face, directed=[True, False]) == pytest.approx(8.0)
    assert double(wall, (2.0, -1.0, 2.0, 1.0)) == 0.0
    tilted = (0.0, 0.0, 4.0 * math.cos(0.08), 4.0 * math.sin(0.08))
    assert double(wall, tilted) == pytest.approx(2 * 0.05 / math.tan(0.08), rel=0.01)
    assert double(wall, (0.0, 0.0, 4.0 * math.cos(0.09), 4.0 * math.sin(0.09))) == 0.0
    assert spurious_length(SegmentMap.empty()) == 0.0


def test_spurious_length_against_points():
    """Of random segments: as many points along them are near another one's inside as the length says."""
    generator = np.random.default_rng(7)
    start = generator.uniform(0.0, 1.0, (60, 2))
    heading = generator.choice([0.0, 0.02, 0.07, math.pi], 60)
    way = generator.uniform(0.2, 1.0, 60)[:, None] * np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    segments = SegmentMap(np.concatenate((start, start + way), axis=1))
    total, steps = 0.0, (np.arange(4000) + 0.5)[:, None] / 4000
    for i in range(60):
        unit = way[i] / segments.lengths[i]
        double = np.zeros(4000, bool)
        for j in range(60):
            if i != j and math.cos(heading[i] - heading[j]) >= math.cos(math.radians(5.0)):
                other = start[j] + steps * way[j] - start[i]
                t, n = other @ unit, other @ (-unit[1], unit[0])
                near = np.abs(n) <= 0.05
                if near.any():
                    places = steps[:, 0] * segments.lengths[i]
                    double |= (places >= t[near].min()) & (places <= t[near].max())
        total += double.mean() * segments.lengths[i]
    assert spurious_length(segments) == pytest.approx(total, rel=2e-3)


# --- real logs ------------------------------------------------------------------------------------


def test_a_real_log_without_doubles(datasets):
    """60 scans of the Intel log at its own poses: a tenth of the length, and nothing left of 390 m of doubles."""
    log = read_log(datasets / "intel" / "intel-corrected.log.gz")
    maps = {ScanId(0, i): extract(log[i], P, 0, i) for i in range(60)}
    poses = {ScanId(0, i): log[i].logged_pose for i in range(60)}
    raw = SegmentMap.joined(maps[scan].moved(poses[scan]) for scan in maps)
    whole = fuse_all(maps, poses, P)
    assert spurious_length(raw) > 350.0
    assert spurious_length(whole) < 1.0
    near = lines(whole.coordinates).buffer(0.1)
    assert lines(raw.coordinates).intersection(near).length > 0.85 * lines(raw.coordinates).length
    assert whole.lengths.sum() < 0.35 * raw.lengths.sum()
