"""The pose graph over accepted integrations (Section 5 of the algorithm: loops and consistency).

Every accepted integration is an edge with its covariance; the poses that fit all edges best are found by
least squares, with a robust kernel that silences edges the others contradict.
"""

from __future__ import annotations

from segmap.graph.edges import SOURCES, Covariance, Edge, components
from segmap.graph.optimising import BACKENDS, GATE, Iteration, Optimised, Residual, optimise

__all__ = [
    "BACKENDS",
    "GATE",
    "SOURCES",
    "Covariance",
    "Edge",
    "Iteration",
    "Optimised",
    "Residual",
    "components",
    "optimise",
]
