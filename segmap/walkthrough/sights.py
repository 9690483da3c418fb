"""Lines of sight under one candidate, and how verified mode refines and ranks (beyond the paper)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from segmap.explanation import Explanation, MapSight, explain
from segmap.matches import Match
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.segments import SegmentMap
from segmap.tracing import Event, Trace
from segmap.visibility import CLASS_NAMES
from segmap.walkthrough.steps import Box, Mark, Quantity, Shape, Stage, Step, degrees, lines, metres, of, points

__all__ = ["refinement_stage", "sight_stage"]

MEANING = {
    "supported": "the other sensor saw a surface there",
    "contradicted": "in front of a surface, where a beam of the other sensor passed through",
    "shadowed": "close behind a surface that the other sensor saw",
    "unseen": "where the other sensor could not look",
}
TIMES = {2.0: "double", 1.0: "once", 0.5: "half", 0.25: "a quarter", 0.2: "one fifth", 0.1: "one tenth"}
ROUNDS = ("First", "Second", "Third")
LAID = {"extremes": "segments laid on each other"}


def sight_stage(
    maps: tuple[SegmentMap, SegmentMap], T_1_2: Pose2, parameters: Parameters, box: Box | None, known_as: str
) -> list[Stage]:
    """What the beams of each scan say of the points of the other; none where a map knows of no scan."""
    told = explain(*maps, T_1_2, parameters)
    if told.sights is None:
        return []
    held = _Sight(maps, T_1_2, told, known_as, parameters)
    marks = (Mark(0, "both scans"), *(Mark(1 + k, MEANING[name]) for k, name in enumerate(CLASS_NAMES)))
    stage = Stage(
        id="sight",
        title="Lines of sight",
        about="A scan is more than its walls: along each beam, the way to the first thing it met is empty. A candidate"
        " that puts a wall of one scan into the empty space of the other is wrong, however well the segments match."
        " Each point counts as many metres of wall as its beam is wide there.",
        algorithm="verified",
        count=1 + len(CLASS_NAMES) + len(held.by_segment),
        step=held.step,
        marks=marks,
        box=box,
    )
    return [stage]


@dataclass(frozen=True)
class _Part:
    which: int
    segment: int | None


class _Sight:
    def __init__(
        self,
        maps: tuple[SegmentMap, SegmentMap],
        T_1_2: Pose2,
        told: Explanation,
        known_as: str,
        parameters: Parameters,
    ) -> None:
        assert told.sights is not None
        p = parameters
        self.weights = dict(zip(CLASS_NAMES, (1.0, p.conflict_weight, p.shadow_weight, p.unseen_weight), strict=True))
        self.maps, self.T_1_2, self.told, self.known_as = maps, T_1_2, told, known_as
        self.sides: tuple[MapSight, MapSight] = told.sights
        self.by_segment = [_Part(which, term.segment) for which in (1, 0) for term in self.sides[which].segments]
        self._sensors = [np.array([(s.T_map_sensor.x, s.T_map_sensor.y) for s in each.sights]) for each in maps]

    def step(self, k: int) -> Step:
        """Both scans, one kind of evidence, or the points on one segment."""
        if k == 0:
            return self._all()
        return self._kind(k - 1) if k <= len(CLASS_NAMES) else self._segment(self.by_segment[k - 1 - len(CLASS_NAMES)])

    def _places(self, which: int, seen: str | None = None, segment: object = ...) -> FloatArray:
        """Points of one map in frame 1."""
        chosen = [
            (r.x, r.y)
            for r in self.sides[which].returns
            if (seen is None or r.seen == seen) and (segment is ... or r.segment == segment)
        ]
        return (self.T_1_2 if which else Pose2.identity()) @ np.reshape(chosen, (-1, 2))

    def _walls(self) -> list[Shape]:
        return [of("first", "faint"), of("second", "faint", pose=self.T_1_2)]

    def _all(self) -> Step:
        shapes = self._walls()
        shapes += [points(self._places(which, name), name, size=4) for which in (0, 1) for name in CLASS_NAMES]
        say = (
            f"{self.known_as}{self._use()}: every dot is a point that one sensor saw, coloured by what the other sensor"
            " says of the place. Green: supported. Red: contradicted. Orange: shadowed. Grey: unseen. The score is what"
            " is supported less what the other three take off."
        )
        score = () if self.told.score is None else (metres("score", self.told.score),)
        return Step("1", say, tuple(shapes), (*self._terms(), *score))

    def _use(self) -> str:
        return "" if self.known_as.startswith("The refined") else " (paper mode shows this, but does not use it)"

    def _terms(self) -> tuple[Quantity, ...]:
        held = self.told.evidence
        return () if held is None else tuple(metres(name, float(getattr(held, name)), 2) for name in CLASS_NAMES)

    def _kind(self, kind: int) -> Step:
        name = CLASS_NAMES[kind]
        count = sum(len(self._places(which, name)) for which in (0, 1))
        shapes = self._walls()
        for which in (0, 1):
            shapes += [points(self._places(which, name), name, size=5)]
            shapes += self._beams(which, self._places(which, name)[::6])
        term = (self.told.terms or {}).get(name, 0.0)
        they = f"{count} points: they lie" if count > 1 else "1 point: it lies" if count else "0 points: none lies"
        where = "where the other sensor saw a surface" if name == "supported" else MEANING[name]
        say = f"{name.capitalize()}, {they} {where}. {self._counts(name, count, term)}"
        line = ("2", "3", "4", "5")[kind]
        return Step(line, say, tuple(shapes), (*self._terms(), metres("part of the score", term)))

    def _counts(self, name: str, count: int, term: float) -> str:
        """What the points of a kind do to the score, with the numbers."""
        held, weight = self.told.evidence, self.weights[name]
        if not count or held is None:
            return f"So nothing is {'added to' if name == 'supported' else 'taken off'} the score."
        length = f"{float(getattr(held, name)):.2f} m are {name}"
        if name == "supported":
            return f"{length}; the score gains {term:.2f} m. The thin lines are beams."
        times = TIMES.get(weight, f"{weight:g} times")
        return f"{length}; they count {times}, so the score loses {-term:.2f} m. The thin lines are beams."

    def _beams(self, which: int, places: FloatArray) -> list[Shape]:
        """From the nearest sensor of the other map to some points."""
        sensors = self._sensors[1 - which]
        if not len(sensors) or not len(places):
            return []
        sensors = sensors if which else self.T_1_2 @ sensors
        nearest = sensors[np.argmin(np.hypot(*(places[:, None] - sensors).transpose(2, 0, 1)), axis=1)]
        return [lines(np.concatenate((nearest, places), axis=1), "beam", width=0.8)]

    def _segment(self, part: _Part) -> Step:
        term = next(t for t in self.sides[part.which].segments if t.segment == part.segment)
        shapes = self._walls()
        if part.segment is not None:
            name, pose = (("first", None), ("second", self.T_1_2))[part.which]
            shapes.append(of(name, "accent", [part.segment], pose, width=3))
        for name in CLASS_NAMES:
            places = self._places(part.which, name, part.segment)
            shapes += [*self._beams(part.which, places[::2]), points(places, name, size=5)]
        where = "that lie on no segment" if part.segment is None else f"on segment {part.segment}"
        say = (
            f"The points {where} of map {part.which + 1}, as the sensor of map {2 - part.which} sees them: together"
            f" they {'add' if term.score >= 0 else 'take'} {abs(term.score):.2f} m"
            f" {'to' if term.score >= 0 else 'from'} the score."
        )
        told = tuple(metres(name, float(getattr(term.evidence, name)), 2) for name in CLASS_NAMES)
        return Step("6", say, tuple(shapes), (*told, metres("part of the score", term.score)))


# --- refinement (verified mode) ---------------------------------------------------------------------


def refinement_stage(trace: Trace, match: Match, parameters: Parameters, box: Box | None) -> list[Stage]:
    """From all candidates to few refined ones, ranked; none in paper mode."""
    events = trace.all("refined")
    if not events or not match.ranked:
        return []
    heuristics = [event["name"] for event in trace.all("heuristic")]
    held = _Refinement(events, heuristics, match, parameters)
    stage = Stage(
        id="refinement",
        title="Refining and ranking",
        about="A candidate lays map 2 only about right. Verified mode scores the candidates by lines of sight, keeps"
        f" the best of several that are nearly the same, moves each so that the points fit better, and scores again."
        f"{held.rounds()}",
        algorithm="verified",
        count=2 * len(events) + len(match.ranked),
        step=held.step,
        marks=(Mark(0, "all candidates"), Mark(2 * len(events), "the winner")),
        box=box,
    )
    return [stage]


class _Refinement:
    def __init__(self, events: list[Event], heuristics: list[str], match: Match, parameters: Parameters) -> None:
        self.events, self.match, self.parameters = events, match, parameters
        several = len(events) == len(heuristics) and 1 < len(events) <= len(ROUNDS)
        self._tried = [LAID.get(name, "equal angles") for name in heuristics] if several else []

    def rounds(self) -> str:
        """How many rounds there were, and why; empty where there was one."""
        told = (f"{name.lower()} round: {tried}" for name, tried in zip(ROUNDS, self._tried, strict=False))
        return (
            f" It was not clear yet after the first round, so another followed. {_list(told)}." if self._tried else ""
        )

    def _round(self, number: int) -> str:
        return f"{ROUNDS[number]} round, {self._tried[number]}. " if self._tried else ""

    def step(self, k: int) -> Step:
        """Of each try: what is left of all candidates, and where refinement moves it; then the ranked ones."""
        if k < 2 * len(self.events):
            event = self.events[k // 2]
            return self._moved(event, k // 2) if k % 2 else self._promising(event, k // 2)
        return self._ranked(k - 2 * len(self.events))

    def _promising(self, event: Event, number: int) -> Step:
        poses, rows = event["poses"], event["rows"]
        say = (
            f"{self._round(number)}Each dot is where a candidate puts the sensor of scan 2. Of {len(poses)} candidates"
            f" {len(rows)} are left (marked): the best by {self._by()}, and of several that are nearly the same only"
            " one."
        )
        thinned = poses[:: max(1, len(poses) // 2000), :2]
        shapes = (of("first", "first"), points(thinned, "faint", size=3), points(poses[rows, :2], "accent", size=6))
        return Step("1", say, shapes, (("candidates", str(len(poses)), ""), ("kept", str(len(rows)), "")))

    def _by(self) -> str:
        return "lines of sight" if self.parameters.use_sights else "value"

    def _moved(self, event: Event, number: int) -> Step:
        before, after = event["poses"][event["rows"]], event["moved"]
        far = np.hypot(*(after - before)[:, :2].T)
        say = (
            f"{self._round(number)}Refinement moves each of them so that the points of each scan lie nearer to the"
            " surfaces of the other. Short strokes: it was nearly right. Several end in one place: they were the same"
            f" guess. The best {len(event['kept'])} are moved once more and ranked."
        )
        strokes = lines(np.concatenate((before[:, :2], after[:, :2]), axis=1), "accent", width=1.5)
        shapes = (of("first", "first"), strokes, points(after[:, :2], "new", size=5))
        return Step("7", say, shapes, (metres("moved, median", float(np.median(far))), ("poses", str(len(after)), "")))

    def _ranked(self, rank: int) -> Step:
        one = self.match.ranked[rank]
        shapes = (of("first", "first", width=2.5), of("second", "second", pose=one.T_1_2, width=2.5))
        told: list[Quantity] = [metres("value", one.value)]
        if one.score is not None:
            told.append(metres("score", one.score))
        if one.evidence is not None:
            told += [metres(name, float(getattr(one.evidence, name)), 2) for name in CLASS_NAMES]
        if one.uncertainty is not None:
            told.append(metres("position uncertain by (in the least certain direction)", one.uncertainty.weakest))
        told.append(degrees("turn", one.T_1_2.theta))
        say = (
            f"The winner: candidate {one.index + 1}, refined. {self._why_first()}"
            if rank == 0
            else f"Rival {rank}: another place where map 2 could lie. The closer its score comes to the winner's, the"
            " less sure the winner is."
        )
        return Step("8", say, shapes, tuple(told))

    def _why_first(self) -> str:
        scores = [one.value if one.score is None else one.score for one in self.match.ranked]
        name = "value" if self.match.ranked[0].score is None else "score"
        if scores[0] == max(scores):
            return f"It has the highest {name}."
        return f"Its {name} is nearly the highest, and the walls hold it more firmly than the one of the highest."


def _list(told: Iterable[str]) -> str:
    words = "; ".join(told)
    return words[:1].upper() + words[1:]
