"""Laws of poses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import poses

from segmap.pose import Pose2, wrap


def assert_same(a: Pose2, b: Pose2) -> None:
    assert a.distance(b) == pytest.approx((0.0, 0.0), abs=1e-9)


@given(poses)
def test_identity_changes_nothing(T):
    """The identity is neutral on both sides."""
    assert_same(T @ Pose2.identity(), T)
    assert_same(Pose2.identity() @ T, T)


@given(poses)
def test_inverse_undoes(T):
    """A pose times its inverse moves nothing, from either side."""
    assert_same(T @ T.inverse(), Pose2.identity())
    assert_same(T.inverse() @ T, Pose2.identity())


@given(poses, poses, poses)
def test_composition_is_associative(A, B, C):
    """Brackets do not matter."""
    assert_same((A @ B) @ C, A @ (B @ C))


@given(poses, poses, st.floats(-9, 9), st.floats(-9, 9))
def test_composition_moves_points_in_turn(T_1_2, T_2_3, x, y):
    """Moving by a product is moving by its factors, the right one first."""
    point = np.array([[x, y]])
    assert (T_1_2 @ T_2_3) @ point == pytest.approx(T_1_2 @ (T_2_3 @ point), abs=1e-9)


@given(poses)
def test_points_move_as_the_formula_says(T):
    """p_1 = R(theta) p_2 + (x, y)."""
    rotation = np.array([[math.cos(T.theta), -math.sin(T.theta)], [math.sin(T.theta), math.cos(T.theta)]])
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    assert T @ points == pytest.approx(points @ rotation.T + [T.x, T.y], abs=1e-9)


@given(st.floats(-1e3, 1e3))
def test_wrap_keeps_the_angle_and_the_interval(angle):
    """Wrapped angles lie in [-pi, pi) and differ from the angle by whole turns; arrays as numbers."""
    wrapped = wrap(angle)
    assert -math.pi <= wrapped < math.pi
    turns = (angle - wrapped) / (2 * math.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)
    assert wrap(np.array([angle]))[0] == wrapped


def test_pi_wraps_to_the_closed_end():
    """Half a turn is -pi, also one rounding below -pi."""
    assert wrap(math.pi) == -math.pi
    assert wrap(np.nextafter(-math.pi, -4.0)) == -math.pi
    assert wrap(np.array([np.nextafter(-math.pi, -4.0)]))[0] == -math.pi


@given(poses)
def test_distance_is_zero_only_to_itself(T):
    """A pose is at no distance from itself, and 1 m from itself moved by 1 m."""
    assert T.distance(T) == (0.0, 0.0)
    assert T.distance(Pose2(T.x + 1.0, T.y, T.theta))[0] == pytest.approx(1.0)
