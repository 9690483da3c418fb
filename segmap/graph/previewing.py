"""What accepting an edge would do, before it is accepted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from segmap.graph.edges import Edge
from segmap.graph.optimised import HALF, Optimised, Part, Residual
from segmap.graph.optimising import GATE, optimise
from segmap.graph.ways import Loop, loop_of
from segmap.graph.words import described_loop, in_words
from segmap.pose import wrap
from segmap.scans import ScanId

__all__ = ["Preview", "Shift", "preview"]

STILL = 5e-3
"""metres, radians; a scan that moves less stays"""
NAMED = 3
"""contradicted edges that are named"""


@dataclass(frozen=True)
class Shift:
    """How far one scan would move, as seen from the first scan of its present component."""

    scan: ScanId
    translation: float
    """metres"""
    rotation: float
    """radians, in [0, pi]"""


@dataclass(frozen=True)
class Preview:
    """The effect of one more edge."""

    candidate: Edge
    joins: bool
    """whether it joins what was apart: two components, or a scan that no edge held"""
    expected: Residual | None
    """where the present graph has it: how far off it is, ``chi`` with the uncertainty of both; None where it joins"""
    silenced: bool
    """whether the optimiser would silence it"""
    shifts: tuple[Shift, ...]
    """of every scan that moves, if the candidate is believed, the farthest first"""
    contradicts: tuple[Residual, ...]
    """accepted edges that would be silenced if the candidate is believed, and are not now; the worst first"""
    loop: Loop | None
    """that it closes; None where it joins"""
    after: Optimised
    """the graph with the candidate believed"""

    def sentences(self) -> tuple[str, ...]:
        """The effect in words."""
        return tuple(_sentences(self))


def preview(
    edges: Sequence[Edge],
    candidate: Edge,
    before: Optimised | None = None,
    *,
    gate: float = GATE,
    most: float = math.inf,
    check: Callable[[], None] | None = None,
) -> Preview:
    """What would come of accepting ``candidate`` beside the accepted ``edges``.

    ``before`` is the present graph, or an earlier one under the same settings: components that hold the same edges
    are taken from it.
    """
    solve = partial(optimise, gate=gate, most=most, check=check)
    before = solve(edges, known=before)
    within = _together(candidate, before)
    initial = within.poses if within else None

    def with_it(*, trusted: bool) -> Optimised:
        return solve([*edges, replace(candidate, trusted=trusted)], initial, known=before)

    after = with_it(trusted=True)
    certain = initial is None or _agreed(after)
    weight = 1.0 if certain else with_it(trusted=False).residuals[-1].weight
    expected = _expected(candidate, before, weight)
    now_silent = zip(before.residuals, after.residuals[:-1], strict=True)
    contradicts = [new for old, new in now_silent if new.silenced and not old.silenced]
    return Preview(
        candidate=candidate,
        joins=expected is None,
        expected=expected,
        silenced=weight < HALF,
        shifts=tuple(_shifts(before, after)),
        contradicts=tuple(sorted(contradicts, key=lambda residual: -residual.chi)),
        loop=loop_of(candidate, within.ways) if within else None,
        after=after,
    )


def _together(candidate: Edge, before: Optimised) -> Part | None:
    """The component that holds both scans; None where the candidate joins what was apart."""
    part = before.part_of(candidate.first)
    return part if part is not None and candidate.second in part.poses else None


def _agreed(after: Optimised) -> bool:
    """Whether the optimiser would not silence the last edge, as nothing in its component contradicts anything.

    Then it finds the same where the edge is not trusted: all edges count from the beginning.
    """
    last = after.residuals[-1]
    part = after.part_of(last.edge.first)
    all_count = part is not None and part.agreed and all(one.weight == 1.0 for one in part.residuals)
    return all_count and last.translation <= after.most


def _expected(candidate: Edge, before: Optimised, weight: float) -> Residual | None:
    """How far the candidate is from where the graph has its second scan, and how sure both are of that."""
    if _together(candidate, before) is None:
        return None
    T_1_2 = before.poses[candidate.first].inverse() @ before.poses[candidate.second]
    left = np.array(tuple(candidate.T_1_2)) - tuple(T_1_2)
    left[2] = wrap(left[2])
    covariance = before.covariance(candidate.second, candidate.first) + np.array(candidate.covariance)
    chi = math.sqrt(float(left @ np.linalg.solve(covariance, left)))
    return Residual(candidate, math.hypot(left[0], left[1]), abs(float(left[2])), chi, weight)


def _shifts(before: Optimised, after: Optimised) -> list[Shift]:
    shifts = []
    for part in before.parts:
        if after.part_of(part.scans[0]) is part:
            continue
        back = after.poses[part.scans[0]].inverse()
        for scan in part.scans:
            moved = (back @ after.poses[scan]).distance(before.poses[scan])
            shifts.append(Shift(scan, *moved))
    moving = [shift for shift in shifts if shift.translation >= STILL or shift.rotation >= STILL]
    return sorted(moving, key=lambda shift: (-shift.translation, -shift.rotation, shift.scan))


def _sentences(shown: Preview) -> Iterator[str]:
    yield _agreement(shown)
    yield _motion(shown.shifts)
    if shown.contradicts:
        yield f"Accepting it silences what was accepted before: {_named(shown.contradicts)}."
    if shown.loop is not None:
        yield described_loop(shown.loop)
    if shown.silenced:
        yield f"The optimiser would silence {shown.candidate.name} itself."


def _motion(shifts: Sequence[Shift]) -> str:
    if not shifts:
        return "Accepting it moves no scan."
    most, count = shifts[0], f"{len(shifts)} scans" if len(shifts) > 1 else "1 scan"
    return f"Accepting it moves {count}, scan {most.scan} the farthest: {in_words(most.translation, most.rotation)}."


def _named(residuals: Sequence[Residual]) -> str:
    names, more = [residual.edge.name for residual in residuals[:NAMED]], len(residuals) - NAMED
    return ", ".join(names) + (f" and {more} more" if more > 0 else "")


def _agreement(shown: Preview) -> str:
    name, expected = shown.candidate.name, shown.expected
    if expected is None:
        return f"{name} joins what was apart: nothing checks it."
    off = in_words(expected.translation, expected.rotation)
    return f"{name} is {off} from where the graph has it: {expected.chi:.1f} standard deviations."
