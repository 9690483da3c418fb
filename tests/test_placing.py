"""Any pose of two maps: judged as a candidate, laid by segments, settled to the best nearby."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from segmap.errors import MapError
from segmap.evaluation import evaluate, matching_values
from segmap.integration import DEFAULT_PRESET, match_maps
from segmap.parameters import Parameters, preset
from segmap.placing import CLEARLY, REACH, judged_at, laid, settled
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import SegmentMap, extract
from segmap.visibility import look, score, sighting

TRUTH = Pose2(1.2, -0.4, math.radians(18.0))
CLOSE = 0.03, math.radians(1.0)


def scan_of(walls: np.ndarray, pose: Pose2) -> LaserScan:
    """What a laser at a pose measures of walls (n, 4), without noise."""
    headings = np.linspace(-math.pi, math.pi, 360, endpoint=False)
    beams = np.column_stack((np.cos(headings + pose.theta), np.sin(headings + pose.theta)))
    starts, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    cross = beams[:, None, 0] * along[:, 1] - beams[:, None, 1] * along[:, 0]
    gap = starts - (pose.x, pose.y)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (gap[:, 0] * along[:, 1] - gap[:, 1] * along[:, 0]) / cross
        place = (gap[:, 0] * beams[:, None, 1] - gap[:, 1] * beams[:, None, 0]) / cross
    far[~((far > 0.0) & (place >= 0.0) & (place <= 1.0))] = np.inf
    return LaserScan(far.min(axis=1), -math.pi, headings[1] - headings[0], 30.0)


ROOM = np.array(
    [[-4, -3, 5, -3], [5, -3, 5, 2], [5, 2, 2, 2], [2, 2, 2, 4], [2, 4, -4, 4], [-4, 4, -4, -3], [-1, 1, 0.5, 1.8]],
    dtype=float,
)


@pytest.fixture(scope="module")
def maps() -> tuple[SegmentMap, SegmentMap]:
    """The segments of one room, seen from two places."""
    parameters = preset(DEFAULT_PRESET["verified"])
    first, second = (extract(scan_of(ROOM, pose), parameters, 0, i) for i, pose in enumerate((Pose2.identity(), TRUTH)))
    return first, second


def near(pose: Pose2, other: Pose2, limits: tuple[float, float] = CLOSE) -> bool:
    distance, turn = pose.distance(other)
    return distance <= limits[0] and turn <= limits[1]


@pytest.mark.parametrize("mode", ["paper", "verified"])
@given(shift=st.tuples(*[st.floats(-0.25, 0.25)] * 2), turn=st.floats(-6.0, 6.0))
def test_what_is_let_go_near_the_truth_settles_on_it(
    maps: tuple[SegmentMap, SegmentMap], mode: str, shift: tuple[float, float], turn: float
) -> None:
    """Wherever the second map is dropped around its place, it comes to rest there, in both modes."""
    parameters = preset(DEFAULT_PRESET[mode])
    dropped = Pose2(TRUTH.x + shift[0], TRUTH.y + shift[1], TRUTH.theta + math.radians(turn))
    assert near(settled(*maps, dropped, parameters, mode), TRUTH)


@pytest.mark.parametrize("mode", ["paper", "verified"])
@pytest.mark.parametrize("pose", [Pose2(3.0, 2.0, 1.0), Pose2(-0.5, 0.2, 3.0), Pose2(40.0, 0.0, 0.0), TRUTH])
def test_settling_never_goes_far_nor_gets_worse(maps: tuple[SegmentMap, SegmentMap], mode: str, pose: Pose2) -> None:
    """What lies out of reach is another answer, and what is worth less is no improvement; twice says the same."""
    parameters = preset(DEFAULT_PRESET[mode])
    found = settled(*maps, pose, parameters, mode)
    assert near(found, pose, (REACH[0] + 1e-9, REACH[1] + 1e-9))
    before = worth(maps, pose, parameters, mode)
    assert worth(maps, found, parameters, mode) >= before - (CLEARLY * abs(before) if mode == "verified" else 0.0)
    assert settled(*maps, pose, parameters, mode) == found


def worth(maps: tuple[SegmentMap, SegmentMap], pose: Pose2, parameters: Parameters, mode: str) -> float:
    """What settling climbs, computed by another road."""
    poses = np.array([tuple(pose)])
    if mode == "paper":
        return float(np.nan_to_num(evaluate(*maps, poses, parameters), nan=-1.0)[0])
    seen = [sighting(one, parameters.max_range) for one in maps]
    return float(score(look(seen[0], seen[1], poses, parameters), parameters)[0])


def test_maps_without_scans_settle_by_their_segments_alone(maps: tuple[SegmentMap, SegmentMap]) -> None:
    """A map drawn by somebody knows of no beams; the value is enough."""
    bare = [SegmentMap(one.coordinates) for one in maps]
    dropped = Pose2(TRUTH.x + 0.1, TRUTH.y - 0.1, TRUTH.theta + 0.03)
    assert near(settled(bare[0], bare[1], dropped, Parameters(), "verified"), TRUTH)


def test_empty_maps_stay_where_they_are() -> None:
    """There is nothing to settle on."""
    empty = SegmentMap.empty()
    assert settled(empty, empty, TRUTH, Parameters(), "paper") == TRUTH


def same_walls(maps: tuple[SegmentMap, SegmentMap]) -> list[tuple[int, int]]:
    """Pairs of segments of one wall, by the truth, the longest match first."""
    pairs, values = matching_values(*maps, TRUTH, Parameters())
    return [tuple(map(int, pairs[k])) for k in np.argsort(-values)]


def test_two_pairs_of_segments_lay_the_second_map(maps: tuple[SegmentMap, SegmentMap]) -> None:
    """Two walls that meet determine the pose; two parallel ones all but the shift along them."""
    pairs = same_walls(maps)
    walls = maps[0].headings
    first = pairs[0]
    across = next(p for p in pairs if abs(math.sin(walls[p[0]] - walls[first[0]])) > 0.5)
    assert near(laid(*maps, [first, across], Parameters()), TRUTH, (0.02, 0.01))
    beside = next((p for p in pairs[1:] if abs(math.sin(walls[p[0]] - walls[first[0]])) < 0.1), None)
    assert beside is not None
    pose = laid(*maps, [first, beside], Parameters())
    assert pose.distance(TRUTH)[1] < 0.01
    off = np.array([pose.x - TRUTH.x, pose.y - TRUTH.y])
    assert abs(off @ [-math.sin(walls[first[0]]), math.cos(walls[first[0]])]) < 0.02


@pytest.mark.slow
@given(x=st.floats(-20.0, 20.0), y=st.floats(-20.0, 20.0), theta=st.floats(-math.pi, math.pi), flip=st.booleans())
def test_laying_follows_any_motion(x: float, y: float, theta: float, flip: bool) -> None:
    """Whatever the motion, and whichever way the segments are written: a corner lies on itself again."""
    corner = np.array([[0.0, 0.0, 4.0, 0.0], [0.0, 0.0, 0.0, 2.5], [1.0, 3.0, 3.0, 4.0]])
    T_1_2 = Pose2(x, y, theta)
    moved = SegmentMap(corner).moved(T_1_2.inverse()).coordinates
    second = SegmentMap(moved[:, [2, 3, 0, 1]] if flip else moved)
    assert near(laid(SegmentMap(corner), second, [(0, 0), (1, 1)], Parameters()), T_1_2, (1e-6, 1e-9))


def test_pairs_that_are_not_there_are_refused(maps: tuple[SegmentMap, SegmentMap]) -> None:
    """The message says what there is."""
    with pytest.raises(MapError, match="at least one pair"):
        laid(*maps, [], Parameters())
    with pytest.raises(MapError, match=f"have {len(maps[0])} and {len(maps[1])}"):
        laid(*maps, [(0, 99)], Parameters())


@pytest.mark.parametrize("mode", ["paper", "verified"])
def test_a_pose_is_judged_as_the_search_judges_it(maps: tuple[SegmentMap, SegmentMap], mode: str) -> None:
    """At the best candidate: the same value, score, evidence and uncertainty."""
    parameters = preset(DEFAULT_PRESET[mode])
    best = match_maps(*maps, parameters, mode=mode).best
    assert best is not None
    judged = judged_at(*maps, best.T_1_2, parameters, mode, 7)
    assert (judged.value, judged.score, judged.evidence) == (
        pytest.approx(best.value, abs=1e-9),
        best.score if best.score is None else pytest.approx(best.score, abs=1e-9),
        best.evidence,
    )
    assert judged.index == 7
