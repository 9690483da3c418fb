"""A planar laser as lasers are: noisy, quantised, undecided at edges, sometimes blind."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from segmap.pose import FloatArray, Pose2
from segmap.scans import LaserScan
from segmap.simulate.world import World, cast

__all__ = ["Laser", "Noise"]


class Noise:
    """Random numbers that are the same on every machine and with every version of numpy.

    Only the raw stream of PCG64 is promised to stay, so everything is made from it without the
    mathematics library.
    """

    def __init__(self, seed: int) -> None:
        self._bits = np.random.PCG64(seed)

    def uniform(self, *shape: int) -> FloatArray:
        """Numbers in [0, 1)."""
        raw = np.asarray(self._bits.random_raw(math.prod(shape)))
        return (raw >> np.uint64(11)).astype(np.float64).reshape(shape) * 2.0**-53

    def normal(self, *shape: int) -> FloatArray:
        """Numbers of mean 0 and deviation 1, never farther than 6 from 0 (sums of twelve uniform ones)."""
        return np.asarray(self.uniform(*shape, 12).sum(axis=-1) - 6.0, dtype=np.float64)

    def between(self, low: float, high: float) -> float:
        """One number in [low, high)."""
        return low + (high - low) * float(self.uniform(1)[0])


@dataclass(frozen=True)
class Laser:
    """A forward-looking laser of 180 degrees, one beam each degree, of the SICK LMS 200 kind."""

    beams: int = 180
    first_angle: float = -np.pi / 2
    """radians, heading of beam 0"""
    angle_step: float = np.pi / 180
    """radians"""
    deviation: float = 0.008
    """metres, of a range"""
    resolution: float = 0.01
    """metres"""
    no_return: float = 81.83
    """metres; what it reports when it sees nothing"""
    reach: float = 30.0
    """metres; nothing farther away returns enough light"""
    dropouts: float = 0.003
    """share of the beams that come back with nothing"""
    footprint: float = np.deg2rad(0.4)
    """radians; a beam this wide can meet two things at an edge, and reports something between them"""

    @property
    def angles(self) -> FloatArray:
        """Headings of the beams, shape (beams,), radians."""
        return self.first_angle + self.angle_step * np.arange(self.beams, dtype=np.float64)

    def ranges(self, world: World, T_world_sensor: Pose2, noise: Noise) -> FloatArray:
        """What it reports from a place, shape (beams,), metres, ``no_return`` included."""
        true = self._met(world, T_world_sensor, noise.uniform(self.beams))
        jitter, luck = noise.normal(self.beams), noise.uniform(self.beams)
        seen = (true < self.reach) & (luck >= self.dropouts)
        steps = np.maximum(np.rint((np.where(seen, true, 0.0) + self.deviation * jitter) / self.resolution), 1.0)
        return np.where(seen, steps * self.resolution, self.no_return)

    def _met(self, world: World, T_world_sensor: Pose2, share: FloatArray) -> FloatArray:
        """The distance each beam reports: where its two sides meet different things, something between the two."""
        sides = [cast(world.segments, T_world_sensor, self.angles + s * self.footprint / 2) for s in (-1.0, 1.0)]
        (right, on_right), (left, on_left) = sides
        centre, _ = cast(world.segments, T_world_sensor, self.angles)
        near, far = np.minimum(right, left), np.minimum(np.maximum(right, left), self.reach)
        with np.errstate(invalid="ignore"):
            mixed = near + _mixing(share) * (far - near)
        return np.where((on_right == on_left) | (far >= self.reach), centre, mixed)

    def scan(self, world: World, T_world_sensor: Pose2, noise: Noise) -> LaserScan:
        """One sweep from a place."""
        ranges = self.ranges(world, T_world_sensor, noise)
        return LaserScan(ranges, self.first_angle, self.angle_step, max_range=self.no_return)


def _mixing(share: FloatArray) -> FloatArray:
    """How far between the nearer and the farther thing a beam that meets both reports: mostly at one of them."""
    return np.clip(3.0 * share - 1.0, 0.0, 1.0)
