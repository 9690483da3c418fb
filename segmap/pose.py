"""Poses in the plane, and the one frame convention everything else follows.

Metres, radians, counter-clockwise positive, right-handed. ``T_1_2`` is the pose of frame 2 in
frame 1 and takes points of frame 2 into frame 1::

    p_1 = R(theta) p_2 + (x, y)        T_1_3 = T_1_2 @ T_2_3        T_2_1 = T_1_2.inverse()
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

__all__ = ["FloatArray", "IntArray", "Pose2", "wrap"]

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: FloatArray) -> FloatArray: ...
def wrap(angle: float | FloatArray) -> float | FloatArray:
    """Bring an angle, or an array of them, into [-pi, pi).

    >>> wrap(math.pi)
    -3.141592653589793
    """
    wrapped = (angle + math.pi) % (2.0 * math.pi) - math.pi
    if isinstance(wrapped, np.ndarray):
        wrapped[wrapped >= math.pi] = -math.pi  # rounding can land on the open end
        return wrapped
    return -math.pi if wrapped >= math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Pose2:
    """A rigid motion of the plane; ``theta`` is wrapped to [-pi, pi).

    >>> T_1_2 = Pose2(1.0, 0.0, math.pi / 2)
    >>> (T_1_2 @ np.array([[1.0, 0.0]])).round(3).tolist()
    [[1.0, 1.0]]
    """

    x: float
    """metres"""
    y: float
    """metres"""
    theta: float
    """radians, counter-clockwise"""

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            object.__setattr__(self, name, float(getattr(self, name)))
        object.__setattr__(self, "theta", wrap(float(self.theta)))

    @classmethod
    def identity(cls) -> Pose2:
        """The motion that moves nothing."""
        return cls(0.0, 0.0, 0.0)

    @overload
    def __matmul__(self, other: Pose2) -> Pose2: ...
    @overload
    def __matmul__(self, other: NDArray[Any]) -> FloatArray: ...
    def __matmul__(self, other: Pose2 | NDArray[Any]) -> Pose2 | FloatArray:
        """Compose with a pose, or move points of shape (..., 2)."""
        if isinstance(other, Pose2):
            x, y = self._move(other.x, other.y)
            return Pose2(x, y, self.theta + other.theta)
        x, y = self._move(other[..., 0], other[..., 1])
        return np.stack((x, y), axis=-1)

    def _move(self, x: Any, y: Any) -> tuple[Any, Any]:
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        return cosine * x - sine * y + self.x, sine * x + cosine * y + self.y

    def inverse(self) -> Pose2:
        """``T_2_1`` of ``T_1_2``."""
        cosine, sine = math.cos(self.theta), math.sin(self.theta)
        return Pose2(-cosine * self.x - sine * self.y, sine * self.x - cosine * self.y, -self.theta)

    def distance(self, other: Pose2) -> tuple[float, float]:
        """How far apart two poses are: metres between origins, and radians in [0, pi]."""
        return math.hypot(self.x - other.x, self.y - other.y), abs(wrap(self.theta - other.theta))

    def __iter__(self) -> Iterator[float]:
        yield from (self.x, self.y, self.theta)
