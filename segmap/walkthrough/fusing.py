"""Chains that grow, polylines P0, P1, ..., the fused map and the verdict (Sections III-B and III-C, Algorithm 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segmap import tracing
from segmap.chains import MatchingChain, components
from segmap.fusion import Fusion, Polyline, polyline, spurious_length, spurious_stretches
from segmap.matches import Match
from segmap.parameters import Parameters
from segmap.pose import FloatArray, IntArray, Pose2
from segmap.segments import SegmentMap
from segmap.tracing import Event, Trace
from segmap.walkthrough.steps import (
    CHAINS,
    Box,
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
    path,
)

__all__ = ["chains_stage", "polylines_stage", "result_stage"]

MOST_ROUNDS = 60
"""steps of one polyline of the plain variant that are shown; it may go round in circles for long"""


# --- chains -----------------------------------------------------------------------------------------


def chains_stage(trace: Trace, maps: tuple[SegmentMap, SegmentMap], box: Box | None) -> list[Stage]:
    """Pair by pair, how matching segments hang together; none where nothing matches."""
    event = trace.last("chains")
    if event is None or not len(event["pairs"]):
        return []
    held = _Chains(event, maps)
    stage = Stage(
        id="chains",
        title="Chains",
        about="Under the best candidate some segments match. A chain is everything that hangs together by matching: if"
        " segment a of one map matches b of the other, and b matches c as well, then a, b and c are one wall. Each"
        " chain becomes one polyline.",
        algorithm="4",
        count=len(held.pairs) + 1,
        step=held.step,
        marks=(Mark(0, "the first pair"), Mark(len(held.pairs), "all chains")),
        box=box,
    )
    return [stage]


class _Chains:
    def __init__(self, event: Event, maps: tuple[SegmentMap, SegmentMap]) -> None:
        self.pairs: IntArray = event["pairs"]
        self.values: FloatArray = event["values"]
        self.T_1_2: Pose2 = event["T_1_2"]
        self.sizes = len(maps[0]), len(maps[1])

    def step(self, k: int) -> Step:
        """After k + 1 pairs; at the end, all."""
        if k == len(self.pairs):
            return self._all()
        (i, j), labels = self.pairs[k].tolist(), components(self.pairs[: k + 1], *self.sizes)
        before = set(components(self.pairs[:k], *self.sizes).tolist()) if k else set()
        touched = {p for p in range(k) if self.pairs[p, 0] == i or self.pairs[p, 1] == j}
        joined = len(before) - len(set(labels.tolist()))
        pair = f"Segment {i} of map 1 matches segment {j} of map 2"
        if not touched:
            line, say = "28", f"{pair}; neither is in a chain yet, so a new chain begins."
        elif joined > 0:
            line, say = "26", f"{pair}; they belong to two chains so far, which become one."
        else:
            line, say = "26", f"{pair}; one of them is in a chain already, so the pair joins that chain."
        shapes = [*self._coloured(k + 1, labels), of("first", "accent", [i], width=6)]
        shapes += [of("second", "accent", [j], self.T_1_2, width=6)]
        return Step(line, say, tuple(shapes), self._counts(k + 1, labels))

    def _all(self) -> Step:
        labels = components(self.pairs, *self.sizes)
        count = len(set(labels.tolist()))
        say = (
            f"{len(self.pairs)} matching pairs make {count} chains, each in its colour: each is one wall, or one row of"
            " walls, that both maps have seen. Grey segments match nothing and will stay as they are."
        )
        return Step("30", say, tuple(self._coloured(len(self.pairs), labels)), self._counts(len(self.pairs), labels))

    def _coloured(self, count: int, labels: IntArray) -> list[Shape]:
        shapes = [of("first", "faint"), of("second", "faint", pose=self.T_1_2)]
        for place, label in enumerate(dict.fromkeys(labels.tolist())):
            role, rows = f"chain-{place % CHAINS}", self.pairs[:count][labels == label]
            shapes.append(of("first", role, sorted(set(rows[:, 0].tolist())), width=3.5))
            shapes.append(of("second", role, sorted(set(rows[:, 1].tolist())), self.T_1_2, width=3.5))
        return shapes

    def _counts(self, count: int, labels: IntArray) -> tuple[Quantity, ...]:
        value = metres("value of the pairs so far", float(self.values[:count].sum()))
        return ("pairs so far", str(count), ""), ("chains so far", str(len(set(labels.tolist()))), ""), value


# --- polylines --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Growth:
    """One state of the polyline of one chain."""

    chain: int
    variant: str
    n: int
    members: SegmentMap
    event: Event | None
    """None: both variants beside each other"""


def polylines_stage(trace: Trace, parameters: Parameters) -> list[Stage]:
    """P0, P1, ... of every chain, greedy and plain, and the two compared; none where there is no chain."""
    all_members = _members(trace)
    fused = trace.last("fused")
    firsts_of = [len(chain.first) for chain in fused["chains"]] if fused else []
    held = _Polylines(all_members, firsts_of, parameters)
    if not held.states:
        return []
    largest = max(range(len(all_members)), key=lambda c: len(all_members[c]))
    firsts = [k for k, state in enumerate(held.states) if state.chain == largest]
    compared = next(k for k in (*held.differing(), *firsts) if held.states[k].event is None)
    stage = Stage(
        id="polylines",
        title="A polyline for each chain",
        about="The segments of a chain are the same wall seen twice, not quite alike. A polyline takes their place: it"
        " begins as one line and is bent through the segment that lies farthest from it, until none lies far. P0, P1,"
        " ... are its states. The greedy way lets each segment bend it once, the plain way again and again.",
        algorithm="5",
        count=len(held.states),
        step=held.step,
        marks=(Mark(0, "P0 of chain 1"), Mark(firsts[0], "the largest chain"), Mark(compared, "greedy against plain")),
        figure="Figs. 4 and 5",
    )
    return [stage]


def _members(trace: Trace) -> list[SegmentMap]:
    """The segments of each chain: the plain variant may have told of one chain twice."""
    found: list[SegmentMap] = []
    for event in trace.all("chain"):
        if not any(event["members"] is one for one in found):
            found.append(event["members"])
    return found


class _Polylines:
    def __init__(self, members: Sequence[SegmentMap], firsts: Sequence[int], parameters: Parameters) -> None:
        self._firsts = firsts
        self.members, self.tolerance = members, parameters.fusion_tolerance
        self.lines: dict[tuple[int, str], Polyline] = {}
        self.states: list[_Growth] = []
        for chain, one in enumerate(members):
            for variant in ("greedy", "plain"):
                with tracing.recording() as trace:
                    line = polyline(one, parameters.replace(fusion_variant=variant))
                self.lines[chain, variant] = line
                grown = _first_run(trace)[:MOST_ROUNDS]
                self.states += [_Growth(chain, variant, n, one, event) for n, event in enumerate(grown)]
            self.states.append(_Growth(chain, "both", 0, one, None))

    def differing(self) -> list[int]:
        """The comparisons of chains of which the two variants make different polylines."""
        pairs = [(self.lines[c, "greedy"].vertices, self.lines[c, "plain"].vertices) for c in range(len(self.members))]
        apart = {c for c, (greedy, plain) in enumerate(pairs) if not np.array_equal(greedy, plain)}
        return [k for k, state in enumerate(self.states) if state.event is None and state.chain in apart]

    def step(self, k: int) -> Step:
        """One state."""
        state = self.states[k]
        return self._compared(state) if state.event is None else self._grown(state, state.event)

    def _grown(self, state: _Growth, event: Event) -> Step:
        s, squares = int(event["farthest"]), event["squares"]
        distance, edge = float(np.sqrt(squares[s])), int(event["edges"][s])
        vertices, n = event["vertices"], state.n
        waiting = bool(event["waiting"][s])
        on = waiting and distance > self.tolerance
        shapes = [*self._chain(state), path(vertices, "new", width=3)]
        if on:
            shapes += [lines(state.members.coordinates[s], "accent", width=5)]
            shapes += [lines(np.concatenate((vertices[edge], vertices[edge + 1])), "good", width=2, dash=True)]
        shapes += [{"kind": "points", "at": np.round(vertices, 4).tolist(), "role": "new", "size": 6}]
        name = f"Chain {state.chain + 1}, {state.variant}, P{n}"
        if on:
            line = "4" if n == 0 else "10"
            say = (
                f"{name}: the marked segment lies {distance:.3f} m from its closest edge (dashed), more than"
                f" {self.tolerance:.3f} m: the next polyline takes a detour through it."
            )
        else:
            line = "12"
            why = (
                "every segment has had its turn"
                if not waiting
                else f"no segment lies farther than {self.tolerance:.3f} m from it"
            )
            say = f"{name} is done: {why}. It takes the place of {len(state.members)} segments in the fused map."
        told = (metres("farthest segment from its edge", distance), metres("fusion_tolerance", self.tolerance))
        counts = (("n", str(n), ""), ("vertices", str(len(vertices)), ""))
        return Step(line, say, tuple(shapes), (*told, *counts), box=self._box(state))

    def _compared(self, state: _Growth) -> Step:
        greedy, plain = self.lines[state.chain, "greedy"], self.lines[state.chain, "plain"]
        shapes = (*self._chain(state), path(plain.vertices, "bad", width=2, dash=True), path(greedy.vertices, "new"))
        same = np.array_equal(greedy.vertices, plain.vertices)
        said = (
            "Both variants end with the same polyline here."
            if same
            else f"Greedy (solid) lets each segment in once: {len(greedy.vertices)} vertices. Plain (dashed) lets it in"
            f" again and again: {len(plain.vertices)} vertices."
        )
        endless = " Plain went round in circles and had to be stopped." if not plain.finished else ""
        told = (("vertices, greedy", str(len(greedy.vertices)), ""), ("vertices, plain", str(len(plain.vertices)), ""))
        say = f"Chain {state.chain + 1}, greedy against plain. {said}{endless}"
        return Step("12", say, shapes, told, box=self._box(state))

    def _chain(self, state: _Growth) -> list[Shape]:
        rows, first = state.members.coordinates, self._firsts[state.chain]
        return [lines(rows[:first], "first", width=3), lines(rows[first:], "second", width=3)]

    def _box(self, state: _Growth) -> Box | None:
        return around(state.members.coordinates, margin=0.12, least=0.15)


def _first_run(trace: Trace) -> list[Event]:
    """The polylines of one variant: the plain one, where it meets its bound, asks for the greedy one as well."""
    places = [place for place, event in enumerate(trace.events) if event.what == "chain"]
    until = places[1] if len(places) > 1 else len(trace.events)
    return [event for event in trace.events[:until] if event.what == "polyline"]


# --- the fused map, and the verdict -----------------------------------------------------------------


def result_stage(
    match: Match,
    fusion: Fusion | None,
    maps: tuple[SegmentMap, SegmentMap],
    parameters: Parameters,
    box: Box | None,
    truth: Pose2 | None = None,
) -> Stage:
    """What stays as it is, what the polylines add, spurious doubles, and the verdict in words."""
    steps = [_unmatched(match, maps), _fused(fusion), _spurious(fusion)] if fusion else []
    steps.append(_verdict(match, fusion, parameters))
    if truth is not None:
        steps.append(_true_place(match, truth, "13" if fusion else "3"))
    marks = (Mark(2, "doubled walls (Fig. 7)"),) if fusion else ()
    return Stage(
        id="result",
        title="The integrated map and the verdict",
        about="Unmatched segments stay, a polyline stands for each chain: the two maps are one. Whether to trust it"
        " depends on its value, and in verified mode on the lines of sight.",
        algorithm="result" if not fusion else "5",
        count=len(steps),
        step=lambda k: steps[k],
        marks=(*marks, Mark(3 if fusion else 0, "the verdict")),
        box=box,
        figure="Fig. 7" if fusion else "",
    )


def _unmatched(match: Match, maps: tuple[SegmentMap, SegmentMap]) -> Step:
    matched = [_of_chains(match.chains, side) for side in (0, 1)]
    rest = [[i for i in range(len(maps[side])) if i not in matched[side]] for side in (0, 1)]
    shapes = (of("first", "first", rest[0], width=2.5), of("second", "second", rest[1], match.T_1_2, width=2.5))
    say = (
        f"{len(rest[0])} segments of map 1 and {len(rest[1])} of map 2 match nothing: only one of the scans saw what"
        " they stand for. They go into the fused map as they are."
    )
    return Step("2", say, shapes, (("unmatched", str(len(rest[0]) + len(rest[1])), ""),))


def _of_chains(chains: Sequence[MatchingChain], side: int) -> set[int]:
    return {row for chain in chains for row in (chain.second if side else chain.first)}


def _fused(fusion: Fusion) -> Step:
    walls = [path(line.vertices, "new", width=4) for line in fusion.polylines]
    shapes = (lines(fusion.map.coordinates, "faint", width=2.5), *walls)
    say = f"{len(fusion.polylines)} polylines take the place of the chains: this is the integrated map."
    return Step("12", say, shapes, (("segments", str(len(fusion.map)), ""), ("polylines", str(len(walls)), "")))


def _spurious(fusion: Fusion) -> Step:
    rows, length = spurious_stretches(fusion.map), spurious_length(fusion.map)
    share = length / float(fusion.map.lengths.sum())
    say = (
        "Marked are stretches of wall that are in the map twice, close beside each other: there two segments of one"
        " wall did not match closely enough to be fused. Each further fusion can add more of them; that is why merging"
        " by a tree, which fuses the same walls again and again, doubles walls."
        if len(rows)
        else "No wall is in this map twice. Where the same walls are fused again and again, as by a tree, they double."
    )
    shapes = (lines(fusion.map.coordinates, "faint", width=2), lines(rows, "bad", width=5))
    return Step("12", say, shapes, (metres("doubled walls", length, 2), ("share", f"{100 * share:.1f}", "%")))


def _true_place(match: Match, truth: Pose2, line: str) -> Step:
    """Where map 2 really is, for samples whose truth is known."""
    shapes = (of("first", "first", width=2.5), of("second", "good", pose=truth, width=2.5))
    found = match.T_1_2
    if found is None:
        return Step(line, "The truth, which only the simulator knows: here map 2 (green) really lies.", shapes)
    off, turned = found.distance(truth)
    say = (
        "The truth, which only the simulator knows: here map 2 (green) really lies. What was found is"
        f" {off:.2f} m and {np.degrees(turned):.1f}° from it."
    )
    told = (metres("off the truth", off, 2), degrees("turned off the truth", turned))
    return Step(line, say, (*shapes, of("second", "faint", pose=found)), told)


def _verdict(match: Match, fusion: Fusion | None, parameters: Parameters) -> Step:
    told: list[Quantity] = [metres("value", match.value), metres("value_threshold", parameters.value_threshold, 2)]
    if match.confidence is not None:
        told.append(("confidence", f"{100.0 * match.confidence:.1f}", "%"))
        told.append(("needed to accept", f"{100.0 * parameters.confidence_accept:.0f}", "%"))
    said = {"accepted": "accepted", "rejected": "rejected", "review": "left to a person"}[str(match.verdict)]
    shapes = [of("first", "first", width=2)]
    if fusion is not None:
        shapes.append(of("second", "second", pose=match.T_1_2, width=2))
    say = f"Verdict: {said}. {' '.join(match.reasons)}"
    return Step("3" if fusion is None else "13", say, tuple(shapes), tuple(told))
