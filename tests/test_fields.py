"""Fields: about what lines of sight say, by cell; and refinement in them, back to the true pose."""

import math

import numpy as np
import plain_sight as plain
import pytest
import real_pairs
import simulated
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated import DEGREE, alone, exact, off, perturbed, read_backwards, sight_map

from segmap._field_kernels import normal_equations
from segmap._sight_kernels import classify
from segmap._stepping import MOVE_STEP, TURN_STEP
from segmap.fields import CELL, MOST_CELLS, field, look_up, refined
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.simulate import World
from segmap.visibility import SURFACE_GAP, look, score, sighting, thinned

P = Parameters()
HERE, THERE = Pose2(2.0, 2.5, 0.4), Pose2(3.1, 2.2, -0.5)
TRUTH = HERE.inverse() @ THERE
HALF_TURN, ALL_ROUND = {"beams": 361, "step": DEGREE / 2}, {"beams": 720, "first": -math.pi, "step": DEGREE / 2}
BARE = World.build("bare", [(0.0, 0.0, 6.0, 5.0), (6.0, 1.0, 8.0, 3.0)])
GATES = 0.5, 0.1
LASERS = [{}, HALF_TURN, ALL_ROUND, {"reach": 4.0}, {"beams": 60, "step": 3 * DEGREE}]


def seen_in(world, T, **laser):
    return sighting(alone(exact(world, T, **laser)))


def views(world, T_1, T_2, **laser):
    """Fields and returns of two scans, in the order in which they are asked for."""
    seen = [seen_in(world, T, **laser) for T in (T_1, T_2)]
    return *(field(some, P) for some in seen), *(some.points for some in seen)


# --- what is drawn --------------------------------------------------------------------------------


def centres(drawn, dx=0.0, dy=0.0):
    """The middles of all cells, (cells, 3), moved by some cells; of no width."""
    rows, columns = np.indices(drawn.classes.shape)
    x, y, scale = drawn.frame
    across = x + (columns.ravel() + 0.5 + dx) / scale
    return np.column_stack((across, y + (rows.ravel() + 0.5 + dy) / scale, np.zeros(across.size)))


def exact_classes(seen, points):
    options = P.sight_tolerance, SURFACE_GAP, P.shadow_depth
    return classify(points, 1.0, 0.0, 0.0, 0.0, seen.beams, seen.sensors, *options)


def check_against_lines_of_sight(seen):
    """Nearly all cells have the class of their middle; nearly every one whose whole surroundings have one class."""
    drawn = field(seen, P)
    classes, middle = drawn.classes.ravel(), exact_classes(seen, centres(drawn))
    assert (classes == middle).mean() > 0.9
    around = [exact_classes(seen, centres(drawn, dx, dy)) == middle for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    clear = np.all(around, axis=0)
    assert clear.sum() > 200
    assert (classes == middle)[clear].mean() > 0.97


@pytest.mark.parametrize("laser", LASERS, ids=str)
@pytest.mark.parametrize("world", [simulated.room(), BARE], ids=["room", "bare"])
def test_a_field_says_what_lines_of_sight_say(world, laser):
    """Supported, contradicted, shadowed and unseen, cell by cell; clockwise scans are no different."""
    scan = exact(world, HERE, **laser)
    for one in (scan, read_backwards(scan)):
        check_against_lines_of_sight(sighting(alone(one)))


def test_a_field_of_several_scans_says_what_all_of_them_say():
    """Support by one outweighs conflict with another, as everywhere; wherever the sensors stood."""
    sights = [(T, exact(simulated.room(), T)) for T in (HERE, THERE, Pose2(4.5, 3.8, 2.8))]
    check_against_lines_of_sight(sighting(sight_map(*sights)))


def test_fields_of_real_scans(benchmarks, datasets):
    """Two scans of each log."""
    for log, pair in real_pairs.some(benchmarks, datasets, each=2, kinds=("wide",)):
        check_against_lines_of_sight(sighting(alone(log[pair.i])))


def test_beams_without_a_return_are_not_seen_through():
    """Between a return and none, and between none and none, nothing is known."""
    ranges = np.full(90, np.nan)
    ranges[30:60:2] = 3.0
    drawn = field(sighting(alone(LaserScan(ranges, 0.0, DEGREE))), P)
    assert set(np.unique(drawn.classes)) == {0, 3}
    assert not len(drawn.pieces)
    assert (drawn.nearest == -1).all()


def test_the_nearest_piece_is_that_of_a_plain_search():
    """Of every cell, the piece nearest to its middle, if one is within the gate of refinement."""
    scan = exact(simulated.room(), HERE, beams=60, step=3 * DEGREE)
    drawn, pieces = field(sighting(alone(scan)), P), plain.pieces(scan)
    assert len(pieces) == len(drawn.pieces)
    for (a, b, normal, offset), row in zip(pieces, drawn.pieces, strict=True):
        assert row == pytest.approx([*a, *b, *normal, offset])
    for point, place in zip(centres(drawn)[::7, :2], drawn.nearest.ravel()[::7], strict=True):
        distances = [plain.to_piece(point, a, b)[0] for a, b, _, _ in pieces]
        nearest = min(distances)
        if place < 0:
            assert nearest > P.refine_gate - 1e-6
        else:
            assert distances[place] == pytest.approx(nearest, abs=1e-6)
            assert nearest < P.refine_gate + 1e-6


def test_large_maps_have_larger_cells():
    """However far a sensor sees, the grid stays bounded, and holds every return."""
    drawn = field(seen_in(simulated.corridor(), Pose2(100.0, 1.0, 0.7), reach=90.0, **ALL_ROUND), P)
    assert drawn.classes.size <= 1.01 * MOST_CELLS
    near = field(seen_in(simulated.room(), HERE), P)
    assert near.frame[2] == pytest.approx(1.0 / CELL)


# --- looking up -----------------------------------------------------------------------------------


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
@settings(deadline=None, max_examples=60)
def test_looking_up_is_reading_the_cells_of_the_points(x, y, theta):
    """Metres by class, both ways, as plainly read; beyond the grid all is unseen."""
    field_1, field_2, points_1, points_2 = views(simulated.room(), HERE, THERE, beams=30, step=6 * DEGREE)
    totals = look_up(field_1, field_2, points_1, points_2, np.array([[x, y, theta]]))
    expected = np.zeros(4)
    T_1_2 = Pose2(x, y, theta)
    for drawn, points, T in ((field_1, points_2, T_1_2), (field_2, points_1, T_1_2.inverse())):
        for (px, py), width in zip(T @ points[:, :2], points[:, 2], strict=True):
            column, row = (np.array([px, py]) - drawn.frame[:2]) * drawn.frame[2]
            inside = 0 <= row < drawn.classes.shape[0] and 0 <= column < drawn.classes.shape[1]
            expected[drawn.classes[int(row), int(column)] if inside else 3] += width
    assert totals[0] == pytest.approx(expected)


def test_scores_in_fields_rank_as_lines_of_sight_do():
    """Over poses far and near: the same order but for a few, and the same best."""
    field_1, field_2, points_1, points_2 = views(simulated.room(), HERE, THERE)
    poses = np.concatenate((perturbed(TRUTH, 150, 1), perturbed(TRUTH, 150, 2, 3.0, 3.0)))
    looked_up = score(look_up(field_1, field_2, points_1, points_2, poses), P)
    exactly = score(look(*(seen_in(simulated.room(), T) for T in (HERE, THERE)), poses, P), P)
    assert np.corrcoef(looked_up, exactly)[0, 1] > 0.98
    assert np.argmax(exactly) in np.argsort(-looked_up)[:5]


def test_of_several_scans_no_more_is_unseen_than_of_one():
    """As the lines of sight count it, where the maps do not meet."""
    sights = [(T, exact(simulated.room(), T)) for T in (HERE, THERE, Pose2(4.5, 3.8, 2.8))]
    seen = sighting(sight_map(*sights)), seen_in(simulated.room(), HERE)
    far = np.array([[50.0, 0.0, 0.0]])
    totals = look_up(*(field(some, P) for some in seen), *(some.points for some in seen), far)
    assert totals == pytest.approx(look(*seen, far, P))


# --- refinement -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("world", "laser", "within"),
    [
        (BARE, HALF_TURN, 0.002),
        (BARE, ALL_ROUND, 0.002),
        (BARE, {}, 0.003),
        (simulated.room(), {}, 0.008),
        (simulated.room(), ALL_ROUND, 0.004),
    ],
)
def test_refinement_comes_back_to_the_truth(world, laser, within):
    """From up to 0.3 m and 8 degrees away, to a few millimetres; coarse beams cut corners and cost a few more."""
    poses = refined(*views(world, HERE, THERE, **laser), perturbed(TRUTH, 30, seed=1), 20, *GATES)
    distance, angle = off(poses, TRUTH)
    assert distance < within
    assert angle < within
    assert np.ptp(poses, axis=0).max() < 0.002  # all to the same pose


def test_few_returns_come_nearly_as_near():
    """Forty returns of each map are enough for a few centimetres."""
    field_1, field_2, *_ = views(simulated.room(), HERE, THERE)
    few = [thinned(seen_in(simulated.room(), T), 40).points for T in (HERE, THERE)]
    poses = refined(field_1, field_2, *few, perturbed(TRUTH, 30, seed=2, distance=0.2), 10, *GATES)
    distance, angle = off(poses, TRUTH)
    assert distance < 0.04
    assert angle < 0.02


@given(
    st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi), st.integers(1, 8), st.floats(0.02, 2.0)
)
@settings(deadline=None, max_examples=60)
def test_no_step_goes_beyond_its_bounds(x, y, theta, steps, gate):
    """From anywhere, the pose moves at most 0.3 m and 0.1 rad in a step, and stays a pose."""
    start = np.array([[x, y, theta]])
    moved = refined(*views(simulated.room(), HERE, THERE), start, steps, gate, gate / 4.0) - start
    assert np.hypot(moved[0, 0], moved[0, 1]) <= steps * MOVE_STEP + 1e-9
    assert abs(moved[0, 2]) <= steps * TURN_STEP + 1e-9
    assert np.array_equal(start, [[x, y, theta]])


def test_a_pose_without_a_surface_nearby_stays():
    """Where no return is within the gate of a surface, nothing moves; no steps move nothing, either."""
    both = views(simulated.room(), HERE, THERE)
    far = np.array([[100.0, -50.0, 1.0]])
    assert np.array_equal(refined(*both, far, 5, *GATES), far)
    near = perturbed(TRUTH, 3, seed=3)
    assert np.array_equal(refined(*both, near, 0, *GATES), near)
    assert refined(*both, np.empty((0, 3)), 5, *GATES).shape == (0, 3)


def test_each_pose_is_refined_by_itself():
    """The others make no difference, to the last bit."""
    both = views(simulated.room(), HERE, THERE)
    poses = perturbed(TRUTH, 6, seed=4)
    together = refined(*both, poses, 6, *GATES)
    assert np.array_equal(together, np.concatenate([refined(*both, pose[None], 6, *GATES) for pose in poses]))


def test_refinement_is_the_same_the_other_way_round():
    """Maps swapped and poses inverted: the same poses come out; scans read backwards: to the size of the cells."""
    field_1, field_2, points_1, points_2 = views(BARE, HERE, THERE, **HALF_TURN)
    poses = perturbed(TRUTH, 10, seed=5)
    there = refined(field_1, field_2, points_1, points_2, poses, 20, *GATES)
    inverted = np.array([tuple(Pose2(*p).inverse()) for p in poses])
    back = refined(field_2, field_1, points_2, points_1, inverted, 20, *GATES)
    assert np.array([tuple(Pose2(*p).inverse()) for p in back]) == pytest.approx(there, abs=1e-4)
    seen = [sighting(alone(read_backwards(exact(BARE, T, **HALF_TURN)))) for T in (HERE, THERE)]
    backwards = *(field(some, P) for some in seen), *(some.points for some in seen)
    assert refined(*backwards, poses, 20, *GATES) == pytest.approx(there, abs=2e-3)


@pytest.mark.parametrize("gate", [0.5, 0.15])
@pytest.mark.parametrize("laser", [{"beams": 60, "step": 3 * DEGREE}, {"beams": 90, "step": 4 * DEGREE, "first": 2.0}])
def test_normal_equations_are_those_of_the_plain_reading(laser, gate):
    """J^T W J and -J^T W r against the nearest piece of each point's cell, with derivatives by differences."""
    scans = [exact(simulated.room(), T, **laser) for T in (HERE, THERE)]
    field_1, field_2, points_1, points_2 = views(simulated.room(), HERE, THERE, **laser)
    pose = np.array(tuple(TRUTH @ Pose2(0.06, -0.08, 0.05)))
    normal, rhs = np.empty((3, 3)), np.empty(3)
    total = normal_equations(field_1, field_2, points_1, points_2, pose, gate, normal, rhs)
    ways = ((scans[0], field_1, points_2, 1), (scans[1], field_2, points_1, -1))
    expected, right, weights = plain.normal_equations_in_fields(ways, pose, gate)
    assert total == pytest.approx(weights)
    assert total > 20.0
    assert normal == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())
    assert rhs == pytest.approx(right, abs=1e-5 * np.abs(right).max())


def test_a_wider_gate_is_drawn_wider():
    """The gate of refinement is the reach of a field: a parameter, not a constant."""
    seen = seen_in(simulated.room(), HERE)
    narrow, wide = (field(seen, P.replace(refine_gate=gate)) for gate in (0.2, 1.0))
    assert (narrow.nearest >= 0).mean() < 0.5 * (wide.nearest >= 0).mean()
