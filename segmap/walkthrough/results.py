"""The fused map, what of it is doubled, and the verdict in words (Section III-C, Algorithms 1 and 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from segmap.chains import MatchingChain
from segmap.fusion import Fusion, spurious_length, spurious_stretches
from segmap.matches import Candidate, Match
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.segments import SegmentMap
from segmap.walkthrough.found import Found
from segmap.walkthrough.steps import Mark, Quantity, Stage, Step, degrees, lines, metres, of, path

__all__ = ["result_stage"]

SUMMED = "are seen by both"
"""words of the reason that sums up the lines of sight; here each kind is told by itself"""


def result_stage(match: Match, fusion: Fusion | None, found: Found, truth: Pose2 | None = None) -> Stage:
    """What stays as it is, what the polylines add, spurious doubles, and the verdict in words."""
    steps = [_unmatched(match, (found.map_1, found.map_2)), _fused(fusion), _spurious(fusion)] if fusion else []
    steps.append(_verdict(match, fusion, found))
    if truth is not None:
        steps.append(_true_place(match, truth, "13" if fusion else "3"))
    marks = (Mark(2, "doubled walls (Fig. 7)"),) if fusion else ()
    return Stage(
        id="result",
        title="The integrated map and the verdict",
        about="Unmatched segments stay, a polyline stands for each chain: the two maps are one. Whether to trust it"
        f" depends on {_trusted_by(match, found.parameters)}.",
        algorithm="result" if not fusion else "5",
        count=len(steps),
        step=lambda k: steps[k],
        marks=(*marks, Mark(3 if fusion else 0, "the verdict")),
        box=found.box,
        figure="Fig. 7" if fusion else "",
    )


def _unmatched(match: Match, maps: tuple[SegmentMap, SegmentMap]) -> Step:
    matched = [_of_chains(match.chains, side) for side in (0, 1)]
    rest = [[i for i in range(len(maps[side])) if i not in matched[side]] for side in (0, 1)]
    shapes = (of("first", "first", rest[0], width=2.5), of("second", "second", rest[1], match.T_1_2, width=2.5))
    say = (
        f"{len(rest[0])} segments of map 1 and {len(rest[1])} of map 2 match nothing: only one of the scans saw what"
        " they stand for, or they lie too far from each other. They go into the fused map as they are."
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
        " wall did not match closely enough to be fused. Each further fusion of the same walls can add more of"
        " them."
        if len(rows)
        else "No wall is in this map twice. Where the same walls are fused again and again, they can double."
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


def _trusted_by(match: Match, parameters: Parameters) -> str:
    if _calibrated(match, parameters):
        return "a confidence drawn from the lines of sight and the rivals, and its value has to be above a threshold"
    return "its value"


def _calibrated(match: Match, parameters: Parameters) -> bool:
    """Whether the confidence takes part in the verdict."""
    best = match.best
    return best is not None and best.evidence is not None and match.confidence is not None and parameters.use_confidence


def _verdict(match: Match, fusion: Fusion | None, found: Found) -> Step:
    parameters, best = found.parameters, match.best
    told: list[Quantity] = [metres("value", match.value), metres("value_threshold", parameters.value_threshold, 2)]
    if best is not None and best.score is not None:
        told.append(metres("score", best.score))
    if match.confidence is not None:
        told.append(("confidence", f"{100.0 * match.confidence:.1f}", "%"))
        told.append(("needed to accept", f"{100.0 * parameters.confidence_accept:g}", "%"))
        told.append(("rejected below", f"{100.0 * parameters.confidence_review:g}", "%"))
    said = {"accepted": "accepted", "rejected": "rejected", "review": "left to a person"}[str(match.verdict)]
    shapes = [of("first", "first", width=2)]
    if fusion is not None:
        shapes.append(of("second", "second", pose=match.T_1_2, width=2))
    reasons = [one for one in match.reasons if best is None or best.evidence is None or SUMMED not in one]
    more = [_meaning(match, parameters), _origin(best, found), _seen(best)]
    say = " ".join([f"Verdict: {said}.", *reasons, *filter(None, more)])
    return Step("3" if fusion is None else "13", say, tuple(shapes), tuple(told))


def _meaning(match: Match, parameters: Parameters) -> str:
    """What a confidence is, and what it decides."""
    if not _calibrated(match, parameters):
        return ""
    accept, review = 100.0 * parameters.confidence_accept, 100.0 * parameters.confidence_review
    return (
        "Confidence is a calibrated estimate of the probability that the pose is right within 0.25 m and 5°. Below"
        f" {review:g} % an integration is rejected; at {accept:g} % and above it is accepted if nothing else speaks"
        " against it; otherwise a person decides, unless the value is too low."
    )


def _origin(best: Candidate | None, found: Found) -> str:
    """Which candidate a refined winner comes from, and what refinement made of its value."""
    if best is None or best.score is None:
        return ""
    k, before = best.index, float(found.values[best.index])
    moved, turned = found.pose(k).distance(best.T_1_2)
    other = ""
    if found.best is not None and found.best != k:
        top = float(found.values[found.best])
        other = f" Candidate {found.best + 1} had a higher value before refinement, {top:.3f} m, but the score chooses."
    was = "it was one that crossing segments discard" if np.isnan(before) else f"its value was {before:.3f} m"
    return (
        f"The pose is that of candidate {k + 1}, refined: {was}; refinement moved it by {moved:.3f} m and"
        f" {np.degrees(turned):.1f}°; now its value is {best.value:.3f} m and its score {best.score:.3f} m.{other}"
    )


def _seen(best: Candidate | None) -> str:
    """What lines of sight say, kind by kind."""
    seen = None if best is None else best.evidence
    if seen is None:
        return ""
    return (
        f"By lines of sight {seen.supported:.2f} m are supported, {seen.contradicted:.2f} m contradicted,"
        f" {seen.shadowed:.2f} m shadowed and {seen.unseen:.2f} m unseen."
    )
