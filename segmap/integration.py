"""INTEGRATE: the paper's three steps for two maps (Section III, Algorithm 1)."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from segmap.candidates import HEURISTICS, PAPER_HEURISTICS
from segmap.chains import matching_chains
from segmap.errors import ParameterError
from segmap.fusion import Fusion, fuse
from segmap.matches import Candidate, Match
from segmap.paper_mode import Found, Task, as_the_paper
from segmap.parameters import Parameters
from segmap.priors import PosePrior
from segmap.segments import SegmentMap
from segmap.verdict import Findings, Verdict, confidence, judge
from segmap.verified_mode import AUTOMATIC, STAGES, verified

__all__ = [
    "AUTOMATIC",
    "DEFAULT_HEURISTIC",
    "DEFAULT_PRESET",
    "MODES",
    "STAGES",
    "Candidate",
    "Integration",
    "Match",
    "Verdict",
    "chosen_heuristic",
    "findings_of",
    "heuristics",
    "integrate",
    "match_maps",
]

MODES = ("paper", "verified")
"""``paper``: Algorithms 1 to 5 as the paper has them; ``verified``: the same, then evidence beyond the paper"""
DEFAULT_HEURISTIC = {"paper": "all", "verified": AUTOMATIC}
"""the heuristic of each mode where none is asked for"""
DEFAULT_PRESET = {"paper": "default", "verified": "verified"}
"""the preset each mode's parameters start from"""


def heuristics(mode: str) -> tuple[str, ...]:
    """The heuristics of a mode: the paper's four, or those and what goes beyond."""
    return PAPER_HEURISTICS if mode == "paper" else (AUTOMATIC, *HEURISTICS)


def chosen_heuristic(mode: str, name: str | None = None) -> str:
    """The heuristic of this name, or the mode's default.

    Raises:
        ParameterError: there is no such mode, or no such heuristic in it.
    """
    if mode not in MODES:
        raise ParameterError(f"There is no mode {mode[:80]!r}. Modes are: {', '.join(MODES)}.")
    if name is not None and name not in heuristics(mode):
        known = ", ".join(heuristics(mode))
        raise ParameterError(f"There is no heuristic {name[:80]!r} in {mode} mode. Heuristics are: {known}.")
    return name or DEFAULT_HEURISTIC[mode]


@dataclass(frozen=True, eq=False)
class Integration:
    """INTEGRATE(S_1, S_2): the match, and the fused map where there is a transformation."""

    match: Match
    fusion: Fusion | None

    @property
    def map(self) -> SegmentMap | None:
        """S_1,2 in the frame of map 1."""
        return self.fusion.map if self.fusion else None


def integrate(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    prior: PosePrior | None = None,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Integration:
    """Integrate two maps (Algorithm 1): find and evaluate transformations, fuse under the best.

    Raises:
        ParameterError: there is no such heuristic or mode.
        CancelledError: raised by ``check``, which is called between blocks of work.
    """
    parameters = parameters or Parameters()
    # steps 1 and 2
    match = match_maps(map_1, map_2, parameters, heuristic, mode, prior=prior, workers=workers, check=check)
    if match.T_1_2 is None:
        return Integration(match, None)
    return Integration(match, fuse(map_1, map_2, match.T_1_2, match.chains, parameters))  # step 3


def match_maps(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    *,
    prior: PosePrior | None = None,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Match:
    """The first two steps of INTEGRATE, "scan matching": candidate transformations, and the best of them.

    Without a heuristic the mode's default is taken. A ``prior`` on ``T_1_2`` admits only what is near its mean.

    Raises: as :func:`integrate`.
    """
    name = chosen_heuristic(mode, heuristic)
    task = Task(map_1, map_2, parameters or Parameters(), name, prior, workers, check)
    started = time.perf_counter()
    found = verified(task) if mode == "verified" else as_the_paper(task)
    verdict, reasons = _verdict(found, task)
    return Match(
        mode=mode,
        heuristic=task.heuristic,
        segments=(len(map_1), len(map_2)),
        ranked=found.ranked,
        candidates=found.tried,
        discarded=found.discarded,
        draws=found.draws if task.heuristic == "random" else None,
        chains=matching_chains(map_1, map_2, found.ranked[0].T_1_2, task.parameters) if found.ranked else (),
        verdict=verdict,
        reasons=reasons,
        milliseconds=1000.0 * (time.perf_counter() - started),
        confidence=_confidence(found, task) if mode == "verified" else None,
        findings=found.findings,
    )


# --- the verdict, in words ------------------------------------------------------------------------


def _verdict(found: Found, task: Task) -> tuple[Verdict, tuple[str, ...]]:
    """The judgement on the best candidate; where there is none, the nearest criterion that failed."""
    if not found.ranked:
        return Verdict.REJECTED, (_why_none(found, task),)
    return judge(found.ranked[0].value, found.findings, task.parameters)


def findings_of(match: Match) -> Findings | None:
    """What speaks for and against the best candidate of a match; None without evidence."""
    return match.findings


def _confidence(found: Found, task: Task) -> float | None:
    """None where the verdict rests on value alone; 0 where there is no candidate."""
    if not (task.parameters.use_confidence and task.parameters.use_sights):
        return None
    if found.findings is None:
        return 0.0
    return None if found.findings.blind else confidence(found.findings)


def _why_none(found: Found, task: Task) -> str:
    for name, segment_map in sorted((("first", task.map_1), ("second", task.map_2)), key=lambda named: len(named[1])):
        if len(segment_map) < 2:
            count = "one segment" if len(segment_map) else "no segments"
            return f"The {name} map has {count}; an angle takes two. Try a smaller min_segment_length."
    if not found.tried and task.prior is not None:
        return "The prior excludes every candidate, or there is none. Try it without the prior, or a wider one."
    if not found.tried:
        return (
            "No angle of one map equals an angle of the other. Try another heuristic or a larger tolerance of angles."
        )
    if found.elsewhere is not None:
        x, y, theta = found.elsewhere
        where = f"x {x:.2f} m, y {y:.2f} m, theta {math.degrees(theta):.1f} degrees"
        return f"The prior excludes all of {found.tried} candidates. The best of them is at {where}."
    if found.discarded == found.tried:
        return f"All {found.tried} candidates were discarded: long segments cross. Try a larger segment_length_refuse."
    return f"None of {found.tried} candidates brings any two segments together."
