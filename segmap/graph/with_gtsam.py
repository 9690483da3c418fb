"""The same least squares by gtsam, and its graduated non-convexity: the optional backend.

gtsam's residual of a relative pose is ours, to the last digit, so both find the same poses.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from segmap.errors import GraphError
from segmap.graph.arrays import EdgeArrays
from segmap.pose import FloatArray, IntArray

__all__ = ["Gtsam"]

HOLD = 1e-6
"""metres, radians; standard deviation of the pose that stays where it is"""
TOLERANCE = 1e-14
"""relative and absolute change of the error at which gtsam ends"""


class Gtsam:
    """gtsam's solvers on one graph, with the signatures of our own."""

    def __init__(self, edges: EdgeArrays, check: Callable[[], None] | None = None) -> None:
        try:
            import gtsam
        except ImportError as error:
            raise GraphError(f"gtsam cannot be used ({error}): pip install 'segmap[graph]', or take scipy.") from None
        self._gtsam: Any = gtsam
        self._edges = edges
        self._check = check or (lambda: None)

    def minimised(self, poses: FloatArray, weights: FloatArray, steps: int = 50) -> FloatArray:
        """Poses (n, 3) at the minimum of the weighted sum of squares; pose 0 stays."""
        self._check()
        parameters = self._parameters(max(steps, 1))
        graph, values = self._graph(poses, weights), self._values(poses)
        return self._poses(self._gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize(), len(poses))

    def graduated(self, poses: FloatArray, free: IntArray, gate: float) -> FloatArray:
        """Poses (n, 3) after gtsam's rounds; ``free`` are the edges that can be silenced."""
        self._check()
        parameters = self._gtsam.GncLMParams(self._parameters(100))
        held = np.setdiff1d(np.arange(len(self._edges)), free)
        parameters.setKnownInliers([*map(int, held), len(self._edges)])  # the last one holds pose 0
        graph = self._graph(poses, np.ones(len(self._edges)))
        optimiser = self._gtsam.GncLMOptimizer(graph, self._values(poses), parameters)
        optimiser.setInlierCostThresholds(gate**2 / 2.0)
        return self._poses(optimiser.optimize(), len(poses))

    def _parameters(self, steps: int) -> Any:
        parameters = self._gtsam.LevenbergMarquardtParams()
        parameters.setMaxIterations(steps)
        parameters.setRelativeErrorTol(TOLERANCE)
        parameters.setAbsoluteErrorTol(TOLERANCE)
        return parameters

    def _graph(self, poses: FloatArray, weights: FloatArray) -> Any:
        gtsam, edges = self._gtsam, self._edges
        graph = gtsam.NonlinearFactorGraph()
        for i in np.flatnonzero(weights > 0.0):
            noise = gtsam.noiseModel.Gaussian.SqrtInformation(edges.whitening[i] * np.sqrt(weights[i]))
            T_1_2 = gtsam.Pose2(*edges.measured[i])
            graph.add(gtsam.BetweenFactorPose2(int(edges.first[i]), int(edges.second[i]), T_1_2, noise))
        graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*poses[0]), gtsam.noiseModel.Isotropic.Sigma(3, HOLD)))
        return graph

    def _values(self, poses: FloatArray) -> Any:
        values = self._gtsam.Values()
        for place, pose in enumerate(poses):
            values.insert(place, self._gtsam.Pose2(*pose))
        return values

    @staticmethod
    def _poses(values: Any, count: int) -> FloatArray:
        found = [values.atPose2(place) for place in range(count)]
        return np.array([(pose.x(), pose.y(), pose.theta()) for pose in found])
