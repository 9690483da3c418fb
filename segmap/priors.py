"""What is known of a pose beforehand, from odometry or a person: optional, and off unless given.

A prior decides where there is a choice. It admits only candidates near its mean, so that rivals elsewhere do
not make a pose ambiguous; it adds nothing to value or score, which stay what the maps say. Where the maps
speak for a pose that it excludes, that is said, and a person decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from segmap.errors import ParameterError
from segmap.pose import FloatArray, Pose2, wrap

__all__ = ["PosePrior"]

GATE = 16.266
"""squared Mahalanobis distance within which lie 99.9 % of a normal distribution of three variables"""
NARROW = 0.25, 0.15
"""metres and radians: where the prior is no wider, refinement reaches the pose from its mean"""
SLACK = 0.1, 0.05
"""metres and radians: how far candidates may be off before they are refined, as standard deviations"""
LEAST, MOST = 1e-6, 1e9
"""metres or radians: a standard deviation beyond these says nothing, or too much"""

Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class PosePrior:
    """Where ``T_1_2`` is expected, and how surely.

    Raises:
        ParameterError: the covariance is not that of three variables.
    """

    mean: Pose2
    covariance: Matrix
    """of x, y (metres) and theta (radians) of ``T_1_2``: symmetric, positive definite"""

    def __post_init__(self) -> None:
        matrix = np.array(self.covariance, dtype=np.float64)
        if not all(map(math.isfinite, self.mean)):
            raise ParameterError("The mean of a prior must be three finite numbers: x, y in metres and theta.")
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T):
            raise ParameterError("The covariance of a prior must be a symmetric matrix of 3 by 3 finite numbers.")
        variances = np.linalg.eigvalsh(matrix)
        if variances[0] < LEAST**2 or variances[2] > MOST**2:
            raise ParameterError(
                f"The covariance of a prior must be positive: standard deviations from {LEAST:g} to {MOST:g} in"
                " every direction."
            )
        object.__setattr__(self, "covariance", tuple(tuple(map(float, row)) for row in matrix))

    @classmethod
    def with_deviations(cls, mean: Pose2, x: float, y: float, theta: float) -> PosePrior:
        """A prior whose variables are independent, by their standard deviations in metres and radians.

        Raises:
            ParameterError: a deviation is not a positive number.

        >>> PosePrior.with_deviations(Pose2(1.0, 0.0, 0.0), 0.5, 0.5, 0.1).covariance[0]
        (0.25, 0.0, 0.0)
        """
        if not all(math.isfinite(deviation) and deviation > 0.0 for deviation in (x, y, theta)):
            raise ParameterError("The standard deviations of a prior must be positive numbers.")
        return cls(mean, ((x * x, 0.0, 0.0), (0.0, y * y, 0.0), (0.0, 0.0, theta * theta)))

    @property
    def narrow(self) -> bool:
        """Whether refinement reaches the pose from the mean."""
        x, y, theta = np.sqrt(np.diag(self.covariance))
        return bool(max(x, y) <= NARROW[0] and theta <= NARROW[1])

    def distances(self, poses: FloatArray, uncertain: FloatArray | None = None) -> FloatArray:
        """Squared Mahalanobis distance of each ``T_1_2`` of poses (k, 3) from the mean, (k,).

        ``uncertain``: the covariances of the poses themselves, (3, 3) or (k, 3, 3).
        """
        matrix = np.array(self.covariance) + (0.0 if uncertain is None else uncertain)
        off = np.asarray(poses, dtype=np.float64).reshape(-1, 3) - np.array(tuple(self.mean))
        off[:, 2] = wrap(off[:, 2])
        squared: FloatArray = (off * np.linalg.solve(matrix, off[..., None])[..., 0]).sum(axis=1)
        return squared

    def admits(self, poses: FloatArray, uncertain: FloatArray | None = None) -> NDArray[np.bool_]:
        """Whether each pose is where 99.9 % of what the prior expects lies, (k,); see :meth:`distances`."""
        return self.distances(poses, uncertain) <= GATE

    def admits_unrefined(self, poses: FloatArray) -> NDArray[np.bool_]:
        """The same of candidates, which are somewhat off until they are refined."""
        return self.admits(poses, np.diag((SLACK[0] ** 2, SLACK[0] ** 2, SLACK[1] ** 2)))

    def combined(self, T_1_2: Pose2, covariance: FloatArray) -> tuple[Pose2, FloatArray]:
        """The most likely pose, and its covariance (3, 3), where maps alone give a pose with a covariance."""
        firm = np.linalg.inv(covariance)
        together = np.linalg.inv(firm + np.linalg.inv(np.array(self.covariance)))
        off = np.array(tuple(T_1_2)) - np.array(tuple(self.mean))
        off[2] = wrap(float(off[2]))
        x, y, theta = np.array(tuple(self.mean)) + together @ firm @ off
        return Pose2(x, y, theta), together
