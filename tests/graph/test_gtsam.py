"""gtsam is a second road to the same poses, and judges our arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from graphs import far_apart, ring, with_wrong

from segmap.graph import optimise
from segmap.scans import ScanId

gtsam = pytest.importorskip("gtsam", reason="gtsam is not installed: pip install 'segmap[graph]'")


@pytest.mark.parametrize("robust", [True, False])
def test_the_same_poses_as_our_own(robust):
    """On clean graphs both backends give the same poses to 1e-4, and the same error."""
    _, edges = ring(80)
    ours, theirs = (optimise(edges, robust=robust, backend=backend) for backend in ("scipy", "gtsam"))
    assert far_apart(ours.poses, theirs.poses) == pytest.approx((0.0, 0.0), abs=1e-4)
    assert theirs.error == pytest.approx(ours.error, rel=1e-6)
    assert (ours.backend, theirs.backend) == ("scipy", "gtsam")


def test_the_same_edges_are_silenced():
    """Both silence exactly the wrong closures."""
    _, edges = ring(60)
    mixed = with_wrong(edges, 0.3, "random")
    ours, theirs = (optimise(mixed, backend=backend) for backend in ("scipy", "gtsam"))
    flags = [residual.silenced for residual in theirs.residuals]
    assert flags == [residual.silenced for residual in ours.residuals]
    assert flags == [i >= len(edges) for i in range(len(mixed))]
    assert far_apart(ours.poses, theirs.poses) == pytest.approx((0.0, 0.0), abs=1e-4)


def test_the_same_covariances():
    """Our marginal covariances are gtsam's."""
    truth, edges = ring(30)
    result = optimise(edges, robust=False)
    scans = sorted(truth)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(), gtsam.noiseModel.Isotropic.Sigma(3, 1e-7)))
    for edge in edges:
        back = np.array(edge.T_1_2.inverse().theta)
        turn = np.array([[np.cos(back), -np.sin(back), 0], [np.sin(back), np.cos(back), 0], [0, 0, 1.0]])
        noise = gtsam.noiseModel.Gaussian.Covariance(turn @ np.array(edge.covariance) @ turn.T)
        T_1_2 = gtsam.Pose2(*edge.T_1_2)
        graph.add(gtsam.BetweenFactorPose2(edge.first.scan, edge.second.scan, T_1_2, noise))
    for scan in scans:
        values.insert(scan.scan, gtsam.Pose2(*result.poses[scan]))
    marginals = gtsam.Marginals(graph, values)
    for scan in (ScanId(0, 7), ScanId(0, 29)):
        theta = result.poses[scan].theta
        turn = np.array([[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1.0]])
        expected = turn @ marginals.marginalCovariance(scan.scan) @ turn.T
        assert result.covariance(scan) == pytest.approx(expected, rel=1e-4, abs=1e-9)
