"""The pose graph over accepted integrations (Section 5 of the algorithm: loops and consistency).

Every accepted integration is an edge with its covariance; the poses that fit all edges best are found by
least squares, with a robust kernel that silences edges the others contradict.
"""

from __future__ import annotations

from segmap.graph.edges import SOURCES, Covariance, Edge, components
from segmap.graph.importing import imported_edges
from segmap.graph.marginals import Marginals, Softness
from segmap.graph.optimised import Iteration, Optimised, Part, Residual
from segmap.graph.optimising import BACKENDS, GATE, optimise
from segmap.graph.previewing import Preview, Shift, preview
from segmap.graph.strength import Strength, strength, strength_of
from segmap.graph.ways import Loop, Ways, loop_of
from segmap.graph.words import explain

__all__ = [
    "BACKENDS",
    "GATE",
    "SOURCES",
    "Covariance",
    "Edge",
    "Iteration",
    "Loop",
    "Marginals",
    "Optimised",
    "Part",
    "Preview",
    "Residual",
    "Shift",
    "Softness",
    "Strength",
    "Ways",
    "components",
    "explain",
    "imported_edges",
    "loop_of",
    "optimise",
    "preview",
    "strength",
    "strength_of",
]
