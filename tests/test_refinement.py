"""Refinement: back to the true pose, as far as walls hold it, and distinct poses only."""

import math

import numpy as np
import plain_sight as plain
import pytest
import simulated
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import DEGREE, alone, exact, off, perturbed, read_backwards

from segmap._kernels import nearest_segments
from segmap._refine_kernels import normal_equations
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.refinement import distinct, information, refined, uncertainty
from segmap.segments import SegmentMap, extract
from segmap.simulate import World
from segmap.visibility import SURFACE_GAP, sighting, thinned

HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)
HALF_TURN, ALL_ROUND = {"beams": 361, "step": DEGREE / 2}, {"beams": 720, "first": -math.pi, "step": DEGREE / 2}
BARE = World.build("bare", [(0.0, 0.0, 6.0, 5.0), (6.0, 1.0, 8.0, 3.0)])
GATES = 0.5, 0.1
MOVE, TURN = 0.3, 0.1
"""metres and radians: what refinement moves at most in one step"""


def both_seen(world, T_1, T_2, **laser):
    return sighting(alone(exact(world, T_1, **laser))), sighting(alone(exact(world, T_2, **laser)))


# --- where it goes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("world", "laser", "within"),
    [
        (BARE, HALF_TURN, 0.001),
        (BARE, ALL_ROUND, 0.001),
        (BARE, {}, 0.002),
        (simulated.room(), {}, 0.005),
        (simulated.room(), ALL_ROUND, 0.002),
    ],
)
def test_refinement_comes_back_to_the_truth(world, laser, within):
    """From up to 0.3 m and 8 degrees away, to a millimetre; coarse beams cut corners and cost a few more."""
    seen_1, seen_2 = both_seen(world, HERE, THERE, **laser)
    T_1_2 = HERE.inverse() @ THERE
    poses = refined(seen_1, seen_2, perturbed(T_1_2, 30, seed=1), 20, *GATES)
    distance, angle = off(poses, T_1_2)
    assert distance < within
    assert angle < within
    assert np.ptp(poses, axis=0).max() < 0.001  # all to the same pose


def test_few_returns_come_nearly_as_near():
    """Forty returns of each map are enough for a few centimetres."""
    seen_1, seen_2 = (thinned(seen, 40) for seen in both_seen(simulated.room(), HERE, THERE))
    T_1_2 = HERE.inverse() @ THERE
    distance, angle = off(refined(seen_1, seen_2, perturbed(T_1_2, 30, seed=2, distance=0.2), 10, *GATES), T_1_2)
    assert distance < 0.04
    assert angle < 0.02


@given(
    st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi), st.integers(1, 8), st.floats(0.02, 2.0)
)
@settings(deadline=None, max_examples=60)
def test_no_step_goes_beyond_its_bounds(x, y, theta, steps, gate):
    """From anywhere, the pose moves at most 0.3 m and 0.1 rad in a step, and stays a pose."""
    seen_1, seen_2 = both_seen(simulated.room(), HERE, THERE)
    start = np.array([[x, y, theta]])
    moved = refined(seen_1, seen_2, start, steps, gate, gate / 4.0) - start
    assert np.hypot(moved[0, 0], moved[0, 1]) <= steps * MOVE + 1e-9
    assert abs(moved[0, 2]) <= steps * TURN + 1e-9
    assert np.array_equal(start, [[x, y, theta]])


def test_a_pose_without_a_surface_nearby_stays():
    """Where no return is within the gate of a surface, nothing moves; no steps move nothing, either."""
    seen_1, seen_2 = both_seen(simulated.room(), HERE, THERE)
    far = np.array([[100.0, -50.0, 1.0]])
    assert np.array_equal(refined(seen_1, seen_2, far, 5, *GATES), far)
    near = perturbed(HERE.inverse() @ THERE, 3, seed=3)
    assert np.array_equal(refined(seen_1, seen_2, near, 0, *GATES), near)
    assert refined(seen_1, seen_2, np.empty((0, 3)), 5, *GATES).shape == (0, 3)


def test_each_pose_is_refined_by_itself():
    """The others make no difference, to the last bit."""
    seen_1, seen_2 = both_seen(simulated.room(), HERE, THERE)
    poses = perturbed(HERE.inverse() @ THERE, 6, seed=4)
    together = refined(seen_1, seen_2, poses, 6, *GATES)
    assert np.array_equal(together, np.concatenate([refined(seen_1, seen_2, p[None], 6, *GATES) for p in poses]))


def test_refinement_is_the_same_the_other_way_round():
    """Maps swapped and poses inverted, or scans read backwards: the same poses come out."""
    scans = [exact(BARE, T, **HALF_TURN) for T in (HERE, THERE)]
    seen = [sighting(alone(scan)) for scan in scans]
    T_1_2 = HERE.inverse() @ THERE
    poses = perturbed(T_1_2, 10, seed=5)
    there = refined(*seen, poses, 20, *GATES)
    inverted = np.array([tuple(Pose2(*p).inverse()) for p in poses])
    back = np.array([tuple(Pose2(*p).inverse()) for p in refined(*seen[::-1], inverted, 20, *GATES)])
    assert back == pytest.approx(there, abs=1e-4)
    backwards = [sighting(alone(read_backwards(scan))) for scan in scans]
    assert refined(*backwards, poses, 20, *GATES) == pytest.approx(there, abs=1e-4)


# --- against the plain reading --------------------------------------------------------------------


@pytest.mark.parametrize("gate", [0.5, 0.15])
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(
    "laser",
    [
        {"beams": 60, "step": 3 * DEGREE},
        {"beams": 90, "step": 4 * DEGREE, "first": 2.0},
        {"beams": 99, "step": DEGREE / 2},
    ],
)
def test_normal_equations_are_those_of_the_plain_reading(laser, backwards, gate):
    """J^T W J and -J^T W r, with derivatives by differences; points as near to two surfaces are left out."""
    scans = [exact(simulated.room(), T, **laser) for T in (HERE, THERE)]
    scans = [read_backwards(scan) if backwards else scan for scan in scans]
    T_1_2 = HERE.inverse() @ THERE @ Pose2(0.06, -0.08, 0.05)
    seen = [sighting(alone(scan)) for scan in scans]
    views = (T_1_2.inverse(), scans[1], seen[0]), (T_1_2, scans[0], seen[1])
    seen = [s._replace(points=s.points[~ties(scan, T @ s.points[:, :2], gate)]) for T, scan, s in views]
    assert min(len(s.points) for s in seen) > 30
    normal, rhs, pose = np.empty((3, 3)), np.empty(3), np.array(tuple(T_1_2))
    normal_equations(*seen, pose, gate, SURFACE_GAP, normal, rhs)
    expected, right = plain.normal_equations(*scans, *(s.points[:, :2] for s in seen), pose, gate)
    assert normal == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    assert rhs == pytest.approx(right, abs=1e-5 * np.abs(right).max())


def ties(scan, points, gate):
    return np.array([plain.surface_line(scan, point, gate)[1] for point in points])


@given(
    st.lists(
        st.tuples(
            st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.one_of(st.floats(-4.0, 4.0), st.sampled_from([3.0, -3.0]))
        ),
        max_size=40,
    ),
    st.integers(1, 30),
    st.integers(0, 99),
)
@settings(deadline=None, max_examples=100)
def test_distinct_poses_are_those_of_a_plain_loop(rows, most, seed):
    """Best first, each farther than the distance or the angle from all kept before, at most so many."""
    poses = np.array(rows).reshape(-1, 3)
    order = np.random.default_rng(seed).permutation(len(poses))

    def near(a, b):
        turn = abs((poses[a, 2] - poses[b, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        return math.dist(poses[a, :2], poses[b, :2]) < 0.3 and turn < 0.5

    kept = []
    for k in order:
        if len(kept) < most and not any(near(k, other) for other in kept):
            kept.append(k)
    assert distinct(poses, order, 0.3, 0.5, most).tolist() == kept


# --- how well a pose is held ----------------------------------------------------------------------


def held(map_1, map_2, T_1_2, parameters=None):
    return uncertainty(map_1, map_2, sighting(map_1), sighting(map_2), T_1_2, parameters or Parameters())


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
@pytest.mark.parametrize("width", [1.6, 4.0])
@pytest.mark.parametrize("heading", [0.0, 0.6, -2.2])
def test_a_corridor_holds_a_pose_across_but_not_along(heading, width, seed):
    """With and without noise: weak along the axis, strong across it, and the axis is named."""
    T_1, T_2 = Pose2(100.0, width / 2.0, heading), Pose2(100.6, width / 2.0 + 0.1, heading - 0.3)
    map_1, map_2, T_1_2 = simulated.pair(simulated.corridor(width), T_1, T_2, seed=seed, reach=12.0)
    found = held(map_1, map_2, T_1_2)
    assert found.weakest > 0.15
    assert found.strongest < 0.03
    turn = (found.weak_heading + heading + math.pi / 2.0) % math.pi - math.pi / 2.0
    assert abs(turn) < math.radians(4.0)
    assert 0.0 <= found.weak_heading < math.pi


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_a_room_holds_a_pose_all_round(seed):
    """Walls in two directions: centimetres whatever the direction, with and without noise."""
    found = held(*simulated.pair(simulated.room(), HERE, THERE, seed=seed))
    assert found.weakest < 0.05
    assert 0.0 < found.strongest <= found.weakest


def test_uncertainty_turns_with_the_first_map():
    """In another frame of map 1 the weak direction is turned, the strengths are the same."""
    T = Pose2(3.0, -1.0, 0.7)
    map_1, map_2, T_1_2 = simulated.pair(simulated.corridor(), Pose2(90.0, 0.9, 0.2), Pose2(90.5, 1.1, 0.1))
    here, there = held(map_1, map_2, T_1_2), held(map_1.moved(T), map_2, T @ T_1_2)
    assert there.weakest == pytest.approx(here.weakest)
    assert there.strongest == pytest.approx(here.strongest)
    turn = there.weak_heading - here.weak_heading - T.theta
    assert math.sin(turn) == pytest.approx(0.0, abs=1e-6)


def test_covariance_is_one():
    """Symmetric, positive, never above the gate squared; weakest and strongest are its axes in x and y."""
    for world, T_1, T_2 in ((simulated.room(), HERE, THERE), (simulated.corridor(), HERE, Pose2(2.4, 0.8, 0.3))):
        map_1, map_2, T_1_2 = simulated.pair(world, T_1, T_2)
        found = held(map_1, map_2, T_1_2)
        covariance = np.array(found.covariance)
        assert covariance == pytest.approx(covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > 0.0
        assert np.linalg.eigvalsh(covariance).max() <= Parameters().refine_gate ** 2 + 1e-9
        axes = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]))
        assert axes == pytest.approx((found.strongest, found.weakest))


def test_poses_are_held_each_by_itself():
    """Many poses at once or one by one, and by the plain reading of nearest segments: the same."""
    map_1, map_2, T_1_2 = simulated.pair(simulated.room(), HERE, THERE, seed=4)
    seen = sighting(map_1), sighting(map_2)
    poses = perturbed(T_1_2, 5, seed=6)
    together = information(map_1, map_2, *seen, poses, Parameters())
    for pose, matrix in zip(poses, together, strict=True):
        alone = information(map_1, map_2, *seen, pose[None], Parameters())[0]
        assert matrix == pytest.approx(alone)
        assert matrix == pytest.approx(plainly_held(map_1, map_2, seen, Pose2(*pose)), rel=1e-6)


def plainly_held(map_1, map_2, seen, T_1_2):
    """The same by looking at every point and every segment, in frame 1."""
    total = np.zeros((3, 3))
    for points, walls in ((T_1_2 @ seen[1].points[:, :2], map_1), (seen[0].points[:, :2], map_2.moved(T_1_2))):
        nearest, distances = nearest_segments(points, walls.coordinates)
        for point, i, distance in zip(points, nearest, distances, strict=True):
            x1, y1, x2, y2 = walls.coordinates[i]
            length = math.dist((x1, y1), (x2, y2))
            along, arm = np.array((x2 - x1, y2 - y1)) / length, point - (T_1_2.x, T_1_2.y)
            weight = max(0.0, 1.0 - (distance / 0.1) ** 2) ** 2
            for direction, share in (((-along[1], along[0]), 1.0), (along, -(min(1.0, 0.03 / length) ** 2))):
                slope = np.array((*direction, direction[1] * arm[0] - direction[0] * arm[1]))
                total += weight * share * np.outer(slope, slope)
    strengths, axes = np.linalg.eigh(total)
    return (axes * np.maximum(strengths, 0.0)) @ axes.T


def test_without_walls_nothing_is_held():
    """No segments, or none near any return: as uncertain as the gate, and no crash."""
    map_1, map_2, T_1_2 = simulated.pair(simulated.room(), HERE, THERE)
    bare = SegmentMap(np.empty((0, 4)), sights=map_1.sights)
    apart = Pose2(50.0, 0.0, 0.0)
    seen = sighting(map_1)
    for one, other, T in ((bare, bare, T_1_2), (map_1, map_2, apart)):
        assert not information(one, other, seen, seen, np.array([tuple(T)]), Parameters()).any()
        assert held(one, other, T).weakest == pytest.approx(Parameters().refine_gate)


def test_short_segments_are_not_sure_of_their_direction():
    """A wall in stubs as short as the split tolerance holds nothing along it, nor makes up for its end."""
    parameters = Parameters(split_tolerance=0.05)
    walls = extract(exact(simulated.corridor(), Pose2(50.0, 1.0, 0.0), reach=8.0), parameters)
    rows = []
    for x1, y1, x2, y2 in walls.coordinates:
        cuts = np.linspace(0.0, 1.0, max(2, round(math.hypot(x2 - x1, y2 - y1) / 0.04)))
        points = np.array([x1, y1]) + cuts[:, None] * np.array([x2 - x1, y2 - y1])
        points += 0.004 * np.array([[1.0, -1.0]]) * (-1.0) ** np.arange(len(points))[:, None]
        rows.append(np.concatenate((points[:-1], points[1:]), axis=1))
    stubs = SegmentMap(np.concatenate(rows), sights=walls.sights)
    assert held(stubs, stubs, Pose2.identity(), parameters).weakest > 0.3
