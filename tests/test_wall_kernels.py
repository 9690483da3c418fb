"""The loops over pieces against plain numpy readings of what they say they do."""

import math

import numpy as np
import pytest
import simulated

from segmap._sight_kernels import CLASSES
from segmap.fusion import _wall_kernels as kernels
from segmap.fusion._wall_kernels import Pieces
from segmap.fusion.pieces import grid
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.segments import Sight
from segmap.visibility import classes, sensors, sighting

TWELVE = math.cos(math.radians(12.0))


def some_pieces(seed, count=300, undirected=0.1):
    """Pieces along a few walls, scattered, some of them anywhere."""
    generator = np.random.default_rng(seed)
    walls = np.array([(0.0, 0.0, 0.0), (0.1, 3.0, math.pi), (2.0, -1.0, 1.2)])
    x, y, heading = walls[generator.integers(len(walls), size=count)].T
    along, beside = generator.uniform(-3.0, 3.0, count), generator.normal(0.0, 0.06, count)
    turned = heading + generator.normal(0.0, 0.15, count)
    middles = np.stack((x + along * np.cos(heading), y + along * np.sin(heading)), axis=-1)
    middles += beside[:, None] * np.stack((-np.sin(heading), np.cos(heading)), axis=-1)
    return Pieces(
        middles,
        np.stack((np.cos(turned), np.sin(turned)), axis=-1),
        generator.uniform(0.05, 0.2, count),
        generator.uniform(0.2, 1.0, count),
        generator.uniform(size=count) < undirected,
    )


def agreement(pieces, way):
    cosines = pieces.along @ way
    return np.where(pieces.either, np.abs(cosines), cosines)


def places(pieces, line):
    offset = pieces.middles - line[:2]
    return offset @ line[2:], offset @ (-line[3], line[2])


@pytest.mark.parametrize("seed", range(3))
def test_crowding_counts_what_runs_through_a_piece(seed):
    """The weights of the pieces of its direction that pass beside each middle, by their distance."""
    pieces, spread = some_pieces(seed), 0.05
    expected = np.zeros(len(pieces.middles))
    for i, (middle, way) in enumerate(zip(pieces.middles, pieces.along, strict=True)):
        offset = middle - pieces.middles
        t = (offset * pieces.along).sum(axis=1)
        n = pieces.along[:, 0] * offset[:, 1] - pieces.along[:, 1] * offset[:, 0]
        alike = agreement(pieces, way) >= TWELVE
        if pieces.either[i]:
            alike |= agreement(pieces, -way) >= TWELVE
        near = alike & (np.abs(t) <= pieces.lengths / 2.0) & (np.abs(n) <= 0.4)
        expected[i] = (pieces.weights * np.exp(-0.5 * (n / spread) ** 2))[near].sum()
    found = kernels.crowding(pieces, grid(pieces.middles, 0.5), spread, TWELVE)
    assert found == pytest.approx(expected, abs=1e-9)


def plainly_fitted(line, pieces, free, spread, tolerance, gap):
    """The same rounds of total least squares, with numpy's eigenvectors."""
    point = line[:2].copy()
    for _ in range(kernels.STEPS):
        t, n = places(pieces, line)
        members = np.flatnonzero(free & (agreement(pieces, line[2:]) >= TWELVE) & (np.abs(n) <= tolerance))
        if not len(members):
            break
        members = members[np.argsort(t[members], kind="stable")]
        ends = np.diff(t[members]) - (pieces.lengths[members[1:]] + pieces.lengths[members[:-1]]) / 2.0
        runs = np.split(members, np.flatnonzero(ends > gap) + 1)
        here = (point - line[:2]) @ line[2:]
        nearest = members[np.argmin(np.abs(t[members] - here))]
        run = next(run for run in runs if nearest in run)
        weights = (pieces.weights * pieces.lengths * np.exp(-0.5 * (n / spread) ** 2))[run]
        centre = weights @ pieces.middles[run] / weights.sum()
        arms = pieces.middles[run] - centre
        own = pieces.along[run] * (pieces.lengths[run] / math.sqrt(12.0))[:, None]
        scatter = (arms.T * weights) @ arms + (own.T * weights) @ own
        way = np.linalg.eigh(scatter)[1][:, 1]
        way = way if way @ line[2:] >= 0.0 else -way
        moved = abs((centre - line[:2]) @ (-line[3], line[2])) + abs(line[2] * way[1] - line[3] * way[0])
        line = np.concatenate((centre, way))
        if moved < kernels.SETTLED:
            break
    return line


@pytest.mark.parametrize("seed", range(8))
def test_a_line_settles_as_least_squares_have_it(seed):
    """The compiled rounds give the line that plain ones give, from any piece, with some pieces taken."""
    pieces, generator = some_pieces(seed), np.random.default_rng(seed)
    free = generator.uniform(size=len(pieces.middles)) < 0.8
    for start in generator.integers(len(free), size=6):
        line = np.concatenate((pieces.middles[start], pieces.along[start]))
        found = kernels.fitted(line, pieces, free, 0.05, 0.08, 0.2, TWELVE)
        assert found == pytest.approx(plainly_fitted(line, pieces, free, 0.05, 0.08, 0.2), abs=1e-7)


def test_a_line_without_pieces_stays():
    """Nothing free beside it: the line is what it was."""
    pieces = some_pieces(0)
    line = np.array((50.0, 50.0, 1.0, 0.0))
    assert np.array_equal(kernels.fitted(line, pieces, np.ones(300, bool), 0.05, 0.08, 0.2, TWELVE), line)
    nothing = np.zeros(300, bool)
    line = np.concatenate((pieces.middles[0], pieces.along[0]))
    assert np.array_equal(kernels.fitted(line, pieces, nothing, 0.05, 0.08, 0.2, TWELVE), line)


@pytest.mark.parametrize("seed", range(3))
def test_the_profile_has_every_piece_where_it_lies(seed):
    """Bin by bin along and beside a line, the weights of the pieces there; a short piece is in one bin at least."""
    pieces = some_pieces(seed)
    free = np.arange(300) % 7 != 0
    line, start, step, cell, half = np.array((0.1, 0.02, math.cos(0.02), math.sin(0.02))), -2.0, 0.05, 0.02, 10
    expected = np.zeros((70, 2 * half + 1))
    t, n = places(pieces, line)
    for j in np.flatnonzero(free & (agreement(pieces, line[2:]) >= TWELVE)):
        column = math.floor(n[j] / cell + 0.5) + half
        if 0 <= column <= 2 * half:
            first, last = (math.floor((t[j] + side * pieces.lengths[j] / 2 - start) / step + 0.5) for side in (-1, 1))
            first = max(0, first)
            expected[first : max(first + 1, last), column] += pieces.weights[j]
    found = kernels.profile(line, pieces, free, TWELVE, start, step, 70, cell, half)
    assert expected.any()
    assert found == pytest.approx(expected)


def test_votes_are_what_each_sensor_sees():
    """Sensor by sensor the class that lines of sight give, of those in front, near, and not along the wall."""
    poses = [Pose2(1.5, 1.5, 0.2), Pose2(3.0, 2.5, 2.0), Pose2(4.5, 3.8, -2.8)]
    sights = [Sight(T, simulated.exact(simulated.room(), T)) for T in poses]
    generator = np.random.default_rng(1)
    points = generator.uniform((0.0, 0.0), (7.0, 5.0), (300, 2))
    heading = generator.uniform(-math.pi, math.pi, 300)
    normals = np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    beams, eyes = sensors(sights)
    found = kernels.votes(points, normals, beams, eyes, 3.0, 0.2, 0.15, 0.5)
    expected = np.zeros((300, CLASSES), int)
    parameters = Parameters(sight_tolerance=0.15, shadow_depth=0.0)
    asked = simulated.sight_map((Pose2.identity(), simulated.exact(simulated.room(), poses[0])))
    for pose, sight in zip(poses, sights, strict=True):
        alone = sighting(simulated.sight_map((sight.T_map_sensor, sight.scan)))
        by_points = sighting(asked)._replace(points=np.column_stack((points, np.ones(300))))
        seen = classes(alone, by_points, Pose2.identity(), parameters)[1]
        way = np.array((pose.x, pose.y)) - points
        distance = np.hypot(*way.T)
        counts = (distance <= 3.0) & ((way * normals).sum(axis=1) > 0.2 * distance)
        expected[np.flatnonzero(counts), seen[counts]] += 1
    assert np.array_equal(found, expected)
    assert (found.sum(axis=0)[:2] > 0).all()
