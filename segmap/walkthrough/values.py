"""Candidates evaluated one by one, and one candidate pair by pair (Section III-B, Algorithm 4)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from segmap.explanation import Explanation, PairTerm, explain, measured
from segmap.matches import Match
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.walkthrough.found import Found
from segmap.walkthrough.steps import (
    CHAINS,
    Mark,
    Quantity,
    Shape,
    Stage,
    Step,
    around,
    degrees,
    lines,
    metres,
    of,
    points,
    text,
)

__all__ = ["PAIRS", "evaluation_stage", "pairs_stage"]

PAIRS = "pairs:"
"""the stages of one candidate begin so; its number follows, from 1"""
IMPROVEMENTS = 12
"""the last of the improvements that are marked"""
PENALTY_CURVE = 40


# --- candidate by candidate -------------------------------------------------------------------------


def evaluation_stage(found: Found, match: Match, truth: Pose2 | None = None) -> Stage:
    """Every candidate with its value, or why it is discarded, and the best so far."""
    marks = [Mark(int(k) + 1, f"best so far: candidate {int(k) + 1}") for k in found.improvements[-IMPROVEMENTS:]]
    marks += [Mark(int(k) + 1, "the first candidate that is discarded") for k in found.discarded[:1]]
    if found.best is not None:
        marks.append(Mark(found.best + 1, "the moment the best candidate was found"))
    by_sight = match.best is not None and match.best.score is not None
    if by_sight and match.best is not None:
        marks.append(Mark(match.best.index + 1, "the candidate that is refined into the winner"))
    nearest = None if truth is None else found.nearest(truth)
    if nearest is not None:
        marks.append(Mark(nearest + 1, "the candidate nearest to the truth"))
    return Stage(
        id="evaluation",
        title="Value of the candidates",
        about="The value of a candidate, a guess at how map 2 lies on map 1, is the length of wall, in metres, on which"
        f" the two maps agree when map 2 is moved like that. {_CHOOSES_NOT if by_sight else _CHOOSES}",
        algorithm="4",
        count=len(found) + 1,
        step=lambda k: _beginning(found, by_sight) if k == 0 else _valued(found, k - 1, truth),
        marks=(Mark(0, "the idea"), *sorted(marks, key=lambda mark: mark.index)),
        stops=found.spread(),
        box=found.box,
        chart=found.chart(),
    )


_CHOOSES = "The candidate of the highest value wins."
_CHOOSES_NOT = (
    "In verified mode the value does not choose: candidates also get a score from lines of sight, and after refinement"
    " the highest score wins. The winner's value is only compared with a threshold at the end."
)


def _beginning(found: Found, by_sight: bool) -> Step:
    alive = len(found) - len(found.discarded)
    say = (
        f"Each of the {len(found)} candidates is tried in turn: map 2 (orange) is moved by it, and wherever one of its"
        " segments comes to lie along a segment of map 1 (blue) they may be the same wall. The common length counts."
        " Two long walls that cross cannot both be there: such a candidate is discarded."
    )
    if by_sight and len(found) <= found.parameters.judged_candidates:
        say += " So the paper's mode does it; verified mode gives discarded candidates a score, too."
    told = (("candidates", str(len(found)), ""), ("discarded", str(len(found.discarded)), ""))
    shapes = (of("first", "first", width=2.5), of("second", "second", width=2.5))
    return Step("1", say, shapes, (*told, ("not discarded", str(alive), "")))


def _valued(found: Found, k: int, truth: Pose2 | None) -> Step:
    told = explain(found.map_1, found.map_2, found.pose(k), found.parameters, sights=False)
    value, before = float(found.values[k]), float(found.running[k - 1]) if k else 0.0
    enter = {"label": "Look at this candidate pair by pair", "stage": f"{PAIRS}{k + 1}"}
    at = (float(k + 1), 0.0 if np.isnan(value) else round(value, 4))
    if told.discarded:
        line, say = "7", _why_discarded(told, k, found)
    elif value > before:
        line = "21"
        say = (
            f"Candidate {k + 1} of {len(found)} has a value of {value:.3f} m, more than the best before it"
            f" ({before:.3f} m): it is the best so far. On the coloured segments the two maps agree: they match."
        )
    else:
        line = "22"
        say = (
            f"Candidate {k + 1} of {len(found)} has a value of {value:.3f} m, not more than the best so far"
            f" ({before:.3f} m)."
            + (" The coloured segments match." if told.pairs else " No segment lies along another: nothing matches.")
        )
    numbers: tuple[Quantity, ...] = (
        ("value", "discarded" if told.discarded else f"{value:.3f}", "" if told.discarded else "m"),
        metres("best so far", float(found.running[k])),
    )
    if not told.discarded:
        numbers += (("matching pairs of segments", str(sum(pair.chain is not None for pair in told.pairs)), ""),)
    if truth is not None:
        off, turned = found.pose(k).distance(truth)
        numbers += (metres("off the truth", off, 2), degrees("turned off the truth", turned))
    return Step(line, say, tuple(_matched(told, found, k)), numbers, at=at, enter=enter)


def _why_discarded(told: Explanation, k: int, found: Found) -> str:
    c, p = told.crossings[0], found.parameters
    more = f", and {len(told.crossings) - 1} more such pairs" if told.crossings[1:] else ""
    return (
        f"Candidate {k + 1} of {len(found)} is discarded: segment {c.first} of map 1 and segment {c.second} of map 2,"
        f" both longer than {p.segment_length_refuse:.2f} m, cross at the red mark at an angle of"
        f" {np.degrees(c.angle):.0f}°{more}. Two long walls cannot go through each other, so map 2 cannot lie"
        " like this."
    )


def _matched(told: Explanation, found: Found, k: int) -> list[Shape]:
    T_1_2 = found.pose(k)
    shapes = [of("first", "first"), of("second", "second", pose=T_1_2)]
    for place, chain in enumerate(told.chains if not told.discarded else ()):
        role = f"chain-{place % CHAINS}"
        shapes += [of("first", role, chain.first, width=4), of("second", role, chain.second, T_1_2, width=4)]
    for crossing in told.crossings:
        shapes += [
            of("first", "bad", [crossing.first], width=3),
            of("second", "bad", [crossing.second], T_1_2, width=3),
        ]
    if told.crossings:
        shapes.append(points([(c.x, c.y) for c in told.crossings], "bad", size=9, mark="cross"))
    return shapes


# --- one candidate, pair by pair ----------------------------------------------------------------------


def pairs_stage(found: Found, k: int) -> Stage:
    """Every pair of segments under candidate k, in the order of the algorithm."""
    held = _Pairs(found, k)
    matched = [p.first * held.n_2 + p.second for p in held.told.pairs]
    marks = [Mark(row + 1, label) for row, label in held.notable()]
    return Stage(
        id=f"{PAIRS}{k + 1}",
        title=f"Candidate {k + 1}, pair by pair",
        about="How one candidate gets its value: each segment of map 1 is compared with each of map 2. l1 is how much"
        " of the first the second covers, l2 how much of the second the first covers. Their mean counts in full where"
        " the two touch, and is multiplied by a factor below 1 where they do not. The farther apart, the smaller the"
        " factor. Their distance: a and b are how far the ends of the one lie from the line of the other, c and d the"
        " other way round. Take the larger of a and b and the larger of c and d; the smaller of these two counts.",
        algorithm="4",
        count=held.count,
        step=held.step,
        marks=(Mark(0, "the candidate"), *marks),
        stops=sorted({0, *(row + 1 for row, _ in held.notable()), *(row + 1 for row in matched if row < held.pairs)}),
        box=found.box,
        chart=_penalty_chart(found.parameters),
        figure="Figs. 2 and 3",
    )


class _Pairs:
    def __init__(self, found: Found, k: int) -> None:
        self.found, self.k, self.parameters = found, k, found.parameters
        self.T_1_2 = found.pose(k)
        self.map_1, self.moved = found.map_1, found.map_2.moved(self.T_1_2)
        self.n_2 = len(found.map_2)
        self.told = explain(found.map_1, found.map_2, self.T_1_2, found.parameters, sights=False)
        self._terms = {(pair.first, pair.second): pair for pair in self.told.pairs}
        self._crossing = {(c.first, c.second): c for c in self.told.crossings}
        ends = [c.first * self.n_2 + c.second + 1 for c in self.told.crossings]
        self.pairs = min([len(self.map_1) * self.n_2, *ends])
        """pairs that are looked at: the algorithm goes no further than the one that discards the candidate"""
        self.count = self.pairs + 1

    @cached_property
    def _sums(self) -> tuple[FloatArray, FloatArray]:
        """Rows of the pairs with a value, and the value of the candidate up to each."""
        rows = np.array([pair.first * self.n_2 + pair.second for pair in self.told.pairs], dtype=np.float64)
        return rows, np.cumsum([0.0, *(pair.value for pair in self.told.pairs)])

    def notable(self) -> list[tuple[int, str]]:
        """Pairs worth a look."""
        by_value = sorted(self.told.pairs, key=lambda pair: -pair.value)
        penalised = sorted((p for p in self.told.pairs if p.factor < 1.0 and p.value > 0.05), key=lambda p: p.factor)
        found = [(pair, "the pair that adds most") for pair in by_value[:1]]
        found += [(pair, "a strong penalty (Fig. 3)") for pair in penalised[:1]]
        found += [(pair, "a weak penalty (Fig. 3)") for pair in penalised[1:][-1:]]
        marks = [(pair.first * self.n_2 + pair.second, label) for pair, label in found]
        marks += [(c.first * self.n_2 + c.second, "the pair that discards it") for c in self.told.crossings[:1]]
        return sorted(mark for mark in marks if mark[0] < self.pairs)

    def step(self, k: int) -> Step:
        """The candidate, or one pair."""
        if k == 0:
            return self._whole()
        i, j = divmod(k - 1, self.n_2)
        if (i, j) in self._crossing:
            return self._crossed(i, j)
        distance, factor, l1, l2 = measured(self.map_1.coordinates[[i]], self.moved.coordinates[[j]], self.parameters)[
            0
        ]
        return self._pair(k - 1, PairTerm(i, j, self._value(i, j), distance, factor, l1, l2, None))

    def _value(self, i: int, j: int) -> float:
        term = self._terms.get((i, j))
        return term.value if term else 0.0

    def _whole(self) -> Step:
        every, common = len(self.map_1) * self.n_2, len(self.told.pairs)
        say = (
            f"Candidate {self.k + 1}: {len(self.map_1)} segments of map 1 times {self.n_2} of map 2 are {every} pairs. "
        )
        if self.told.discarded:
            say += (
                f"This candidate will be discarded, at pair {self.pairs}: watch for two long segments that cross. The"
                " pairs after it are not looked at."
            )
        else:
            say += f"{common} of them {'has' if common == 1 else 'have'} a common length that counts."
        value = ("value", "discarded", "") if self.told.discarded else metres("value", self.told.value)
        return Step("4", say, tuple(_matched(self.told, self.found, self.k)), (value,))

    def _crossed(self, i: int, j: int) -> Step:
        c, p = self._crossing[i, j], self.parameters
        shapes = (*self._background(), *self._two(i, j), points([(c.x, c.y)], "bad", size=9, mark="cross"))
        say = (
            f"Segment {i} of map 1 and segment {j} of map 2 cross, and both are longer than"
            f" {p.segment_length_refuse:.2f} m. In a building two long walls do not go through each other: the"
            " candidate is discarded, whatever else matches, and no further pair is looked at."
        )
        lengths = self.map_1.lengths[i], self.moved.lengths[j]
        told = (metres(f"length of {i}, map 1", float(lengths[0])), metres(f"length of {j}, map 2", float(lengths[1])))
        return Step("7", say, shapes, (*told, degrees("angle between them", c.angle)), box=self._box(i, j))

    def _pair(self, row: int, term: PairTerm) -> Step:
        p = self.parameters
        tolerances = term.distance / p.point_distance_tolerance
        rows, sums = self._sums
        total = float(sums[int(np.searchsorted(rows, row, side="right"))])
        i, j = term.first, term.second
        covered, distances = self._measured(i, j)
        shapes = [*self._background(), *covered, *self._two(i, j), *distances]
        told: tuple[Quantity, ...] = (
            metres("distance", term.distance),
            ("distance / tolerance", f"{tolerances:.2f}", ""),
        )
        told += (("threshold", f"{p.segment_distance_threshold:g}", "tolerances"), metres("l1", term.common_1))
        told += (metres("l2", term.common_2), ("factor for the distance", f"{term.factor:.4f}", ""))
        told += (metres("matching value", term.value), metres("value so far", total))
        line, say = self._sentence(term, tolerances)
        at = (round(tolerances, 3), round(term.factor, 4)) if line == "16" else None
        return Step(line, say, tuple(shapes), told, box=self._box(i, j), at=at)

    def _sentence(self, term: PairTerm, tolerances: float) -> tuple[str, str]:
        i, j, p = term.first, term.second, self.parameters
        pair = f"Segment {i} of map 1 and segment {j} of map 2"
        if tolerances > p.segment_distance_threshold:
            return "10", (
                f"{pair} are {term.distance:.3f} m apart, {tolerances:.1f} tolerances of"
                f" {p.point_distance_tolerance:g} m. Segments more than {p.segment_distance_threshold:g} tolerances"
                f" ({p.segment_distance_threshold * p.point_distance_tolerance:.2f} m) apart are not taken for the same"
                " wall: this pair adds nothing."
            )
        if max(term.common_1, term.common_2) <= 0.0:
            return (
                "14",
                f"{pair} lie beside no part of each other: no length in common, and nothing to add to the value.",
            )
        half = f"{term.common_1:.3f} m of the one and {term.common_2:.3f} m of the other"
        if p.distance_penalty == 1.0:
            return "18", f"{pair} have {half} in common. The mean, {term.value:.3f} m, counts: distance costs nothing."
        if term.factor == 1.0:
            although = f", although it is {term.distance:.3f} m" if term.distance >= 0.0005 else ""
            return "18", (
                f"{pair} touch (share a point) and have {half} in common. So nothing is taken off for the distance"
                f"{although}: the mean, {term.value:.3f} m, counts in full."
            )
        return "16", (
            f"{pair} have {half} in common but do not touch; they are {term.distance:.3f} m apart. The mean is"
            f" multiplied by {p.distance_penalty:g} to the power of {term.distance:.3f} m /"
            f" {p.point_distance_tolerance:g} m = {tolerances:.2f}, that is by {term.factor:.3f}. They add"
            f" {term.value:.3f} m."
        )

    def _background(self) -> list[Shape]:
        return [of("first", "faint"), of("second", "faint", pose=self.T_1_2)]

    def _two(self, i: int, j: int) -> list[Shape]:
        return [of("first", "first", [i], width=4), of("second", "second", [j], self.T_1_2, width=4)]

    def _measured(self, i: int, j: int) -> tuple[list[Shape], list[Shape]]:
        """What each segment covers of the other, and the four distances a, b, c, d of Fig. 2."""
        one, other = self.map_1.coordinates[i], self.moved.coordinates[j]
        covered: list[Shape] = []
        shapes: list[Shape] = []
        for names, line, segment in (("ab", one, other), ("cd", other, one)):
            start, along = line[:2], line[2:] - line[:2]
            length = float(np.hypot(*along))
            unit = along / length
            places = [float((end - start) @ unit) for end in (segment[:2], segment[2:])]
            feet = [start + place * unit for place in places]
            for name, end, foot in zip(names, (segment[:2], segment[2:]), feet, strict=True):
                shapes.append(lines(np.concatenate((end, foot)), "accent", width=1.2, dash=True))
                shapes.append(text((end + foot) / 2.0, name, "accent"))
            first, last = max(0.0, min(places)), min(length, max(places))
            if last > first:
                covered.append(
                    lines(np.concatenate((start + first * unit, start + last * unit)), "good", width=12, faded=True)
                )
        return covered, shapes

    def _box(self, i: int, j: int) -> tuple[float, float, float, float] | None:
        return around(self.map_1.coordinates[i], self.moved.coordinates[j], margin=0.2, least=0.3)


def _penalty_chart(parameters: Parameters) -> dict[str, object]:
    most = parameters.segment_distance_threshold
    places = np.linspace(0.0, most, PENALTY_CURVE)
    values = [[round(float(x), 3), round(float(parameters.distance_penalty**x), 4)] for x in places]
    title = "Factor for the distance of two segments that do not touch"
    return {"kind": "series", "title": title, "x": "distance / tolerance", "y": "", "values": values}
