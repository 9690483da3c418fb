"""INTEGRATE: the paper's three steps for two maps (Section III, Algorithm 1)."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from pydantic import TypeAdapter

from segmap.candidates import Candidates, candidates
from segmap.chains import MatchingChain, matching_chains
from segmap.errors import ParameterError
from segmap.evaluation import best, evaluate
from segmap.fusion import Fusion, fuse
from segmap.parameters import Parameters
from segmap.pose import FloatArray, Pose2
from segmap.segments import SegmentMap

__all__ = ["MODES", "Candidate", "Integration", "Match", "Verdict", "integrate", "match_maps"]

MODES = ("paper",)
"""``paper``: Algorithms 1 to 5 as the paper has them"""


class Verdict(StrEnum):
    """What the program says of an integration; a person has the last word."""

    ACCEPTED = "accepted"
    REVIEW = "review"
    REJECTED = "rejected"


@dataclass(frozen=True)
class Candidate:
    """One candidate transformation and its value."""

    T_1_2: Pose2
    value: float
    """metres (III-B)"""
    angle_1: tuple[int, int]
    """the segments of map 1 whose angle it superimposes"""
    angle_2: tuple[int, int]
    """those of map 2"""
    index: int
    """place among the candidates in the order they were found, from 0"""


@dataclass(frozen=True)
class Match:
    """What the first two steps of INTEGRATE found: the ranked candidates, and a verdict on the best."""

    mode: str
    heuristic: str
    segments: tuple[int, int]
    """number of segments of map 1 and map 2"""
    ranked: tuple[Candidate, ...]
    """the best candidates, best first; ties go to the one found first"""
    candidates: int
    """poses evaluated"""
    discarded: int
    """of them, discarded because long segments cross"""
    draws: int | None
    """draws of the heuristic ``random``"""
    chains: tuple[MatchingChain, ...]
    """matching chains at the best candidate"""
    verdict: Verdict
    reasons: tuple[str, ...]
    """the verdict in words"""
    milliseconds: float

    @property
    def best(self) -> Candidate | None:
        """The best candidate; None where no transformation has a value."""
        return self.ranked[0] if self.ranked else None

    @property
    def T_1_2(self) -> Pose2 | None:
        """Pose of map 2 in the frame of map 1; None where there is none."""
        return self.ranked[0].T_1_2 if self.ranked else None

    @property
    def value(self) -> float:
        """Value of the best candidate, metres; 0 where there is none."""
        return self.ranked[0].value if self.ranked else 0.0

    @property
    def score(self) -> float:
        """What matches of one mode are ranked by: the value, metres."""
        return self.value

    def judged(self, value_threshold: float) -> Match:
        """The same match, with its verdict by another threshold, in metres; nothing is searched again."""
        if not self.ranked:
            return self
        verdict, reasons = _judgement(self.value, value_threshold)
        return replace(self, verdict=verdict, reasons=reasons)

    def to_json(self) -> str:
        """This match as one JSON document."""
        return _ADAPTER.dump_json(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Match:
        """The match that :meth:`to_json` wrote."""
        return _ADAPTER.validate_json(text)


_ADAPTER = TypeAdapter(Match)


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
    heuristic: str = "all",
    mode: str = "paper",
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Integration:
    """Integrate two maps (Algorithm 1): find and evaluate transformations, fuse under the best.

    Raises:
        ParameterError: there is no such heuristic or mode.
        CancelledError: raised by ``check``, which is called between blocks of work.
    """
    parameters = parameters or Parameters()
    match = match_maps(map_1, map_2, parameters, heuristic, mode, workers=workers, check=check)  # steps 1 and 2
    if match.T_1_2 is None:
        return Integration(match, None)
    return Integration(match, fuse(map_1, map_2, match.T_1_2, match.chains, parameters))  # step 3


def match_maps(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str = "all",
    mode: str = "paper",
    *,
    workers: int = 1,
    check: Callable[[], None] | None = None,
) -> Match:
    """The first two steps of INTEGRATE, "scan matching": candidate transformations, and the best of them.

    Raises: as :func:`integrate`.
    """
    if mode not in MODES:
        raise ParameterError(f"There is no mode {mode!r}. Modes are: {', '.join(MODES)}.")
    parameters = parameters or Parameters()
    started = time.perf_counter()
    found, values = _searched(map_1, map_2, heuristic, parameters, workers, check)
    ranked = tuple(_candidate(found, values, row) for row in best(values, parameters.ranked_candidates))
    verdict, reasons = _verdict(ranked, values, (map_1, map_2), parameters)
    return Match(
        mode=mode,
        heuristic=heuristic,
        segments=(len(map_1), len(map_2)),
        ranked=ranked,
        candidates=len(values),
        discarded=int(np.isnan(values).sum()),
        draws=found.draws if heuristic == "random" else None,
        chains=matching_chains(map_1, map_2, ranked[0].T_1_2, parameters) if ranked else (),
        verdict=verdict,
        reasons=reasons,
        milliseconds=1000.0 * (time.perf_counter() - started),
    )


def _searched(
    map_1: SegmentMap,
    map_2: SegmentMap,
    heuristic: str,
    parameters: Parameters,
    workers: int,
    check: Callable[[], None] | None,
) -> tuple[Candidates, FloatArray]:
    """All candidates and their values; ``random`` may stop after a round that is good enough (III-A2)."""
    blocks: list[Candidates] = []
    values: list[FloatArray] = []
    for block in candidates(map_1, map_2, heuristic, parameters):
        blocks.append(block)
        values.append(evaluate(map_1, map_2, block.poses, parameters, workers=workers, check=check))
        if block.draws and _good_enough(values[-1], parameters.good_enough):
            break
    return Candidates.joined(blocks), np.concatenate([np.empty(0), *values])


def _good_enough(values: FloatArray, enough: float | None) -> bool:
    return enough is not None and bool((values >= enough).any())


def _candidate(found: Candidates, values: FloatArray, row: int) -> Candidate:
    (a, b), (c, d) = found.angles_1[row], found.angles_2[row]
    return Candidate(
        T_1_2=Pose2(*found.poses[row]),
        value=float(values[row]),
        angle_1=(int(a), int(b)),
        angle_2=(int(c), int(d)),
        index=int(row),
    )


# --- the verdict, in words ------------------------------------------------------------------------


def _verdict(
    ranked: tuple[Candidate, ...],
    values: FloatArray,
    maps: tuple[SegmentMap, SegmentMap],
    parameters: Parameters,
) -> tuple[Verdict, tuple[str, ...]]:
    """Valid only above the threshold (IV-B, V-B); otherwise the nearest criterion that failed."""
    if not ranked:
        return Verdict.REJECTED, (_why_none(values, maps),)
    return _judgement(ranked[0].value, parameters.value_threshold)


def _judgement(value: float, threshold: float) -> tuple[Verdict, tuple[str, ...]]:
    if value > threshold:
        return Verdict.ACCEPTED, (f"The value, {value:.2f} m, is above the threshold of {threshold:.2f} m.",)
    return Verdict.REJECTED, (f"The best value, {value:.2f} m, is not above the threshold of {threshold:.2f} m.",)


def _why_none(values: FloatArray, maps: tuple[SegmentMap, SegmentMap]) -> str:
    for name, segment_map in zip(("first", "second"), maps, strict=True):
        if len(segment_map) < 2:
            count = "one segment" if len(segment_map) else "no segments"
            return f"The {name} map has {count}; an angle takes two. Try a smaller min_segment_length."
    if not len(values):
        return (
            "No angle of one map equals an angle of the other. Try another heuristic or a larger tolerance of angles."
        )
    if np.isnan(values).all():
        return f"All {len(values)} candidates were discarded: long segments cross. Try a larger segment_length_refuse."
    return f"None of {len(values)} candidates brings any two segments together."
