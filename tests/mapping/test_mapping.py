"""Whole logs: where every scan is, held to the truth of the samples and to poses of real logs."""

import json
import math
from pathlib import Path

import pytest
from found import scans
from simulated import noisy, other_room

from segmap.errors import CancelledError
from segmap.keyframes import chained, keyframes, windows
from segmap.logs import read_log
from segmap.mapping import fused, map_scans
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import extract
from segmap.spreading import Crew

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
PARAMETERS = preset("verified")


def sample(name, *logs):
    """The maps of a sample's logs, and where its scans truly are."""
    truth = json.loads((SAMPLES / f"{name}.truth.json").read_text())
    poses = {s["log"]: s["poses"] for s in truth["sessions"]}
    maps, true = {}, {}
    for number, log in enumerate(logs):
        for index, scan in enumerate(read_log(SAMPLES / log)):
            maps[ScanId(number, index)] = extract(scan, PARAMETERS, number, index)
            true[ScanId(number, index)] = Pose2(*poses[log][index])
    return maps, true


def farthest_off(poses, true):
    """The largest error of a pose relative to the first one, metres and radians."""
    first = next(iter(sorted(poses)))
    errors = [pose.distance(true[first].inverse() @ true[scan]) for scan, pose in poses.items()]
    return max(d for d, _ in errors), max(t for _, t in errors)


def test_keyframes_are_those_tracked_from_and_one_between():
    """The last scan too; where nearly all would be, all are."""
    sequence = scans(*range(40))
    kept = keyframes(sequence, [sequence[0], sequence[10], sequence[12]])
    assert kept == [sequence[i] for i in (0, 5, 10, 12, 25, 39)]
    assert keyframes(sequence[:10], sequence[:10:2]) == sequence[:10]
    assert keyframes([], []) == []


def test_each_keyframe_is_matched_with_the_few_after_it():
    """Three at most, none twice."""
    sequence = scans(0, 5, 9, 14)
    assert sorted(windows(sequence)) == [(a, b) for i, a in enumerate(sequence) for b in sequence[i + 1 :]]
    assert len(list(windows(scans(*range(10))))) == 9 + 8 + 7


def test_a_dense_log_needs_few_keyframes():
    """Fifty scans along a room; every one of them is where it should be."""
    places = [Pose2(1.8, 0.8 + 0.1 * i, 1.2 + 0.01 * i) for i in range(50)]
    maps = {ScanId(0, i): extract(noisy(other_room(), T, i), PARAMETERS, 0, i) for i, T in enumerate(places)}
    chain = chained(Crew(maps, PARAMETERS), sorted(maps))
    assert len(chain.keys) < 20
    assert set(chain.keys) | set(chain.tracked) == set(maps)
    whole = map_scans(maps, PARAMETERS)
    assert whole.components == (tuple(sorted(maps)),)
    off, turned = farthest_off(whole.poses, {scan: places[scan.scan] for scan in maps})
    assert off < 0.08
    assert turned < math.radians(1.5)


@pytest.mark.slow
def test_two_robots_come_out_as_one_map():
    """Their logs in either order, every scan within 0.25 m and 5 degrees of the truth, and one clean map."""
    maps, true = sample("two-robots", "two-robots-b.log", "two-robots-a.log")
    told = []
    whole = map_scans(maps, PARAMETERS, progress=lambda what, done, total: told.append((what, done, total)))
    assert len(whole.components) == 1
    assert set(whole.poses) == set(maps)
    off, turned = farthest_off(whole.poses, true)
    assert off < 0.25
    assert turned < math.radians(5.0)
    assert whole.weakly_held() == {}
    assert {what for what, _, _ in told} >= {"tracking", "matching keyframes", "joining components"}
    assert all(done <= total for _, done, total in told)
    (component,) = fused(whole, maps, PARAMETERS)
    assert 20 < len(component.map) < sum(map(len, maps.values())) / 5


def test_rooms_that_have_nothing_in_common_stay_apart():
    """Nothing is put together that nothing holds together."""
    maps, _ = sample("office", "office.log")
    few = {scan: maps[scan] for scan in sorted(maps)[:8]}
    strange = {
        ScanId(1, i): extract(noisy(other_room(), Pose2(1.8, 0.8 + 0.3 * i, 1.2), i), PARAMETERS, 1, i)
        for i in range(8)
    }
    whole = map_scans({**few, **strange}, PARAMETERS)
    assert sorted(len(part) for part in whole.components) == [8, 8]
    assert {scan.log for scan in whole.components[0]} != {scan.log for scan in whole.components[1]}


def test_mapping_can_be_stopped():
    """At the next look."""
    maps, _ = sample("hall", "hall.log")

    def check():
        raise CancelledError("The work was stopped.")

    with pytest.raises(CancelledError):
        map_scans(maps, PARAMETERS, check=check)


@pytest.mark.slow
def test_mapping_that_was_stopped_goes_on_where_it_was():
    """To the last bit as if it had not been, and no pair is matched twice."""
    maps, _ = sample("office", "office.log")
    few = {scan: maps[scan] for scan in sorted(maps)[:20]}
    every, before, after = {}, {}, {}
    whole = map_scans(few, PARAMETERS, keep=every.update)
    assert every == whole.matches

    def check():
        if len(before) > len(every) / 2:
            raise CancelledError("The work was stopped.")

    with pytest.raises(CancelledError):
        map_scans(few, PARAMETERS, keep=before.update, check=check)
    assert len(every) / 2 < len(before) < len(every)
    again = map_scans(few, PARAMETERS, known=before, keep=after.update)
    assert set(before) | set(after) == set(every)
    assert not set(before) & set(after)
    assert again.poses == whole.poses
    assert again.links == whole.links


def test_an_empty_log_is_an_empty_map():
    """No scan, no component; one scan hangs on nothing."""
    assert map_scans({}, PARAMETERS).components == ()
    alone = {ScanId(0, 0): extract(noisy(other_room(), Pose2(0.9, 1.2, 1.2), 1), PARAMETERS)}
    assert map_scans(alone, PARAMETERS).components == ()


@pytest.mark.slow
def test_a_real_log_hangs_together(datasets):
    """Freiburg 101, every scan without its pose: one component, as its own poses have it."""
    log = read_log(datasets / "fr101" / "freiburg-101-corrected.log.gz")
    count = 90
    maps = {ScanId(0, i): extract(scan, PARAMETERS, 0, i) for i, scan in enumerate(log.scans[:count])}
    whole = map_scans(maps, PARAMETERS, workers=2)
    assert len(whole.components[0]) == count
    true = {ScanId(0, i): scan.logged_pose for i, scan in enumerate(log.scans[:count])}
    off, _ = farthest_off(whole.poses, true)
    assert off < 0.6
