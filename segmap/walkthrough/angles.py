"""Which angles a heuristic takes and why it leaves the others; draws; the candidates they give (Section III-A)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from segmap.candidates import angles
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2, wrap
from segmap.segments import Order, SegmentMap
from segmap.tracing import Event, Trace
from segmap.walkthrough.found import Found
from segmap.walkthrough.steps import Mark, Quantity, Shape, Stage, Step, around, degrees, metres, of, path

__all__ = ["angle_shapes", "angles_stages", "candidates_stage", "draws_stage"]

NAMES = ("first", "second")
ABOUT = {
    "all": "every pair of segments",
    "consecutive": "only segments that follow each other along the walls, and only the longer ones",
    "histogram": "only one segment along the main direction of the walls with one across it",
}


# --- which pairs of segments form an angle ----------------------------------------------------------


def angles_stages(trace: Trace, parameters: Parameters) -> list[Stage]:
    """A stage for each map: pair by pair, taken or not, and why; none where no angle was asked for."""
    chosen = trace.all("chosen")
    if len(chosen) < 2:
        return []
    name = trace.all("heuristic")[-1]["name"]
    told = trace.all(name) if name in _WHY else []
    return [
        _angles_stage(which, name, event, told[which - 1 : which], parameters)
        for which, event in enumerate(chosen[:2], start=1)
    ]


def _angles_stage(which: int, name: str, event: Event, told: list[Event], parameters: Parameters) -> Stage:
    held = _Angles(which, name, event, told[0] if told else None, parameters)
    marks = [Mark(0, "the idea")]
    marks += [Mark(k + 1, f"first pair {word}") for word, k in held.firsts.items()]
    return Stage(
        id=f"angles-{which}",
        title=f"Angles of map {which}",
        about="An angle between two segments is a landmark that looks the same from everywhere. A heuristic is a rule"
        f" that says which angles are worth trying: '{name}' takes {ABOUT[name]}.",
        algorithm="2",
        count=len(held.pairs) + 1,
        step=held.step,
        marks=tuple(marks),
        stops=(0, *(held.taken + 1).tolist()),
        box=around(held.map.coordinates),
        chart=held.chart,
        figure="Fig. 1" if name == "histogram" else "",
    )


class _Angles:
    """Every pair of segments of a map, and what became of it."""

    def __init__(self, which: int, name: str, event: Event, told: Event | None, parameters: Parameters) -> None:
        self.which, self.name, self.parameters = which, name, parameters
        self.map: SegmentMap = event["map"]
        self.pairs = np.stack(np.triu_indices(len(self.map), k=1), axis=-1)
        self._usable = _by_pair(event["pairs"], event["usable"])
        self._told = told
        states = np.array([self._state(int(i), int(j)) for i, j in self.pairs], dtype=object)
        self.taken = np.flatnonzero(states == "taken")
        found = {word: np.flatnonzero(states == word) for word in ("taken", "left out", "without vertex")}
        self.firsts = {word: int(rows[0]) for word, rows in found.items() if len(rows)}
        self.count = {word: len(rows) for word, rows in found.items()}
        self.chart = _histogram_chart(told) if name == "histogram" and told else _lengths_chart(self.map)

    def _state(self, i: int, j: int) -> str:
        usable = self._usable.get((i, j))
        return "left out" if usable is None else "taken" if usable else "without vertex"

    def step(self, k: int) -> Step:
        """The idea, or one pair."""
        line = ("2", "6")[self.which - 1]
        if k == 0:
            return Step(line, self._idea(), (of(NAMES[self.which - 1], NAMES[self.which - 1]),), self._counts())
        i, j = map(int, self.pairs[k - 1])
        state = self._state(i, j)
        shapes = [of(NAMES[self.which - 1], "faint")]
        shapes += angle_shapes(self.map, (i, j), NAMES[self.which - 1], vertex=state == "taken")
        line = ("3", "7")[self.which - 1] if state == "taken" else line
        return Step(line, self._sentence(i, j, state), tuple(shapes), self._quantities(i, j))

    def _idea(self) -> str:
        n, taken = len(self.map), self.count["taken"]
        return (
            f"Map {self.which} has {n} segments, so {len(self.pairs)} pairs of them. Of these {taken} give an angle:"
            f" '{self.name}' takes {ABOUT[self.name]}, and segments nearly parallel form none. {_LESSON[self.name]}"
        )

    def _counts(self) -> tuple[Quantity, ...]:
        return tuple((f"pairs {word}", str(count), "") for word, count in self.count.items())

    def _sentence(self, i: int, j: int, state: str) -> str:
        pair = f"Segments {i} and {j}"
        if state == "taken":
            return (
                f"{pair}: their angle is kept. The dashed lines prolong both segments to where they meet, the vertex."
            )
        if state == "without vertex":
            least = math.degrees(self.parameters.min_vertex_angle)
            return f"{pair} are within {least:.1f}° of parallel: their lines meet far away or nowhere, so no angle."
        return f"{pair} are left out: {_WHY[self.name](self, i, j)}."

    def _quantities(self, i: int, j: int) -> tuple[Quantity, ...]:
        lengths, headings = self.map.lengths, self.map.headings
        angle = degrees("angle", float(wrap(float(headings[j] - headings[i]))))
        return angle, metres(f"length of {i}", float(lengths[i])), metres(f"length of {j}", float(lengths[j]))

    @property
    def told(self) -> Event:
        """What the heuristic's selection told."""
        assert self._told is not None
        return self._told


_LESSON = {
    "all": "Nothing is missed, but the number of candidates grows with the fourth power of the number of segments.",
    "consecutive": "Neighbours along a wall are likely to be seen together by both scans.",
    "histogram": "In a building most walls run along two directions; clutter runs along none.",
}


def _by_pair(pairs: IntArray, usable: IntArray) -> dict[tuple[int, int], bool]:
    """Whether the angle of a pair has a vertex, by the pair, lower index first."""
    held: dict[tuple[int, int], bool] = {}
    for (i, j), has in zip(pairs.tolist(), usable.tolist(), strict=True):
        held[min(i, j), max(i, j)] = held.get((min(i, j), max(i, j)), False) or bool(has)
    return held


def _why_consecutive(held: _Angles, i: int, j: int) -> str:
    long_enough, lengths = held.told["long_enough"], held.map.lengths
    short = [k for k in (i, j) if not long_enough[k]]
    if short:
        least = held.parameters.segment_length_percentage / 100.0 * float(lengths.max())
        return (
            f"segment {short[0]} is {lengths[short[0]]:.2f} m long, shorter than {least:.2f} m, which is"
            f" {held.parameters.segment_length_percentage:.0f} % of the longest"
        )
    if held.map.order is Order.NONE or held.parameters.consecutive_strict:
        return "they have no extreme point in common"
    return "they do not follow each other: another long segment lies between them in the order of the beams"


def _why_histogram(held: _Angles, i: int, j: int) -> str:
    buckets, principal, normal = held.told["buckets"], held.told["principal"], held.told["normal"]
    stray = [k for k in (i, j) if buckets[k] not in (principal, normal)]
    if stray:
        return (
            f"segment {stray[0]} runs in the direction of bucket {buckets[stray[0]]}, neither along the walls"
            f" ({principal}) nor across ({normal})"
        )
    return "both run along the same direction, and an angle takes one along and one across"


_WHY: dict[str, Callable[[_Angles, int, int], str]] = {"consecutive": _why_consecutive, "histogram": _why_histogram}


def _histogram_chart(told: Event) -> dict[str, object]:
    totals = told["totals"]
    return {
        "kind": "bars",
        "title": "Length of the segments by direction",
        "x": f"direction, in {len(totals)} buckets of {180 / len(totals):.0f}°",
        "y": "m",
        "values": [round(float(one), 3) for one in totals],
        "marked": {str(told["principal"]): "accent", str(told["normal"]): "good"},
        "legend": [["accent", "principal direction"], ["good", "across it"]],
    }


def _lengths_chart(segment_map: SegmentMap) -> dict[str, object]:
    return {
        "kind": "bars",
        "title": "Length of the segments, longest first",
        "x": "segments",
        "y": "m",
        "values": [round(float(one), 3) for one in np.sort(segment_map.lengths)[::-1]],
        "marked": {},
        "legend": [],
    }


def angle_shapes(
    segment_map: SegmentMap, pair: tuple[int, int], name: str, pose: Pose2 | None = None, vertex: bool = True
) -> list[Shape]:
    """The two segments of an angle, and their lines prolonged to where they meet."""
    shapes = [of(name, "accent", pair, pose, width=4)]
    corner = meeting(segment_map, pair) if vertex else None
    if corner is None:
        return shapes
    move = pose or Pose2.identity()
    for row in pair:
        ends = segment_map.coordinates[row].reshape(2, 2)
        nearest = ends[int(np.argmin(np.hypot(*(ends - corner).T)))]
        shapes.append(path(move @ np.stack((nearest, corner)), "accent", dash=True, width=1.2))
    return [*shapes, {"kind": "points", "at": [[*np.round(move @ corner, 4).tolist()]], "role": "accent", "size": 7}]


def meeting(segment_map: SegmentMap, pair: tuple[int, int]) -> FloatArray | None:
    """Where the lines of two segments meet; None where they are parallel."""
    found = angles(segment_map, np.array([pair]), Parameters(min_vertex_angle=0.0))
    return found.vertices[0] if len(found) else None


# --- draws (Algorithm 3) ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Draw:
    round: Event
    event: Event
    row: int


def draws_stage(trace: Trace, maps: tuple[SegmentMap, SegmentMap], parameters: Parameters) -> list[Stage]:
    """Draw by draw, lucky or in vain, and why; none where nothing was drawn."""
    draws, rounds = trace.all("draws"), [e for e in trace.all("round") if min(map(len, e["choices"])) >= 2]
    if not draws:
        return []
    starts = np.cumsum([0, *(len(event["keep"]) for event in draws)])
    lucky = np.flatnonzero(np.concatenate([event["keep"] for event in draws]))

    def step(k: int) -> Step:
        number = int(np.searchsorted(starts, k, side="right")) - 1
        return _draw_step(_Draw(rounds[number], draws[number], k - int(starts[number])), maps, parameters)

    marks = [Mark(int(start), f"round {e['k']}") for start, e in zip(starts, rounds, strict=False)]
    stage = Stage(
        id="draws",
        title="Angles drawn by lot",
        about="Two segments of each map are drawn by lot, from the longest ones in the first round and from ever"
        " shorter ones later: long segments tell more of the building, so they get more chances.",
        algorithm="3",
        count=int(starts[-1]),
        step=step,
        marks=(*marks, *(Mark(int(k), "the first lucky draw") for k in lucky[:1])),
        stops=[0, *lucky.tolist()],
        box=around(maps[0].coordinates),
    )
    return [stage]


def _draw_step(draw: _Draw, maps: tuple[SegmentMap, SegmentMap], parameters: Parameters) -> Step:
    k, share, row = draw.round["k"], draw.round["share"], draw.row
    pairs = [draw.event[name][0][row].tolist() for name in ("drawn_1", "drawn_2")]
    headings = [draw.event[name][1][row] for name in ("drawn_1", "drawn_2")]
    sizes = [float(wrap(float(one[1] - one[0]))) for one in headings]
    flat = [which for which in (1, 2) if not draw.event["meet"][which - 1][row]]
    told = (degrees("angle of map 1", sizes[0]), degrees("angle of map 2", sizes[1]))
    off = degrees("difference", abs(float(wrap(sizes[0] - sizes[1]))))
    tolerance = degrees("tolerance", parameters.angle_difference_tolerance)
    if flat:
        line, why = "10", f"the two segments of map {flat[0]} are nearly parallel, so they form no angle."
    elif draw.event["keep"][row]:
        line, why = "9", "the two angles are equal, so this draw gives a candidate."
    else:
        line, why = "10", "the two angles differ by too much."
    say = (
        f"Round {k} draws from the {len(draw.round['choices'][0])} and {len(draw.round['choices'][1])} segments longer"
        f" than {share:.3f} times the longest. Segments {pairs[0][0]} and {pairs[0][1]} of map 1, {pairs[1][0]} and"
        f" {pairs[1][1]} of map 2: {why}"
    )
    shapes = [of("first", "faint"), of("first", "accent", pairs[0], width=4)]
    shapes += [of("second", "faint"), of("second", "second", pairs[1], width=4)]
    return Step(line, say, tuple(shapes), (*told, off, tolerance), box=around(*(m.coordinates for m in maps)))


# --- candidates -------------------------------------------------------------------------------------


def candidates_stage(found: Found) -> Stage:
    """Candidate by candidate: which two angles, and how one is laid on the other."""
    marks = [Mark(0, "the idea")]
    if found.best is not None:
        marks.append(Mark(found.best + 1, "the candidate that turns out best"))
    return Stage(
        id="candidates",
        title="Candidates",
        about=f"A candidate is a guess at how map 2 lies on map 1: a turn and a shift. {_rounds(found)}",
        algorithm="laid" if found.laid(0) else "3" if found.draws else "2",
        count=len(found) + 1,
        step=lambda k: _candidates_idea(found) if k == 0 else _candidate_step(found, k - 1),
        marks=tuple(marks),
        stops=found.spread(),
        box=found.box,
    )


PLACED = (
    "start on start",
    "end on end",
    "middle on middle",
    "start on end, turned round",
    "end on start, turned round",
    "middle on middle, turned round",
)
"""how one segment lies on another, by the number of its block"""


def _rounds(found: Found) -> str:
    """What gives the candidates."""
    equal = math.degrees(found.parameters.angle_difference_tolerance)
    angles_give = f"two angles, one of each map, that are equal within {equal:.1f}° give one."
    if not len(found) or not found.laid(0):
        return angles_give.capitalize()
    laid = (
        "each pair of segments, one of each map, gives three: start on start, end on end, middle on middle"
        f"{', and three more with map 2 turned round' if found.placed.max() > 2 else ''}."
    )
    if found.placed.min() >= 0:
        return laid.capitalize()
    return f"First round: {laid} It was not clear yet which is right, so there is a second round: {angles_give}"


def _candidates_idea(found: Found) -> Step:
    if found.laid(0):
        idea = "If a segment of map 2 is the same wall as a segment of map 1, laying one on the other lays all of map 2"
    else:
        idea = (
            "If an angle of map 2 is the same corner of the building as an angle of map 1, laying one on the other lays"
        )
        idea += " all of map 2"
    said = (
        f"Map 1 is blue, map 2 orange; nobody knows how they belong together. {idea} right. There are {len(found)} such"
        " guesses, the candidates."
    )
    told = (("candidates", str(len(found)), ""), ("poses found twice and left out", str(found.twice), ""))
    tolerance = degrees("tolerance of angles", found.parameters.angle_difference_tolerance)
    shapes = (of("first", "first", width=2.5), of("second", "second", width=2.5))
    return Step("1" if found.laid(0) else "10", said, shapes, (*told, tolerance))


def _candidate_step(found: Found, k: int) -> Step:
    T_1_2, (pair_1, pair_2) = found.pose(k), found.pairs(k)
    shapes = [of("first", "first"), of("second", "second", pose=T_1_2)]
    pose = (metres("x", T_1_2.x), metres("y", T_1_2.y), degrees("turn", T_1_2.theta))
    if found.laid(k):
        say = (
            f"Candidate {k + 1} of {len(found)}: segment {pair_2[0]} of map 2 is laid on segment {pair_1[0]} of map 1,"
            f" {PLACED[int(found.placed[k])]}. No angle is needed, so even a corridor gives candidates."
        )
        shapes += [of("first", "accent", pair_1[:1], width=5), of("second", "good", pair_2[:1], T_1_2, width=2.5)]
        return Step("3", say, tuple(shapes), pose)
    size_1, size_2 = (float(wrap(size)) for size in found.sizes(k))
    second = " (second round)" if found.laid(0) else ""
    shapes += angle_shapes(found.map_1, pair_1, "first")
    shapes += [of("second", "good", pair_2, T_1_2, width=3)]
    say = (
        f"Candidate {k + 1} of {len(found)}{second}: the angle between segments {pair_2[0]} and {pair_2[1]} of map 2"
        f" (green) is laid on the angle between {pair_1[0]} and {pair_1[1]} of map 1 (marked). Vertex comes to lie on"
        " vertex; if the angles differ a little, half of the difference goes to each side. Does the rest of"
        " orange fall on blue?"
    )
    off = degrees("they differ by", abs(float(wrap(size_1 - size_2))))
    told = (degrees("angle of map 1", size_1), degrees("angle of map 2", size_2), off, *pose)
    line = "9" if found.draws else "4" if found.laid(0) else "12"
    return Step(line, say, tuple(shapes), told)
