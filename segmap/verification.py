"""Candidates -> distinct, refined and judged by lines of sight: what verified mode adds to the paper.

From coarse to fine: many candidates are judged by a few returns each; the distinct ones among the best are
refined and judged by more; the best of those are refined again and judged by all returns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.refinement import distinct, refined
from segmap.visibility import Sighting, look, score, thinned

__all__ = ["Verified", "verify"]

COARSE, MIDDLE, FINE = 24, 40, 180
"""returns of each map that judge candidates, that refine the distinct ones, and that refine the finalists"""
APART = 0.15, math.radians(5.0)
"""metres and radians; nearer candidates are taken as one before refinement brings them together"""
STEPS, FINAL_STEPS = 6, 4
LAST_GATE = 0.1
"""metres; the gate refinement ends with"""
FINAL_GATE = 0.15
"""metres; the gate the finalists begin with"""
FINALISTS = 12


@dataclass(frozen=True, eq=False)
class Verified:
    """Distinct refined poses, best first, as columns."""

    rows: IntArray
    """shape (k,): which candidate each came from"""
    poses: FloatArray
    """shape (k, 3)"""
    totals: FloatArray
    """shape (k, 4): metres supported, contradicted, shadowed, unseen"""
    scores: FloatArray
    """shape (k,), metres"""

    def take(self, rows: IntArray) -> Verified:
        """Some of them."""
        return Verified(self.rows[rows], self.poses[rows], self.totals[rows], self.scores[rows])

    def best(self, parameters: Parameters) -> Verified:
        """The distinct ones, best first."""
        order = np.argsort(-self.scores, kind="stable")
        return self.take(_distinct(self.poses, order, parameters, FINALISTS))

    def placed(self, places: IntArray) -> Verified:
        """The same, where the candidates judged were those in these places among all."""
        return replace(self, rows=places[self.rows])

    def joined(self, other: Verified, parameters: Parameters) -> Verified:
        """The best of both."""
        both = Verified(
            np.concatenate((self.rows, other.rows)),
            np.concatenate((self.poses, other.poses)),
            np.concatenate((self.totals, other.totals)),
            np.concatenate((self.scores, other.scores)),
        )
        return both.best(parameters)


def verify(seen_1: Sighting, seen_2: Sighting, poses: FloatArray, parameters: Parameters) -> Verified:
    """Judge, refine and judge again candidates ``T_1_2`` of poses (k, 3); the distinct best of them."""
    rows = _promising(seen_1, seen_2, poses, parameters)
    middle_1, middle_2 = thinned(seen_1, MIDDLE), thinned(seen_2, MIDDLE)
    moved = refined(middle_1, middle_2, poses[rows], STEPS, parameters.refine_gate, LAST_GATE)
    fine_1, fine_2 = thinned(seen_1, FINE), thinned(seen_2, FINE)
    order = np.argsort(-score(look(fine_1, fine_2, moved, parameters), parameters), kind="stable")
    kept = _distinct(moved, order, parameters, FINALISTS)
    final = refined(fine_1, fine_2, moved[kept], FINAL_STEPS, FINAL_GATE, LAST_GATE)
    totals = look(seen_1, seen_2, final, parameters)
    return Verified(rows[kept], final, totals, score(totals, parameters)).best(parameters)


def _promising(seen_1: Sighting, seen_2: Sighting, poses: FloatArray, parameters: Parameters) -> IntArray:
    """The distinct ones among the best candidates, judged by a few returns each."""
    few_1, few_2 = thinned(seen_1, COARSE), thinned(seen_2, COARSE)
    order = np.argsort(-score(look(few_1, few_2, poses, parameters), parameters), kind="stable")
    return distinct(poses, order, *APART, parameters.refined_candidates)


def _distinct(poses: FloatArray, order: IntArray, parameters: Parameters, most: int) -> IntArray:
    return distinct(poses, order, parameters.rival_distance, parameters.rival_angle, most)
