"""Poses out of edges: what is right must come out, what is wrong must be silenced."""

from __future__ import annotations

import math

import pytest
from graphs import far_apart, ring, with_wrong

from segmap.graph import optimise


def test_what_is_consistent_comes_out_exactly():
    """Edges without noise give the true poses, to the last digits."""
    truth, edges = ring(40, noise=0.0)
    result = optimise(edges)
    assert far_apart(result.poses, truth) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert max(residual.chi for residual in result.residuals) < 1e-6
    assert result.silenced == ()


@pytest.mark.parametrize("trusted", [True, False])
@pytest.mark.parametrize("kind", ["random", "shifted"])
def test_wrong_closures_are_silenced(trusted, kind):
    """With 30 % wrong closures the poses stay within 1 cm of those without any, and exactly the wrong are silenced."""
    _, edges = ring(80, trusted=trusted)
    clean = optimise(edges)
    assert clean.silenced == ()
    mixed = with_wrong(edges, 0.3, kind)
    result = optimise(mixed)
    assert [residual.silenced for residual in result.residuals] == [i >= len(edges) for i in range(len(mixed))]
    distance, angle = far_apart(result.poses, clean.poses)
    assert distance < 0.01
    assert angle < math.radians(0.1)
