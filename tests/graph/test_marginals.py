"""Covariances against laws and against a dense twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from graphs import COVARIANCE, ring, with_wrong
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csc_array

from segmap.errors import GraphError
from segmap.graph import Edge, Marginals, _inverse, optimise, strength
from segmap.graph.arrays import EdgeArrays, composed, inverted, moved, residuals
from segmap.pose import Pose2
from segmap.scans import ScanId

A, B, C = (ScanId(0, i) for i in range(3))
SKEWED = np.array([[4e-4, 1e-4, 2e-5], [1e-4, 9e-4, -3e-5], [2e-5, -3e-5, 2.5e-5]])


def dense(edges: list[Edge], poses: np.ndarray, places: dict[ScanId, int]) -> np.ndarray:
    """Covariance of small motions of all poses but the first, from numeric slopes of the whitened residuals."""
    held = EdgeArrays.of(edges, places)

    def left(delta: np.ndarray) -> np.ndarray:
        at = moved(poses, np.vstack((np.zeros(3), delta.reshape(-1, 3))))
        return np.einsum("eij,ej->ei", held.whitening, residuals(at, held)).ravel()

    steps = 1e-6 * np.eye(3 * (len(poses) - 1))
    slope = np.stack([(left(step) - left(-step)) / 2e-6 for step in steps], axis=-1)
    return np.linalg.inv(slope.T @ slope)


def test_a_single_edge_is_as_sure_as_it_says():
    """The pose of a scan that one edge places has that edge's covariance, told from either side."""
    edge = Edge(A, B, Pose2(2.0, -1.0, 2.2), SKEWED)
    result = optimise([edge])
    assert result.covariance(B) == pytest.approx(SKEWED, rel=1e-6)
    assert result.covariance(A, of=B) == pytest.approx(np.array(edge.reversed().covariance), rel=1e-6)


def test_two_equal_edges_halve_the_variance():
    """Evidence adds up: twice the same edge is half the covariance."""
    edge = Edge(A, B, Pose2(2.0, -1.0, 2.2), SKEWED)
    assert optimise([edge, edge]).covariance(B) == pytest.approx(SKEWED / 2.0, rel=1e-6)


def test_far_along_a_chain_headings_move_places():
    """Two edges end to end: the heading error of the first moves what the second places, arm times angle."""
    sure = np.diag([1e-8, 1e-8, 1e-4])
    chain = [Edge(A, B, Pose2(0.0, 0.0, 0.0), sure), Edge(B, C, Pose2(10.0, 0.0, 0.0), np.diag([1e-8] * 3))]
    covariance = optimise(chain).covariance(C)
    assert math.sqrt(covariance[1, 1]) == pytest.approx(10.0 * 1e-2, rel=1e-3)
    assert math.sqrt(covariance[0, 0]) < 1e-3


def test_covariances_are_those_of_a_dense_twin():
    """Between any two scans of a graph with loops: the dense inverse, carried over by numeric differences."""
    truth, edges = ring(16)
    result = optimise(edges, robust=False)
    places = {scan: place for place, scan in enumerate(truth)}
    poses = np.array([tuple(result.poses[scan]) for scan in truth])
    joint = dense(edges, poses, places)
    for a, b in ((5, 11), (15, 2), (0, 9)):

        def between(delta: np.ndarray, a: int = a, b: int = b) -> np.ndarray:
            at = moved(poses, np.vstack((np.zeros(3), delta.reshape(-1, 3))))
            return composed(inverted(at[a]), at[b])

        steps = 1e-6 * np.eye(len(joint))
        slope = np.stack([(between(step) - between(-step)) / 2e-6 for step in steps], axis=-1)
        expected = slope @ joint @ slope.T
        found = result.covariance(ScanId(0, b), of=ScanId(0, a))
        assert found == pytest.approx(expected, rel=1e-4, abs=1e-9)


def test_silenced_edges_make_nothing_surer():
    """Covariances are those of the clean graph, whatever was silenced."""
    _, edges = ring(30)
    clean, mixed = optimise(edges), optimise(with_wrong(edges, 0.3, "random"))
    for scan in (ScanId(0, 9), ScanId(0, 29)):
        assert mixed.covariance(scan) == pytest.approx(clean.covariance(scan), rel=1e-4)


def test_the_softest_scan_is_the_least_sure():
    """The softest scan of a chain is its end, as unsure as its covariance says; closures make it surer."""
    _, edges = ring(40)
    chain, whole = (strength(optimise(those))[0] for those in ([e for e in edges if e.trusted], edges))
    assert chain.deviation > 3.0 * whole.deviation
    result = optimise([e for e in edges if e.trusted])
    worst = max((math.sqrt(np.linalg.eigvalsh(result.covariance(scan)[:2, :2])[1]), scan) for scan in result.poses)
    assert (chain.deviation, chain.softest) == (pytest.approx(worst[0], rel=1e-6), worst[1])
    along = np.array((math.cos(chain.heading), math.sin(chain.heading)))
    assert along @ result.covariance(worst[1])[:2, :2] @ along == pytest.approx(worst[0] ** 2, rel=1e-6)


@given(st.integers(1, 12), st.integers(0, 1000))
def test_the_sparse_inverse_is_that_of_a_dense_matrix(size, seed):
    """Factors, and the entries of the inverse where the matrix has entries; where its factor has none, none is told."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size)) * (rng.random((size, size)) < 0.3)
    matrix = root @ root.T + np.eye(size)
    held = csc_array(matrix)
    held.sort_indices()
    columns = held.indptr.astype(np.int64), held.indices.astype(np.int64), held.data
    begins, below, factors, diagonal = _inverse.factorise(*columns)
    assert begins.tolist() == _inverse.column_starts(*columns[:2]).tolist()
    lower = np.eye(size)
    for j in range(size):
        lower[below[begins[j] : begins[j + 1]], j] = factors[begins[j] : begins[j + 1]]
    assert lower @ np.diag(diagonal) @ lower.T == pytest.approx(matrix, abs=1e-9)
    rows, across = (place.ravel() for place in np.indices((size, size)))
    found = _inverse.looked_up(begins, below, *_inverse.invert(begins, below, factors, diagonal), rows, across)
    found, known = found.reshape(size, size), (lower != 0.0) | (lower != 0.0).T
    assert found[known] == pytest.approx(np.linalg.inv(matrix)[known], abs=1e-9)
    assert not np.isnan(found[matrix != 0.0]).any()


def test_what_one_more_edge_costs():
    """The squared distance of an edge, with the uncertainty of both, is what the graph's error grows by with it."""
    truth, edges = ring(30)
    off = Pose2(0.05, -0.03, 0.01)
    a, b = ScanId(0, 4), ScanId(0, 17)
    more = Edge(a, b, truth[a].inverse() @ truth[b] @ off, SKEWED)
    before, after = optimise(edges, robust=False), optimise([*edges, more], robust=False)
    places = {scan: place for place, scan in enumerate(truth)}
    poses = np.array([tuple(before.poses[scan]) for scan in truth])
    squared, unsure = Marginals(EdgeArrays.of(edges, places), poses, EdgeArrays.of([more], places)).surprise()
    assert squared[0] == pytest.approx(after.error - before.error, rel=1e-3)
    assert unsure[0] > 0.0
    assert Marginals(EdgeArrays.of(edges, places), poses).surprise()[0].shape == (0,)


def test_how_far_covariances_are_from_the_truth():
    """Residuals tell by how much covariances are too careful; a chain has none that could."""
    _, edges = ring(60, noise=0.1)
    careful = optimise(edges, robust=False).variance_factor
    assert careful == pytest.approx(0.01 / 3.0, rel=0.2)  # noise is uniform in +-0.1 standard deviations
    assert optimise([edge for edge in edges if edge.trusted]).variance_factor is None


def test_of_scans_in_different_components_nothing_is_known():
    """A covariance across components, or of a scan that no edge holds, is refused."""
    result = optimise([*ring(4)[1], *ring(4, log=1)[1]])
    with pytest.raises(GraphError, match=r"0\.1 and 1\.2 are in different components"):
        result.covariance(ScanId(1, 2), of=ScanId(0, 1))
    with pytest.raises(GraphError, match=r"No edge holds scan 7\.7"):
        result.covariance(ScanId(7, 7))


def test_uncertain_pose_covers_the_error():
    """Over many noisy graphs the poses are off by what their covariance says: chi squared, 3 on average."""
    squared = []
    for seed in range(60):
        truth, edges = ring(16, seed=seed, noise=math.sqrt(3.0))  # uniform in +-sqrt(3): unit variance
        result = optimise(edges, robust=False)
        scan = ScanId(0, 11)
        off = np.array(tuple(result.poses[scan])) - tuple(truth[scan])
        squared.append(off @ np.linalg.solve(result.covariance(scan), off))
    assert np.mean(squared) == pytest.approx(3.0, abs=1.0)


def test_covariance_array_is_taken():
    """An array serves as a covariance, and comes back as plain numbers."""
    assert Edge(A, B, Pose2.identity(), np.array(COVARIANCE)).covariance == COVARIANCE
