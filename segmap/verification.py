"""Candidates -> distinct, refined and judged by lines of sight: what verified mode adds to the paper.

From coarse to fine: all candidates are looked up in the maps' fields by some returns each; the distinct ones
among the best are refined and looked up by all; the best of those are refined again, and judged by the lines
of sight themselves. Each part can be switched off: without lines of sight values rank, without refinement
candidates stay where they are, without rivals they need not be distinct.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from segmap import tracing
from segmap.evaluation import evaluate
from segmap.fields import Field, field, look_up, refined
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray
from segmap.refinement import Uncertainty, distinct, uncertainties
from segmap.segments import SegmentMap
from segmap.visibility import Sighting, look_closely, score, sighting, thinned

__all__ = ["FINALISTS", "Verified", "Views", "judged", "verify", "views"]

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
"""poses that verified mode ranks in the end, at most"""
TIE = 0.02
"""a candidate with this share of the score less is as good as the best: the one that walls hold comes first,"""
LOOSER = 2.0
"""where they hold it so many times more firmly"""


@dataclass(frozen=True, eq=False)
class Views:
    """Two maps as their sensors saw them."""

    maps: tuple[SegmentMap, SegmentMap]
    seen: tuple[Sighting, Sighting]
    fields: tuple[Field, Field]

    def points(self, most: int) -> tuple[FloatArray, FloatArray]:
        """At most about so many returns of each map."""
        return thinned(self.seen[0], most).points, thinned(self.seen[1], most).points


def views(map_1: SegmentMap, map_2: SegmentMap, parameters: Parameters) -> Views | None:
    """Two maps as their sensors saw them; None where one knows of no scan."""
    seen_1, seen_2 = (sighting(some, parameters.max_range) for some in (map_1, map_2))
    if seen_1 is None or seen_2 is None:
        return None
    return Views((map_1, map_2), (seen_1, seen_2), (field(seen_1, parameters), field(seen_2, parameters)))


@dataclass(frozen=True, eq=False)
class Verified:
    """Refined poses, best first, as columns."""

    rows: IntArray
    """shape (k,): which candidate each came from"""
    poses: FloatArray
    """shape (k, 3)"""
    merits: FloatArray
    """shape (k,), metres, what they are ranked by: the score, or the value without lines of sight"""
    totals: FloatArray
    """shape (k, 6): metres supported, contradicted, shadowed, unseen, off two walls and off three; NaN without
    lines of sight"""
    held: tuple[Uncertainty | None, ...]
    """how firmly each is held; None without refinement"""

    def take(self, rows: IntArray) -> Verified:
        """Some of them."""
        held = tuple(self.held[row] for row in rows)
        return Verified(self.rows[rows], self.poses[rows], self.merits[rows], self.totals[rows], held)

    def best(self, parameters: Parameters, most: int = FINALISTS) -> Verified:
        """The best of them, best first: the distinct ones, unless rivals are off."""
        return self.take(_apart(self.poses, self._order(parameters), parameters, most))

    def _order(self, parameters: Parameters) -> IntArray:
        """By merit; but of those as good as the best, one that walls hold much more firmly comes first."""
        order = np.argsort(-self.merits, kind="stable")
        if not (parameters.use_rivals and parameters.use_refinement and len(order)):
            return order
        weakest = np.array([math.inf if held is None else held.weakest for held in self.held])
        best = order[0]
        as_good = order[self.merits[order] >= self.merits[best] - TIE * abs(self.merits[best])]
        firmest = as_good[np.argmin(weakest[as_good])]
        first = firmest if LOOSER * weakest[firmest] < weakest[best] else best
        return np.concatenate(([first], order[order != first]))

    def placed(self, places: IntArray) -> Verified:
        """The same, where the candidates judged were those in these places among all."""
        return replace(self, rows=places[self.rows])

    def joined(self, other: Verified, parameters: Parameters, most: int = FINALISTS) -> Verified:
        """The best of both."""
        both = Verified(
            np.concatenate((self.rows, other.rows)),
            np.concatenate((self.poses, other.poses)),
            np.concatenate((self.merits, other.merits)),
            np.concatenate((self.totals, other.totals)),
            self.held + other.held,
        )
        return both.best(parameters, most)


def verify(seen: Views, poses: FloatArray, parameters: Parameters) -> Verified:
    """Judge, refine and judge again candidates ``T_1_2`` of poses (k, 3); the best of them."""
    rows = _promising(seen, poses, parameters)
    moved = _refined(seen, poses[rows], MIDDLE, STEPS, parameters.refine_gate, parameters)
    kept = _apart(moved, _order(seen, moved, FINE, parameters), parameters, FINALISTS)
    final = _refined(seen, moved[kept], FINE, FINAL_STEPS, FINAL_GATE, parameters)
    found = judged(seen, rows[kept], final, parameters)
    tracing.tell("refined", poses=poses, rows=rows, moved=moved, kept=kept, final=final, totals=found.totals)
    return found.best(parameters)


def _promising(seen: Views, poses: FloatArray, parameters: Parameters) -> IntArray:
    """The ones to refine: the distinct ones among the best candidates, judged by some returns each."""
    rows = np.arange(len(poses))
    if len(poses) > MANY and parameters.use_sights:
        rows = np.sort(_order(seen, poses, FEW, parameters)[:MANY])
    order = rows[_order(seen, poses[rows], COARSE, parameters)]
    most = parameters.refined_candidates
    return distinct(poses, order, *APART, most) if parameters.use_rivals else order[:most]


def _order(seen: Views, poses: FloatArray, most: int, parameters: Parameters) -> IntArray:
    """Rows of poses (k, 3) by what at most so many returns say of them, or by value; ties go to the first."""
    if parameters.use_sights:
        return np.argsort(-score(look_up(*seen.fields, *seen.points(most), poses), parameters), kind="stable")
    values = evaluate(*seen.maps, poses, parameters)
    order = np.argsort(-np.nan_to_num(values), kind="stable")
    return order[values[order] > 0.0]  # false for NaN, the discarded ones


def _refined(seen: Views, poses: FloatArray, most: int, steps: int, gate: float, parameters: Parameters) -> FloatArray:
    if not parameters.use_refinement:
        return poses
    return refined(*seen.fields, *seen.points(most), poses, steps, gate, LAST_GATE)


def _apart(poses: FloatArray, order: IntArray, parameters: Parameters, most: int) -> IntArray:
    if not parameters.use_rivals:
        return order[:most]
    return distinct(poses, order, parameters.rival_distance, parameters.rival_angle, most)


def judged(seen: Views, rows: IntArray, poses: FloatArray, parameters: Parameters) -> Verified:
    """What all there is says of poses (k, 3) that came from these rows, in their order."""
    held: tuple[Uncertainty | None, ...] = (None,) * len(poses)
    if parameters.use_refinement and len(poses):
        held = tuple(uncertainties(*seen.maps, *seen.seen, poses, parameters))
    if parameters.use_sights:
        totals = look_closely(seen.maps, seen.seen, poses, parameters)
        return Verified(rows, poses, score(totals, parameters), totals, held)
    values = np.nan_to_num(evaluate(*seen.maps, poses, parameters))
    blind = Verified(rows, poses, values, np.full((len(poses), 6), np.nan), held)
    return blind.take(np.flatnonzero(values > 0.0))
