"""Chains that grow, and polylines P0, P1, ... (Sections III-B and III-C, Algorithm 5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segmap import tracing
from segmap.chains import components
from segmap.evaluation import LEAST_MATCH
from segmap.fusion import Polyline, polyline
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
    lines,
    metres,
    of,
    path,
)

__all__ = ["chains_stage", "polylines_stage"]

RISEN = 5e-4
"""metres; a smaller rise is not to be seen in the numbers"""
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
        about="Map 2 lies where the winning candidate puts it. Two segments match if their matching value is above"
        f" {f'{LEAST_MATCH:g}'.replace('-0', '-')} m. A chain is everything that hangs together by matching: if segment"
        " a of one map matches b of the other, and b matches c as well, then a, b and c are one wall, or walls that"
        " join. Each chain becomes one polyline.",
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
        touched = [bool((self.pairs[:k, side] == row).any()) for side, row in ((0, i), (1, j))]
        joined = len(before) - len(set(labels.tolist()))
        pair = f"Segment {i} of map 1 matches segment {j} of map 2"
        if not any(touched):
            line, say = "28", f"{pair}; neither is in a chain yet, so a new chain begins."
        elif joined > 0:
            line, say = "26", f"{pair}; they belong to two chains so far, and the pair makes these one."
        elif all(touched):
            line, say = "26", f"{pair}; both are in the same chain already, and the pair joins it."
        else:
            line, say = "26", f"{pair}; one of them is in a chain already, so the pair joins that chain."
        shapes = [*self._coloured(k + 1, labels), of("first", "accent", [i], width=6)]
        shapes += [of("second", "accent", [j], self.T_1_2, width=6)]
        return Step(line, say, tuple(shapes), self._counts(k + 1, labels))

    def _all(self) -> Step:
        labels = components(self.pairs, *self.sizes)
        count = len(set(labels.tolist()))
        say = (
            f"{len(self.pairs)} matching pair{'s' * (len(self.pairs) != 1)} make"
            f" {count} chain{'s' * (count != 1)}, each in its colour: each is one wall, or walls that"
            " join, seen by both maps. Grey segments match nothing and will stay as they are."
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
    earlier: Event | None = None
    """the state before, of the same variant"""


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
        about="The segments of a chain are the same wall, or walls that join, seen twice and not quite alike. A"
        " polyline takes their place: it begins as one line and is bent through the segment that lies farthest from it."
        f" P0, P1, ... are its states. It is done when no segment lies farther than {parameters.fusion_tolerance:g} m."
        " The greedy way uses each segment once, so it also ends when every segment that is still far was used. The"
        f" plain way uses them again and again, until it is stopped after {parameters.fusion_bound} detours for each"
        f" segment. Here {parameters.fusion_variant} goes into the fused map; the other is for comparison only.",
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
        self.members, self.tolerance, self.parameters = members, parameters.fusion_tolerance, parameters
        self.lines: dict[tuple[int, str], Polyline] = {}
        self.states: list[_Growth] = []
        for chain, one in enumerate(members):
            for variant in ("greedy", "plain"):
                with tracing.recording() as trace:
                    line = polyline(one, parameters.replace(fusion_variant=variant))
                self.lines[chain, variant] = line
                grown = _first_run(trace)[:MOST_ROUNDS]
                earlier = [None, *grown[:-1]]
                self.states += [_Growth(chain, variant, n, one, event, earlier[n]) for n, event in enumerate(grown)]
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
        s, vertices, n = int(event["farthest"]), event["vertices"], state.n
        edge, on = int(event["edges"][s]), bool(event["waiting"][s]) and _waiting(event) > self.tolerance
        far = _waiting if on else _largest
        distance = far(event)
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
                f" {self.tolerance:.3f} m{self._next(state)}."
            )
        else:
            line, say = "12", f"{name} is done: {self._why_done(event)}. {self._use(state)}"
        if state.earlier is not None and distance > far(state.earlier) + RISEN:
            say += (
                " The largest distance has risen: the detour took an edge away, and a segment that lay near that edge"
                " now has a farther one as its closest."
            )
        told = (metres("farthest segment from its edge", distance), metres("fusion_tolerance", self.tolerance))
        counts = (("n", str(n), ""), ("vertices", str(len(vertices)), ""))
        return Step(line, say, tuple(shapes), (*told, *counts), box=self._box(state))

    def _next(self, state: _Growth) -> str:
        bound = self.parameters.fusion_bound * len(state.members)
        if state.variant == "plain" and state.n == bound:
            return (
                f". It has been bent {bound} times, {self.parameters.fusion_bound} for each segment: here plain is"
                " stopped, unfinished"
            )
        more = "; the further rounds are not shown" if state.n == MOST_ROUNDS - 1 else ""
        return f": the next polyline takes a detour through it{more}"

    def _why_done(self, event: Event) -> str:
        distance = _largest(event)
        if distance <= self.tolerance:
            return f"no segment lies farther than {self.tolerance:.3f} m from it"
        return (
            f"every segment that lies farther than {self.tolerance:.3f} m from it was used already. The farthest still"
            f" lies {distance:.3f} m from its closest edge"
        )

    def _use(self, state: _Growth) -> str:
        if state.variant == self.parameters.fusion_variant:
            return f"It takes the place of {len(state.members)} segments in the fused map."
        return f"It is for comparison only: {self.parameters.fusion_variant} goes into the fused map."

    def _compared(self, state: _Growth) -> Step:
        greedy, plain = self.lines[state.chain, "greedy"], self.lines[state.chain, "plain"]
        shapes = (*self._chain(state), path(plain.vertices, "bad", width=2, dash=True), path(greedy.vertices, "new"))
        same = np.array_equal(greedy.vertices, plain.vertices)
        greedy_said = f"Greedy (solid) used each segment at most once: {len(greedy.vertices)} vertices."
        if not plain.finished:
            bound = self.parameters.fusion_bound * len(state.members)
            said = (
                f"{greedy_said} Plain came to no end and was stopped at P{bound}. What counts for plain then, and is"
                " drawn dashed, is greedy's polyline with a spur to each segment that is still too far:"
                f" {len(plain.vertices)} vertices."
            )
        elif same:
            said = "Both variants end with the same polyline here."
        else:
            said = f"{greedy_said} Plain (dashed) used them again and again: {len(plain.vertices)} vertices."
        used = f" {self.parameters.fusion_variant.capitalize()} goes into the fused map."
        told = (("vertices, greedy", str(len(greedy.vertices)), ""), ("vertices, plain", str(len(plain.vertices)), ""))
        say = f"Chain {state.chain + 1}, greedy against plain. {said}{used}"
        return Step("12", say, shapes, told, box=self._box(state))

    def _chain(self, state: _Growth) -> list[Shape]:
        rows, first = state.members.coordinates, self._firsts[state.chain]
        return [lines(rows[:first], "first", width=3), lines(rows[first:], "second", width=3)]

    def _box(self, state: _Growth) -> Box | None:
        return around(state.members.coordinates, margin=0.12, least=0.15)


def _waiting(event: Event) -> float:
    """How far the farthest of the segments lies that may still bend the polyline, metres."""
    return float(np.sqrt(event["squares"][int(event["farthest"])]))


def _largest(event: Event) -> float:
    """How far the farthest of all segments lies, metres."""
    return float(np.sqrt(event["squares"].max()))


def _first_run(trace: Trace) -> list[Event]:
    """The polylines of one variant: the plain one, where it meets its bound, asks for the greedy one as well."""
    places = [place for place, event in enumerate(trace.events) if event.what == "chain"]
    until = places[1] if len(places) > 1 else len(trace.events)
    return [event for event in trace.events[:until] if event.what == "polyline"]
