"""The candidates of a recorded run with their values, for random access: step k of 20,000 without the others."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from segmap.candidates import Candidates
from segmap.evaluation import best, evaluate
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2, wrap
from segmap.segments import SegmentMap
from segmap.tracing import Trace
from segmap.walkthrough.steps import Box, around

__all__ = ["Found"]

STOPS = 60
"""stops of a stage with more steps than anybody wants to watch"""
ARM, REACH = 2.0, 0.5
"""metres: what a radian counts as, and how far from the truth a candidate may be to stand for it"""
POINTS = 240
"""points of a chart over all candidates"""


@dataclass(frozen=True, eq=False)
class Found:
    """All candidates of a run, in the order they were found."""

    map_1: SegmentMap
    map_2: SegmentMap
    parameters: Parameters
    held: Candidates
    sizes_1: FloatArray
    """radians; NaN where no angle was superimposed"""
    sizes_2: FloatArray
    placed: IntArray
    """how a single segment is laid on a single one: 0 starts, 1 ends, 2 middles together, 3 to 5 the same turned
    round; -1: angles are superimposed"""
    twice: int
    draws: int
    box: Box | None = field(init=False)

    def __post_init__(self) -> None:
        ends = [self.map_1.coordinates]
        if self.best is not None:
            ends.append(self.map_2.moved(self.pose(self.best)).coordinates)
        object.__setattr__(self, "box", around(*ends))

    @classmethod
    def of(cls, trace: Trace, map_1: SegmentMap, map_2: SegmentMap, parameters: Parameters) -> Found:
        """What a trace holds of them."""
        events = trace.all("candidates")
        held = Candidates.joined([event["block"].take(event["new"]) for event in events])
        sizes = [_sizes(trace, place) for place, event in enumerate(trace.events) if event.what == "candidates"]
        joined = np.concatenate([np.empty((0, 2)), *sizes])
        twice = sum(len(event["block"]) - len(event["new"]) for event in events)
        return cls(map_1, map_2, parameters, held, joined[:, 0], joined[:, 1], _placed(trace), twice, held.draws)

    def __len__(self) -> int:
        return len(self.held)

    def pose(self, k: int) -> Pose2:
        """Candidate k."""
        return Pose2(*self.held.poses[k].tolist())

    def pairs(self, k: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """The two segments of map 1 and the two of map 2 whose angles it superimposes."""
        (a, b), (c, d) = self.held.angles_1[k].tolist(), self.held.angles_2[k].tolist()
        return (a, b), (c, d)

    def laid(self, k: int) -> bool:
        """Whether a single segment was laid on a single one, without an angle."""
        return bool(len(self) and self.held.angles_1[k, 0] == self.held.angles_1[k, 1])

    def sizes(self, k: int) -> tuple[float, float]:
        """The two angles, radians."""
        return float(self.sizes_1[k]), float(self.sizes_2[k])

    @cached_property
    def values(self) -> FloatArray:
        """The value of each, metres; NaN: discarded."""
        if not (len(self) and len(self.map_1) and len(self.map_2)):
            return np.zeros(len(self))
        return evaluate(self.map_1, self.map_2, self.held.poses, self.parameters)

    @cached_property
    def running(self) -> FloatArray:
        """The best value up to each, that one included."""
        return np.maximum.accumulate(np.nan_to_num(self.values, nan=0.0))

    @cached_property
    def improvements(self) -> IntArray:
        """The candidates that were better than all before."""
        before = np.concatenate(([0.0], self.running[:-1]))
        return np.flatnonzero(self.running > before) if len(self) else np.empty(0, np.int64)

    @cached_property
    def best(self) -> int | None:
        """The best candidate by value, the first of equals; None where none has a value."""
        top = best(self.values, 1)
        return int(top[0]) if len(top) else None

    def nearest(self, truth: Pose2) -> int | None:
        """The candidate nearest to a pose among those not discarded; None where none is within reach of refinement."""
        alive = np.flatnonzero(~np.isnan(self.values))
        if not len(alive):
            return None
        apart = self.held.poses[alive] - np.array(tuple(truth))
        far = np.hypot(apart[:, 0], apart[:, 1]) + ARM * np.abs(wrap(apart[:, 2]))
        return int(alive[np.argmin(far)]) if far.min() < REACH else None

    @cached_property
    def discarded(self) -> IntArray:
        """The candidates that crossing segments discard."""
        return np.flatnonzero(np.isnan(self.values))

    def spread(self) -> list[int]:
        """Steps to stop at in a stage with the idea and then every candidate: some evenly, and the notable ones."""
        if len(self) <= STOPS:
            return []
        even = np.linspace(1, len(self), STOPS).astype(int).tolist()
        notable = [0, *(self.improvements[-12:] + 1).tolist(), *(self.discarded[:3] + 1).tolist()]
        return sorted({*even, *notable, *([] if self.best is None else [self.best + 1])})

    def chart(self) -> dict[str, object]:
        """Best value so far over all candidates."""
        rows = np.unique(np.concatenate((np.linspace(0, max(0, len(self) - 1), POINTS), self.improvements)).astype(int))
        rows = rows[rows < len(self)]
        steps = [[int(k) + 1, round(float(self.running[k]), 3)] for k in rows]
        return {"kind": "series", "title": "Best value so far", "x": "candidates tried", "y": "m", "values": steps}


def _placed(trace: Trace) -> IntArray:
    """How each candidate is laid: the heuristic ``extremes`` gives a block for each way."""
    name, block, found = "", 0, [np.empty(0, np.int64)]
    for event in trace.events:
        if event.what == "heuristic":
            name, block = event["name"], 0
        elif event.what == "candidates":
            found.append(np.full(len(event["new"]), block if name == "extremes" else -1))
            block += 1
    return np.concatenate(found)


def _sizes(trace: Trace, place: int) -> FloatArray:
    """The two angles of each candidate that an event told of, (k, 2)."""
    event = trace.events[place]
    new, count = event["new"], len(event["block"])
    before = trace.events[place - 1] if place else event
    if before.what == "equal":
        both = before["angles_1"].sizes[before["rows_1"]], before["angles_2"].sizes[before["rows_2"]]
    elif before.what == "draws":
        both = tuple(np.diff(before[name][1][before["keep"]])[:, 0] for name in ("drawn_1", "drawn_2"))
    else:
        both = (np.full(count, np.nan),) * 2
    return np.column_stack(both)[new]
