"""Candidates -> distinct, refined and judged by lines of sight: what verified mode adds to the paper.

From coarse to fine: all candidates are looked up in the maps' fields by some returns each; the distinct ones
among the best are refined and looked up by all; the best of those are refined again, and judged by the lines
of sight themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from segmap import tracing
from segmap.fields import Field, field, look_up, refined
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.refinement import distinct
from segmap.segments import SegmentMap
from segmap.visibility import Sighting, look, score, sighting, thinned

__all__ = ["Verified", "Views", "verify", "views"]

FEW, COARSE, MIDDLE, FINE = 30, 120, 90, 360
"""returns of each map that judge candidates where there are very many, that judge them, that refine the distinct
ones, and that judge those and refine the finalists"""
MANY = 4000
"""candidates; of more, as many are left after a look at a few returns"""
APART = 0.15, math.radians(5.0)
"""metres and radians; nearer candidates are taken as one before refinement brings them together"""
STEPS, FINAL_STEPS = 6, 4
LAST_GATE = 0.1
"""metres; the gate refinement ends with"""
FINAL_GATE = 0.15
"""metres; the gate the finalists begin with"""
FINALISTS = 12
"""distinct poses that verified mode ranks in the end"""


@dataclass(frozen=True, eq=False)
class Views:
    """Two maps as their sensors saw them."""

    seen_1: Sighting
    seen_2: Sighting
    fields: tuple[Field, Field]

    def points(self, most: int) -> tuple[FloatArray, FloatArray]:
        """At most about so many returns of each map."""
        return thinned(self.seen_1, most).points, thinned(self.seen_2, most).points


def views(map_1: SegmentMap, map_2: SegmentMap, parameters: Parameters) -> Views | None:
    """Two maps as their sensors saw them; None where one knows of no scan."""
    seen_1, seen_2 = (sighting(some, parameters.max_range) for some in (map_1, map_2))
    if seen_1 is None or seen_2 is None:
        return None
    return Views(seen_1, seen_2, (field(seen_1, parameters), field(seen_2, parameters)))


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


def verify(seen: Views, poses: FloatArray, parameters: Parameters) -> Verified:
    """Judge, refine and judge again candidates ``T_1_2`` of poses (k, 3); the distinct best of them."""
    rows = _promising(seen, poses, parameters)
    middle, fine = seen.points(MIDDLE), seen.points(FINE)
    moved = refined(*seen.fields, *middle, poses[rows], STEPS, parameters.refine_gate, LAST_GATE)
    kept = _distinct(moved, _order(seen, fine, moved, parameters), parameters, FINALISTS)
    final = refined(*seen.fields, *fine, moved[kept], FINAL_STEPS, FINAL_GATE, LAST_GATE)
    totals = look(seen.seen_1, seen.seen_2, final, parameters)
    tracing.tell("refined", poses=poses, rows=rows, moved=moved, kept=kept, final=final, totals=totals)
    return Verified(rows[kept], final, totals, score(totals, parameters)).best(parameters)


def _promising(seen: Views, poses: FloatArray, parameters: Parameters) -> IntArray:
    """The distinct ones among the best candidates, judged by some returns each."""
    rows = np.arange(len(poses))
    if len(poses) > MANY:
        rows = np.sort(_order(seen, seen.points(FEW), poses, parameters)[:MANY])
    order = rows[_order(seen, seen.points(COARSE), poses[rows], parameters)]
    return distinct(poses, order, *APART, parameters.refined_candidates)


def _order(seen: Views, points: tuple[FloatArray, FloatArray], poses: FloatArray, parameters: Parameters) -> IntArray:
    """Rows of poses (k, 3) by what some returns say of them, best first; ties go to the first."""
    return np.argsort(-score(look_up(*seen.fields, *points, poses), parameters), kind="stable")


def _distinct(poses: FloatArray, order: IntArray, parameters: Parameters, most: int) -> IntArray:
    return distinct(poses, order, parameters.rival_distance, parameters.rival_angle, most)
