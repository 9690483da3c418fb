"""Residuals and their slopes, against differences and against poses composed one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from graphs import COVARIANCE, ring
from hypothesis import given
from hypothesis import strategies as st

from segmap.errors import GraphError
from segmap.graph import Edge
from segmap.graph.arrays import EdgeArrays, System, composed, gaps, inverted, moved, residuals, slopes
from segmap.pose import Pose2
from segmap.scans import ScanId

A, B = ScanId(0, 0), ScanId(0, 1)
STEP = 1e-6
STEPS = (0.1, 0.0), (0.0, 0.1)
NUMBERS = st.floats(-20.0, 20.0)
ANGLES = st.one_of(st.floats(-3.1, 3.1), st.floats(-1e-3, 1e-3), st.just(0.0))
POSES = st.builds(Pose2, NUMBERS, NUMBERS, ANGLES)


def skewed(seed: int) -> np.ndarray:
    """A covariance that couples all three numbers."""
    root = np.random.default_rng(seed).normal(size=(3, 3)) + 2.0 * np.eye(3)
    return 0.01 * root @ root.T


def arrays_of(*edges: Edge) -> EdgeArrays:
    return EdgeArrays.of(edges, {A: 0, B: 1})


def rows(*poses: Pose2) -> np.ndarray:
    return np.array([tuple(pose) for pose in poses])


def numeric(poses: np.ndarray, edges: EdgeArrays, place: int) -> np.ndarray:
    """Slopes of the residual of one edge by central differences, (3, 3)."""
    columns = []
    for k in range(3):
        delta = np.zeros_like(poses)
        delta[place, k] = STEP
        there, back = (residuals(moved(poses, sign * delta), edges)[0] for sign in (1.0, -1.0))
        columns.append((there - back) / (2.0 * STEP))
    return np.stack(columns, axis=-1)


@given(POSES, POSES, POSES)
def test_slopes_are_those_of_the_residual(first, second, measured):
    """The analytic slopes are the numeric ones, at any poses: also at large residuals and at none."""
    edges, poses = arrays_of(Edge(A, B, measured, COVARIANCE)), rows(first, second)
    if abs(residuals(poses, edges)[0, 2]) > 3.0:
        return  # differences reach over the seam at half a turn
    for place, analytic in enumerate(slopes(poses, edges)):
        scale = 1.0 + np.abs(analytic[0]).max()
        assert analytic[0] / scale == pytest.approx(numeric(poses, edges, place) / scale, abs=1e-6)


@given(POSES, POSES, POSES)
def test_gaps_are_those_of_composed_poses(first, second, measured):
    """Metres and radians left over are what composing poses gives; the residual turns by as much."""
    left = measured.inverse() @ (first.inverse() @ second)
    edges, poses = arrays_of(Edge(A, B, measured, COVARIANCE)), rows(first, second)
    assert gaps(poses, edges)[0] == pytest.approx(math.hypot(left.x, left.y), abs=1e-9)
    assert math.cos(residuals(poses, edges)[0, 2]) == pytest.approx(math.cos(left.theta), abs=1e-9)


@given(POSES, POSES, POSES, st.integers(0, 9))
def test_an_edge_and_its_reverse_weigh_the_same(first, second, measured, seed):
    """Who is called first does not matter: the same Mahalanobis distance, at any residual, with any covariance."""
    edge = Edge(A, B, measured, skewed(seed))
    poses = rows(first, second)
    if abs(residuals(poses, arrays_of(edge))[0, 2]) > 3.1:
        return
    there, back = (arrays_of(e).squares(poses)[0] for e in (edge, edge.reversed()))
    assert back == pytest.approx(there, rel=1e-6, abs=1e-9)
    again = edge.reversed().reversed()
    assert again.T_1_2.distance(edge.T_1_2) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert np.array(again.covariance) == pytest.approx(np.array(edge.covariance), abs=1e-9)


def test_the_covariance_is_in_the_axes_of_frame_1():
    """An edge sure along x of frame 1 resists a motion along it, however scan 2 is turned."""
    sure_along_x = np.diag([0.01**2, 1.0, 0.01**2])
    for theta in (0.0, 1.0, math.pi / 2, 3.0):
        edges = arrays_of(Edge(A, B, Pose2(2.0, 1.0, theta), sure_along_x))
        along, across = (edges.squares(rows(Pose2.identity(), Pose2(2.0 + dx, 1.0 + dy, theta)))[0] for dx, dy in STEPS)
        assert (along, across) == pytest.approx((100.0, 0.01))


@given(POSES, POSES)
def test_poses_in_rows_compose_as_single_ones(first, second):
    """Rows of poses compose and invert as Pose2 does."""
    together = Pose2(*composed(rows(first), rows(second))[0])
    assert together.distance(first @ second) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert Pose2(*inverted(rows(first))[0]).distance(first.inverse()) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_normal_equations_are_those_of_dense_slopes():
    """The sparse matrix and the gradient are those that dense slopes give, whatever the order of elimination."""
    truth, edges = ring(12)
    places = {scan: place for place, scan in enumerate(truth)}
    held = EdgeArrays.of(edges, places)
    poses = rows(*truth.values()) + 0.01 * np.random.default_rng(2).normal(size=(len(truth), 3))
    weights = np.linspace(0.1, 1.0, len(edges))
    system = System(held, len(poses))
    entries, gradient = system.equations(poses, weights)
    dense = np.zeros((3 * len(edges), 3 * len(poses)))
    for end, slope in zip((held.first, held.second), slopes(poses, held), strict=True):
        for i, (pose, block) in enumerate(zip(end, held.whitening @ slope, strict=True)):
            dense[3 * i : 3 * i + 3, 3 * pose : 3 * pose + 3] = np.sqrt(weights[i]) * block
    left = (np.sqrt(weights)[:, None] * held.whitened(poses)).ravel()
    expected = np.linalg.lstsq(dense[:, 3:], -left, rcond=None)[0].reshape(-1, 3)
    found = system.by_pose(system.factorised(entries).solve(-gradient))
    assert found[0].tolist() == [0.0, 0.0, 0.0]
    assert found[1:] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"second": A}, "joins scan 0.0 with itself"),
        ({"T_1_2": Pose2(math.nan, 0.0, 0.0)}, "0.0-0.1 is not finite"),
        ({"covariance": np.eye(2)}, r"shape \(2, 2\)"),
        ({"covariance": np.diag([1.0, math.inf, 1.0])}, "not finite"),
        ({"covariance": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])}, "not symmetric"),
        ({"covariance": np.diag([1.0, 0.0, 1.0])}, "not positive definite"),
        ({"covariance": np.diag([1.0, 1.0, -1.0])}, "not positive definite"),
        ({"source": "guessed"}, "'guessed'"),
    ],
)
def test_what_is_no_edge(changes, said):
    """An edge that cannot be one is refused, with its name and the reason."""
    with pytest.raises(GraphError, match=said):
        Edge(**{"first": A, "second": B, "T_1_2": Pose2.identity(), "covariance": COVARIANCE, **changes})
